import math
import random

import pytest

from uav_sim.errors import ConfigError
from uav_sim.obstacle import Obstacle, load_obstacles
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
        ("ball", "a mapping"),
    ],
)
def test_a_wrong_entry_is_named(entry, words):
    with pytest.raises(ConfigError, match=words):
        load_obstacles([entry], "mine.yaml")


def test_ids_are_unique():
    with pytest.raises(ConfigError, match="only once"):
        load_obstacles([SPHERE, SPHERE], "mine.yaml")
