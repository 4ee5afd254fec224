# SPDX-License-Identifier: MIT
"""What senders say of obstacles is judged one by one, remembered, and grows old."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nmpc_control.errors import ConfigError
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_memory import MAX_REMEMBERED, ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting, fault, moved, to_obstacle

PARAMS = load_obstacle_parameters()
TREE = Sighting("tree", "cylinder", (0.5, 4.0), (3.0, 0.0, 2.0))
BIRD = Sighting("bird", "sphere", (0.3,), (5.0, 0.0, 2.0), (-1.0, 0.0, 0.0), stamp=10.0)


@pytest.fixture
def memory():
    return ObstacleMemory(PARAMS)


def say(memory, t, *sightings, sender="/tracker"):
    memory.hear(t, sender, [(s, fault(s)) for s in sightings])
    return memory.obstacles(t)


def names(memory, t=10.0):
    return [o.id for o in memory.obstacles(t)]


BAD = [
    ({"id": ""}, "id"),
    ({"id": "a\nb"}, "id"),
    ({"id": "x" * 65}, "id"),
    ({"shape": ""}, "shape"),
    ({"size": (-0.3,)}, "size"),
    ({"size": (0.0,)}, "size"),
    ({"size": (0.3, 0.3)}, "size"),
    ({"size": (1e5,)}, "size"),
    ({"size": (math.nan,)}, "not finite"),
    ({"position": (math.nan, 0.0, 0.0)}, "not finite"),
    ({"position": (0.0, -2e5, 0.0)}, "position"),
    ({"velocity": (0.0, math.inf, 0.0)}, "not finite"),
    ({"velocity": (40.0, 40.0, 0.0)}, "speed"),
    ({"growth": -0.1}, "growth"),
    ({"growth": math.nan}, "not finite"),
    ({"path": (4.0, 0.0, 2.0)}, "path"),
    ({"path": (4.0, 0.0, 2.0), "path_dt": -0.1}, "path"),
    ({"path": (5.0, 0.0, 2.0), "path_dt": 1e-20}, "path"),
    ({"path": (4.0, math.nan, 2.0), "path_dt": 0.1}, "path"),
    ({"path": (400.0, 0.0, 2.0), "path_dt": 0.1}, "path"),
    ({"path": (4.9, 0.0, 2.0) * 201, "path_dt": 0.1}, "path"),
    ({"stamp": 7.0}, "too old"),
    ({"stamp": 0.0}, "too old"),
    ({"stamp": 9.8}, "backwards in time"),
]


@pytest.mark.parametrize(("change", "kind"), BAD)
def test_a_bad_entry_leaves_the_last_good_one_and_the_others(memory, change, kind):
    before = say(memory, 10.0, BIRD, TREE)
    bad = BIRD._replace(**{"stamp": 10.1, **change})
    after = say(memory, 10.1, bad, TREE._replace(position=(4.0, 0.0, 2.0)))
    assert memory.rejected == {kind: 1}
    assert [o.id for o in after] == (["tree"] if kind == "id" else ["tree", "bird"])
    assert after[0].position[0] == 4.0
    if kind != "id":
        assert after[1] is before[0]
    good = BIRD._replace(stamp=10.2)
    say(memory, 10.2, good)
    assert memory.rejected == {kind: 1}, "the twin without the change is taken"
    assert memory.obstacles(10.2)[0].stamp == 10.2


def test_a_bad_entry_that_was_never_good_is_not_known(memory):
    assert say(memory, 10.0, BIRD._replace(size=(-1.0,))) == ()


def test_of_a_double_id_the_first_is_taken(memory):
    other = BIRD._replace(position=(9.0, 0.0, 0.0))
    (bird,) = say(memory, 10.0, BIRD, other)
    assert bird.position[0] == 5.0
    assert memory.rejected == {"duplicate id": 1}


def test_a_stamp_from_the_future_counts_as_now(memory):
    (bird,) = say(memory, 10.0, BIRD._replace(stamp=4e9))
    assert bird.stamp == 10.0
    assert memory.rejected == {"from the future": 1}
    (bird,) = say(memory, 10.1, BIRD._replace(stamp=10.25))
    assert (bird.stamp, sum(memory.rejected.values())) == (10.25, 1)


def test_absent_from_a_newer_list_is_gone_for_that_sender_only(memory):
    say(memory, 10.0, BIRD, TREE)
    say(memory, 10.0, TREE._replace(id="mast"), sender="/laser")
    assert names(memory) == ["bird", "tree", "mast"]
    say(memory, 10.1, TREE)
    assert names(memory) == ["tree", "mast"]
    say(memory, 10.1, sender="/laser")
    assert names(memory) == ["tree"]


def test_the_same_id_of_two_senders_is_two_obstacles(memory):
    say(memory, 10.0, BIRD)
    say(memory, 10.0, BIRD._replace(position=(0.0, 9.0, 1.0)), sender="/laser")
    assert names(memory) == ["bird", "bird@/laser"]
    say(memory, 10.1, sender="/tracker")
    say(memory, 10.1, BIRD._replace(stamp=10.1), sender="/laser")
    assert names(memory) == ["bird"]


def test_the_tuple_is_another_one_only_when_the_content_is(memory):
    first = say(memory, 10.0, TREE)
    assert say(memory, 11.0, TREE._replace(stamp=11.0)) is first
    assert say(memory, 12.0, TREE._replace(size=(0.6, 4.0))) is not first
    moving = say(memory, 13.0, BIRD._replace(stamp=13.0))
    assert say(memory, 13.1, BIRD._replace(stamp=13.0)) is moving
    assert memory.obstacles(13.4) is moving
    assert memory.obstacles(13.6) is not moving, "the information is older than the limit"
    assert memory.obstacles(13.7) is memory.obstacles(90.0)


def test_what_moves_grows_with_age_and_what_stands_does_not(memory):
    say(memory, 10.0, BIRD, BIRD._replace(id="fast", growth=0.4), TREE)
    assert [o.growth_at(10.4) for o in memory.obstacles(10.4)] == pytest.approx([0.0, 0.16, 0.0])
    assert [o.growth_at(11.0) for o in memory.obstacles(11.0)] == pytest.approx([0.1, 0.4, 0.0])
    assert memory.obstacles(500.0)[2].growth_at(500.0) == 0.0


def test_a_silent_sender_of_moving_ones_is_stale_until_it_speaks_or_is_forgotten(memory):
    say(memory, 10.0, BIRD)
    say(memory, 10.0, TREE, sender="/laser")
    assert memory.stale(12.0) == ""
    assert memory.stale(12.5) == "/tracker reported moving obstacles and is silent for 2.5 s"
    say(memory, 12.5, TREE, sender="/laser")
    assert memory.stale(12.5), "that others speak does not help"
    say(memory, 12.6, BIRD._replace(stamp=12.6))
    assert memory.stale(12.6) == ""
    assert memory.stale(20.0)
    assert memory.forget("/tracker") == 1
    assert memory.stale(14.4) == ""
    assert names(memory, 20.0) == ["tree"]
    assert memory.stale(900.0) == "/laser reported obstacles and is silent for 887.5 s"
    assert memory.obstacles(900.0)[0].growth_at(900.0) == 0.0, "what stands does not grow"


def test_a_live_sender_with_old_news_of_one_obstacle_is_stale(memory):
    say(memory, 10.0, BIRD)
    for t in (10.5, 11.0, 11.5, 12.0, 12.5):
        say(memory, t, BIRD._replace(size=(math.nan,)), TREE)
    assert memory.stale(12.5) == "what /tracker says of obstacle bird is 2.5 s old"
    say(memory, 12.6, TREE)
    assert memory.stale(12.6) == "", "it says that the bird is gone"


def test_repeated_old_news_is_no_fault_but_stale(memory):
    say(memory, 10.0, BIRD)
    say(memory, 12.5, BIRD)
    assert not memory.rejected
    assert memory.stale(12.5) == "what /tracker says of obstacle bird is 2.5 s old"


def test_known_ones_give_way_to_what_is_heard(memory):
    known = [Obstacle(name, np.zeros(3), np.ones(1)) for name in ("bird", "tree", "wall")]
    memory.set_known(known)
    say(memory, 10.0, BIRD, TREE)
    assert names(memory) == ["wall", "bird", "tree"]
    say(memory, 10.1)
    assert names(memory) == ["bird", "tree", "wall"]


@pytest.mark.parametrize("end", ["absent", "forgotten", "a jump of the clock"])
def test_one_moving_report_hides_a_known_one_only_for_as_long_as_it_is_kept(memory, end):
    memory.set_known([Obstacle("bird", np.zeros(3), np.ones(1))])
    (seen,) = say(memory, 10.0, BIRD)
    assert seen.stamp == 10.0, "while it is reported it is not in two places"
    if end == "absent":
        say(memory, 10.1)
    elif end == "forgotten":
        memory.forget("/tracker")
    else:
        memory.start_anew()
    (known,) = memory.obstacles(10.2)
    assert (known.stamp, known.position[0]) == (None, 0.0)


def test_no_more_than_the_limit_is_remembered_and_no_more_than_fits_counts(memory):
    many = [TREE._replace(id=f"tree {i}") for i in range(MAX_OBSTACLES)]
    senders = [f"/map{i}" for i in range(MAX_REMEMBERED // MAX_OBSTACLES)]
    for sender in senders[:-1]:
        say(memory, 10.0, *many, sender=sender)
    say(memory, 10.0, *many[1:], sender=senders[-1])
    assert (memory.stale(10.0), memory.rejected) == ("", {})
    say(memory, 10.0, BIRD, BIRD._replace(id="second"), sender="/laser")
    assert len(memory.obstacles(10.0)) == MAX_OBSTACLES
    assert memory.rejected == {"no room": 1}
    assert memory.stale(10.0) == "what /laser says of obstacle second is of no use: no room"
    say(memory, 10.1, *many, sender=senders[0])
    assert len(memory.obstacles(10.1)) == MAX_OBSTACLES, "those that are known keep their place"
    assert memory.rejected == {"no room": 1}
    assert memory.summary(10.1).left_out == MAX_REMEMBERED - MAX_OBSTACLES


def test_after_a_jump_of_the_clock_only_what_stands_is_left(memory):
    say(memory, 10.0, BIRD, TREE)
    memory.start_anew()
    assert names(memory, 2.0) == ["tree"]
    assert say(memory, 2.0, BIRD._replace(stamp=2.0))[0].id == "bird"


def test_the_summary_counts(memory):
    say(memory, 10.0, BIRD, TREE, TREE._replace(id=""))
    summary = memory.summary(10.4)
    assert summary[:2] == (2, 1)
    assert summary.oldest == pytest.approx(0.4)
    assert (summary.senders, summary.rejected) == (("/tracker",), {"id": 1})


def test_limits_must_fit_together(tmp_path):
    (tmp_path / "obstacles.yaml").write_text(
        "{age_limit: 2, default_growth: 0, stale_after: 1, future_tolerance: 0, message_rate: 1}"
    )
    with pytest.raises(ConfigError, match="stale_after"):
        load_obstacle_parameters(tmp_path)


NUMBERS = st.floats(width=64) | st.floats(-9, 9)
ENTRIES = st.builds(
    Sighting,
    id=st.sampled_from(["a", "b", "c", "", "\0"]),
    shape=st.sampled_from(["sphere", "cylinder", "box", ""]),
    size=st.lists(st.floats(0.1, 9) | NUMBERS, max_size=4).map(tuple),
    position=st.tuples(*[NUMBERS] * 3),
    velocity=st.tuples(*[NUMBERS] * 3) | st.just((0.0, 0.0, 0.0)),
    path=st.lists(NUMBERS, max_size=2).map(lambda x: tuple(3 * x)),
    path_dt=NUMBERS,
    growth=st.floats(0, 1) | NUMBERS,
    stamp=st.floats(0, 20) | NUMBERS.filter(math.isfinite),
)
LISTS = st.tuples(st.sampled_from(["/x", "/y"]), st.floats(0.0, 3.0), st.lists(ENTRIES, max_size=4))


@given(st.lists(LISTS, max_size=8))
def test_whatever_is_said_only_sound_obstacles_are_known(said):
    memory, t, late, refusals, heard = ObstacleMemory(PARAMS), 10.0, {}, {}, {}
    for sender, pause, entries in said:
        t += pause
        before = {track.sighting.id for track in memory._tracks.get(sender, {}).values()}
        refused = memory.hear(t, sender, [(s, fault(s)) for s in entries])
        late[sender] = {name for name, kind in refused if kind == "too old"}
        heard[sender] = t
        refusals[sender] = {name for name, kind in refused if kind != "from the future"}
        new = refusals[sender] - before - {*memory._tracks.get(sender, {})}
        assert memory.stale(t) or not new, "what is heard of first and refused"
        obstacles = memory.obstacles(t)
        assert len({o.id for o in obstacles}) == len(obstacles)
        for o in obstacles:
            times = t + np.arange(0.0, 6.0, 0.5)
            assert np.isfinite(o.position_at(times)).all()
            assert np.isfinite(o.growth_at(times)).all()
            assert (o.size > 0.0).all()
        assert memory.obstacles(t) is obstacles
        moving = [o for o in obstacles if o.stamp is not None]
        is_old = any(t - o.stamp > PARAMS.stale_after for o in moving)
        moving_ids = {o.id.split("@")[0] for o in moving}
        assert memory.stale(t) or not is_old
        assert memory.stale(t) or not set().union(*late.values()) - moving_ids
        is_silent = any(t - then > PARAMS.stale_after for then in heard.values())
        assert memory.stale(t) or not is_silent
        assert is_old or is_silent or any(refusals.values()) or not memory.stale(t)


ANGLES = st.floats(-math.pi, math.pi)


@given(ANGLES, ANGLES, ANGLES, st.sampled_from(["sphere", "cylinder", "box"]), st.integers(0, 99))
def test_in_another_frame_it_covers_what_it_covered(roll, pitch, yaw, shape, seed):
    rng = np.random.default_rng(seed)
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    R = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    offset = rng.normal(size=3)
    size = tuple(rng.uniform(0.2, 3.0, {"sphere": 1, "cylinder": 2, "box": 3}[shape]))
    place, velocity = tuple(rng.normal(size=3)), tuple(rng.normal(size=3))
    path = tuple(rng.normal(size=6))
    one = Sighting("o", shape, size, place, velocity, path, 1.0, 0.0, 10.0)
    other = to_obstacle(moved(one, R, offset), "o")
    points = rng.normal(scale=3.0, size=(200, 3))
    inside = points[to_obstacle(one, "o").distance(points) <= 0.0]
    assert (other.distance(inside @ R.T + offset) <= 1e-9).all()
    np.testing.assert_allclose(other.velocity, R @ velocity)
    np.testing.assert_allclose(other.path, np.reshape(path, (-1, 3)) @ R.T + offset)


def test_a_box_that_is_only_turned_by_a_quarter_stays_as_small():
    turned = moved(
        Sighting("o", "box", (1.0, 2.0, 3.0), (1.0, 0.0, 0.0)),
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        (0.0, 0.0, 5.0),
    )
    assert turned.size == (2.0, 1.0, 3.0)
    assert turned.position == (0.0, 1.0, 5.0)
    upright = moved(TREE, np.eye(3), (0.0, 0.0, 0.0))
    assert upright == TREE
