import math
import random

import pytest

from uav_sim.errors import ConfigError
from uav_sim.obstacle import Obstacle, load_obstacles
from uav_sim.scene import Scene
from uav_sim.world import World

SPHERE = {"id": "ball", "position": [0.0, 0.0, 5.0], "radius": 1.0}
PILLAR = {"id": "pillar", "shape": "cylinder", "position": [0, 0, 5], "radius": 1.0, "height": 4.0}
WALL = {"id": "wall", "shape": "box", "position": [0, 0, 5], "size": [0.1, 8.0, 6.0]}


def fly(world, *points, dt=0.1):
    for k, point in enumerate(points):
        world.observe(k * dt, point)
    return world


@pytest.mark.parametrize(
    ("entry", "offset", "distance"),
    [
        (SPHERE, (3.0, 4.0, 0.0), 4.0),
        (SPHERE, (0.0, 0.0, 0.0), -1.0),
        (PILLAR, (4.0, 0.0, 1.0), 3.0),
        (PILLAR, (0.5, 0.0, 5.0), 3.0),
        (PILLAR, (4.0, 0.0, 6.0), 5.0),
        (PILLAR, (0.8, 0.0, 0.0), -0.2),
        (WALL, (3.05, 8.0, 0.0), 5.0),
        (WALL, (0.0, 0.0, 0.0), -0.05),
    ],
)
def test_distance_to_surface(entry, offset, distance):
    (obstacle,) = load_obstacles([entry], "test")
    assert obstacle.distance(*offset) == pytest.approx(distance)


def test_clearance_is_counted_from_the_hull():
    world = fly(World.from_list([SPHERE], 0.5), (-5.0, 0.0, 5.0), (-3.0, 0.0, 5.0))
    assert world.clearance == {"ball": pytest.approx(1.5)}
    assert world.collisions == []


@pytest.mark.parametrize("entry", [SPHERE, PILLAR, WALL])
def test_a_pass_between_two_samples_is_a_collision(entry):
    world = fly(World.from_list([entry], 0.1), (-50.0, 0.2, 5.0), (50.0, 0.2, 5.0))
    (collision,) = world.collisions
    assert collision.id == entry["id"] and collision.clearance < 0.0
    assert collision.t == pytest.approx(0.05, abs=1e-6)


def test_a_near_miss_between_two_samples_gives_its_exact_clearance():
    world = fly(World.from_list([SPHERE], 0.5), (-50.0, 1.7, 5.0), (50.0, 1.7, 5.0))
    assert world.clearance["ball"] == pytest.approx(0.2) and world.collisions == []


def test_each_contact_is_recorded_once():
    inside, outside = (0.0, 1.2, 5.0), (0.0, 9.0, 5.0)
    world = fly(World.from_list([SPHERE], 0.5), outside, inside, inside, outside, inside, outside)
    assert [c.t for c in world.collisions] == pytest.approx([0.1, 0.4])


def test_second_contact_shallower_than_the_first_is_recorded():
    points = [(0.0, 9.0, 5.0), (0.0, 0.1, 5.0), (0.0, 9.0, 5.0), (0.0, 1.4, 5.0)]
    world = fly(World.from_list([SPHERE], 0.5), *points)
    assert len(world.collisions) == 2
    assert world.clearance["ball"] == pytest.approx(-1.4)


def test_a_moving_obstacle_hits_a_standing_aircraft():
    entry = dict(SPHERE, position=[-10.0, 0.0, 5.0], velocity=[40.0, 0.0, 0.0])
    world = fly(World.from_list([entry], 0.5), *[(0.0, 0.0, 5.0)] * 6)
    (collision,) = world.collisions
    assert 0.2 < collision.t <= 0.3
    assert world.states()[0].position == pytest.approx((10.0, 0.0, 5.0))


def test_skipping_far_obstacles_changes_no_clearance():
    rng = random.Random(1)
    obstacles = [
        Obstacle(
            str(k), "sphere", (0.5,), tuple(rng.uniform(-8, 8) for _ in range(3)), (0.5, -0.3, 0.0)
        )
        for k in range(20)
    ]
    world, position, least = World(obstacles, 0.5), (0.0, 0.0, 0.0), [math.inf] * 20
    for k in range(2000):
        t, before = 0.01 * k, position
        position = tuple(p + rng.uniform(-0.1, 0.1) for p in position) if k else position
        world.observe(t, position)
        for i, obstacle in enumerate(obstacles):
            t0 = max(0.0, t - 0.01)
            ends = [
                tuple(a - b for a, b in zip(p, obstacle.path.position(s)))
                for p, s in ((before, t0), (position, t))
            ]
            least[i] = min(least[i], obstacle.nearest(*ends)[0])
    assert list(world.clearance.values()) == pytest.approx([d - 0.5 for d in least])


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({**SPHERE, "radius": -1.0}, r"obstacles\[0\].radius: got -1.0"),
        ({**SPHERE, "radius": math.nan}, "radius: got nan"),
        ({**SPHERE, "shape": "cone"}, "one of sphere, cylinder, box"),
        ({**SPHERE, "size": [1, 1, 1]}, r"obstacles\[0\].size"),
        ({"id": "a", "radius": 1.0}, "position: got None"),
        ({**SPHERE, "position": [0, 0]}, "a list of 3 numbers"),
        ({**WALL, "size": 3}, "a list of 3 numbers"),
        ({**SPHERE, "id": 7}, "id: got 7"),
        ({**SPHERE, "id": "ground"}, "id: got 'ground'"),
        ("ball", "a mapping"),
    ],
)
def test_a_wrong_entry_is_named(entry, words):
    with pytest.raises(ConfigError, match=words):
        load_obstacles([entry], "mine.yaml")


def test_ids_are_unique():
    with pytest.raises(ConfigError, match="only once"):
        load_obstacles([SPHERE, SPHERE], "mine.yaml")


def densely(entry, start, end, t0, t1):
    """Return the least distance centre to surface, by ten thousand samples."""
    (obstacle,) = load_obstacles([entry], "test")
    least = math.inf
    for k in range(10001):
        share = k / 10000
        own = tuple(a + share * (b - a) for a, b in zip(start, end))
        body = obstacle.path.position(t0 + share * (t1 - t0))
        least = min(least, obstacle.distance(*(a - b for a, b in zip(own, body))))
    return least


@pytest.mark.parametrize(
    "motion",
    [
        {"motion": {"type": "circle", "center": [0.0, 0.0], "speed": 3.0}},
        {"motion": {"type": "circle", "center": [4.0, 1.0], "speed": -6.0}},
        {
            "velocity": [0.0, 9.0, 0.0],
            "motion": {"type": "line", "distance": 5.0, "end": "bounce"},
        },
        {
            "motion": {
                "type": "spline",
                "points": [[4, 3, 5], [0, 4, 6], [-2, 1, 5]],
                "speed": 4.0,
                "end": "loop",
            }
        },
    ],
)
def test_between_distant_samples_curves_are_judged_to_a_millimetre_and_never_too_far(motion):
    entry = {**SPHERE, "position": [5.0, 0.0, 5.0], **motion}
    world, place, least = World.from_list([entry], 0.5), (0.0, 8.0, 5.0), math.inf
    world.observe(0.0, place)
    for k, target in enumerate([(3.0, 3.0, 5.0), (6.0, -3.0, 5.5), (-4.0, 2.0, 5.0)]):
        world.observe(0.7 * (k + 1), target)
        least = min(least, densely(entry, place, target, 0.7 * k, 0.7 * (k + 1)))
        place = target
    assert least - 0.5 - 1e-3 <= world.clearance["ball"] <= least - 0.5 + 1e-6


@pytest.mark.parametrize("angle", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
def test_the_bulge_of_a_curve_beyond_its_chords_counts(angle):
    """The nearest point of the orbit lies between two samples, where its chord is farther off."""
    entry = {
        **SPHERE,
        "position": [5.0 * math.cos(angle), -5.0 * math.sin(angle), 5.0],
        "motion": {"type": "circle", "center": [0.0, 0.0], "speed": 2.0},
    }
    world = fly(World.from_list([entry], 0.5), *[(8.0, 0.0, 5.0)] * 2, dt=5.0 * angle)
    assert 1.5 - 1e-3 <= world.clearance["ball"] <= 1.5 + 1e-9


def test_a_chase_is_the_same_in_long_and_in_short_steps():
    entry = {**SPHERE, "motion": {"type": "chase", "speed": 2.0, "acceleration": 1.0}}
    places = []
    for count in (4, 400):
        world = World.from_list([entry], 0.1)
        for k in range(count + 1):
            world.observe(4.0 * k / count, (8.0, 3.0 * k / count, 5.0))
        places.append(world.states()[0].position)
    assert places[0] == pytest.approx(places[1], abs=0.02)


def test_a_body_that_turns_round_between_two_samples_hits_where_it_turns():
    entry = dict(
        SPHERE,
        position=[-10.0, 0.0, 5.0],
        velocity=[10.0, 0.0, 0.0],
        motion={"type": "line", "distance": 9.0, "end": "bounce"},
    )
    world = World.from_list([entry], 0.5)
    for k in range(8):
        world.observe(0.25 * k, (0.4, 0.0, 5.0))
    (collision,) = world.collisions
    assert collision.t == pytest.approx(0.9) and collision.clearance == pytest.approx(-0.1)


def test_a_chase_ends_in_a_collision():
    entry = {**SPHERE, "motion": {"type": "chase", "speed": 4.0, "acceleration": 2.0}}
    world, k = World.from_list([entry], 0.5), 0
    while not world.collisions and k < 3000:
        world.observe(0.01 * k, (10.0 + 0.02 * k, 0.0, 5.0))
        k += 1
    (collision,) = world.collisions
    assert 4.0 < collision.t < 8.0 and -0.05 < collision.clearance < 0.0
    assert len(world.new_collisions) == 1


def test_an_obstacle_may_appear_where_the_aircraft_is():
    world = World.from_list([{**SPHERE, "appear": {"at": 0.25}}], 0.5)
    fly(world, *[(0.0, 0.3, 5.0)] * 2)
    assert world.clearance == {"ball": math.inf} and world.states() == []
    for k in (2, 3, 4):
        world.observe(0.1 * k, (0.0, 0.3, 5.0))
    (collision,) = world.collisions
    assert collision.t == pytest.approx(0.25) and collision.clearance == pytest.approx(-1.2)
    assert [state.obstacle.id for state in world.states()] == ["ball"]


def test_a_new_flight_begins_with_obstacles_at_their_places():
    entry = {**SPHERE, "motion": {"type": "chase", "speed": 4.0, "acceleration": 2.0}}
    world = fly(World.from_list([entry], 0.5), *[(9.0, 0.0, 5.0)] * 20)
    assert world.states()[0].position[0] > 1.0
    world.reset()
    assert world.states()[0].position == (0.0, 0.0, 5.0)
    assert world.clearance == {"ball": math.inf}


@pytest.mark.parametrize(
    ("changes", "moves"),
    [({}, False), ({"velocity": [0, 0, 1]}, True), ({"appear": {"at": 1.0}}, True)],
)
def test_a_world_knows_whether_anything_moves(changes, moves):
    assert World.from_list([{**SPHERE, **changes}], 0.5).moves is moves


def pair(*obstacles):
    scene = Scene(load_obstacles(list(obstacles), "test"))
    return World(scene, 0.5, "dji1"), World(scene, 0.4, "dji2")


def test_aircraft_are_obstacles_of_each_other():
    first, second = pair()
    for k in range(11):
        first.observe(0.1 * k, (-50.0 + 10.0 * k, 0.0, 5.0))
        second.observe(0.1 * k, (50.0 - 10.0 * k, 0.6, 5.0))
    for world, other in ((first, "dji2"), (second, "dji1")):
        (collision,) = world.collisions
        assert collision.id == other
        assert collision.t == pytest.approx(0.5)
        assert collision.clearance == pytest.approx(0.6 - 0.9)
    (seen,) = first.states()
    assert seen.obstacle.id == "dji2" and seen.obstacle.size == (0.4,)
    assert seen.position == (-50.0, 0.6, 5.0)
    assert seen.velocity == pytest.approx((-100.0, 0.0, 0.0))


def test_obstacles_of_one_scene_move_once_for_all_its_aircraft():
    entry = {**SPHERE, "motion": {"type": "chase", "speed": 1.0, "acceleration": 1.0}}
    first, second = pair(entry)
    for k in range(200):
        first.observe(0.01 * k, (-20.0, 0.0, 5.0))
        second.observe(0.01 * k, (0.0, 10.0, 5.0))
    assert first.states()[0] == second.states()[0]
    x, y, _ = first.states()[0].position
    assert abs(x) < 1e-9 and 1.0 < y < 2.0, "the nearest is chased"


def test_a_collision_is_not_lost_where_an_aircraft_is_silent():
    first, _ = pair()
    first.observe(0.0, (0.0, 0.0, 5.0))
    with pytest.raises(RuntimeError, match="no position of aircraft .'dji2'"):
        first.observe(0.1, (0.0, 0.0, 5.0))


def test_aircraft_have_names_of_their_own():
    scene = Scene(load_obstacles([SPHERE], "test"))
    World(scene, 0.5, "dji1")
    for taken in ("dji1", "ball"):
        with pytest.raises(ValueError, match="that name is taken"):
            World(scene, 0.5, taken)
