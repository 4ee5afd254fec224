# SPDX-License-Identifier: MIT
"""Who gets a slot, who keeps it, and a margin that also holds between the stages."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nmpc_control.errors import ProblemError
from nmpc_control.obstacle import Obstacle
from nmpc_control.slots import Slots, clearance

DT = 0.1  # [s]
TIMES = 7.0 + DT * np.arange(61)
AHEAD = np.outer(1.5 * (TIMES - TIMES[0]), [1.0, 0.0, 0.0]) + [0.0, 0.0, 5.0]  # 9 m along x
MARGIN = 1.0  # [m]


def ball(name, x, y=0.0, **more):
    return Obstacle(name, np.array([x, y, 5.0]), np.array([0.5]), **more)


def fill(slots, *obstacles, path=AHEAD, **more):
    return slots.fill(obstacles, TIMES, [path], MARGIN, **more)


def test_one_that_stays_keeps_its_slot():
    slots = Slots(3)
    a, b, c, d = (ball(name, x) for name, x in zip("abcd", (8.0, 2.0, 4.0, 6.0)))
    fill(slots, a, b, c)
    before = list(slots.occupants)
    data = fill(slots, d, c, b)
    assert set(before) == {"a", "b", "c"}
    assert slots.occupants == ["d" if name == "a" else name for name in before]
    assert slots.renewed == [before.index("a")]
    for row, name in enumerate(slots.occupants):
        assert data[row, 0, 0] == {"b": 2.0, "c": 4.0, "d": 6.0}[name]
    fill(slots, c)
    assert slots.occupants.index("c") == before.index("c")
    assert slots.occupants.count(None) == 2
    assert slots.renewed == []


def test_an_empty_slot_is_never_in_reach():
    data = fill(Slots(4), ball("a", 4.0))
    assert np.sum(clearance(data, AHEAD).min(axis=1) < 0.0) == 1
    assert np.all(clearance(fill(Slots(4)), AHEAD) > 0.0)


def test_those_met_first_are_chosen():
    slots = Slots(2)
    fill(slots, ball("third", 8.0), ball("first", 3.0), ball("second", 5.5))
    assert set(slots.occupants) == {"first", "second"}


def test_one_on_its_way_here_is_chosen_before_one_near_that_leaves():
    slots = Slots(1)
    leaves = ball("leaves", 3.0, 3.0, velocity=np.array([0.0, 2.0, 0.0]), stamp=TIMES[0])
    comes = ball("comes", 3.0, -5.0, velocity=np.array([0.0, 2.0, 0.0]), stamp=TIMES[0])
    fill(slots, leaves, comes)
    assert slots.occupants == ["comes"]


def test_left_out_counts_those_in_reach_only():
    obstacles = [ball("a", 2.0), ball("b", 4.0), ball("c", 6.0), ball("far", 4.0, 9.0)]
    beside = ball("beside", 8.0, 1.6)  # 1.1 m from the path: beyond the margin
    for count, reach, expected in ((4, 0.0, 0), (2, 0.0, 1), (2, 0.2, 2), (0, 0.0, 3)):
        slots = Slots(count)
        fill(slots, *obstacles, beside, reach=reach)
        assert slots.left_out == expected, (count, reach)


def test_a_copy_is_filled_on_its_own():
    slots = Slots(1)
    fill(slots, ball("a", 3.0))
    other = slots.copy()
    fill(other, ball("b", 3.0))
    assert (slots.occupants, other.occupants) == (["a"], ["b"])


@pytest.mark.parametrize(
    "bad",
    [
        Obstacle("bad", np.array([np.nan, 0.0, 5.0]), np.array([0.5])),
        Obstacle("bad", np.zeros(3), np.array([0.0])),
        Obstacle("bad", np.zeros(3), np.array([1.0, np.inf]), "cylinder"),
    ],
    ids=["nowhere", "no size", "endless"],
)
def test_what_is_nowhere_is_refused_by_name(bad):
    slots = Slots(2)
    with pytest.raises(ProblemError, match="obstacle bad"):
        fill(slots, ball("good", 3.0), bad)


vectors = st.tuples(*[st.floats(-4.0, 4.0)] * 3).map(np.array)


@given(
    own=vectors,
    velocity=vectors,
    radius=st.floats(0.1, 2.0),
    phase=st.floats(-0.5, 0.5),
    turn=st.floats(-np.pi, np.pi),
)
def test_stages_that_keep_the_slots_distance_keep_the_margin_between_them(
    own, velocity, radius, phase, turn
):
    """Straight past a moving sphere, as near as the slots allow, at any phase of the stages."""
    apart = own - velocity
    way = np.linalg.norm(apart) * DT
    assume(way > 0.02)
    along = apart / np.linalg.norm(apart)
    aside = np.cross(along, [1.0, 0, 0] if abs(along[0]) < 0.7 else [0, 1.0, 0])
    aside = aside / np.linalg.norm(aside)
    aside = np.cos(turn) * aside + np.sin(turn) * np.cross(along, aside)
    sphere = Obstacle("s", np.zeros(3), np.array([radius]), velocity=velocity, stamp=TIMES[30])

    def flown(least):
        """Return the path that passes with its stages no nearer to the centre than ``least``."""
        miss = np.sqrt(least**2 - (phase * way) ** 2)
        moved = (TIMES - TIMES[30])[:, None]
        return moved * own + phase * way * along + miss * aside

    def least_between(path):
        relative = path - sphere.position_at(TIMES)
        part = np.linspace(0.0, 1.0, 101)[:, None, None]
        return np.linalg.norm((1 - part) * relative[:-1] + part * relative[1:], axis=2).min()

    path = flown(np.hypot(radius + MARGIN, way / 2))
    data = fill(Slots(1), sphere, path=path)
    assert clearance(data, path).min() == pytest.approx(0.0, abs=1e-9)
    assert least_between(path) >= radius + MARGIN - 1e-9
    # the twin: without what the slots add, the same stages may be passed inside the margin
    path = flown(radius + MARGIN)
    assert clearance(fill(Slots(1), sphere, path=path, between=False), path).min() > -1e-9
    assert clearance(fill(Slots(1), sphere, path=path), path).min() < 0.0
    if abs(phase) > 0.1 and way > 0.1:
        assert least_between(path) < radius + MARGIN - 1e-5


@given(seed=st.integers(0, 10_000))
def test_between_any_two_stages_outside_the_margin_holds(seed):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, 0.3, (61, 3)), axis=0)
    sphere = Obstacle(
        "s", rng.normal(0, 2, 3), np.array([0.5]), velocity=rng.normal(0, 1, 3), stamp=TIMES[0]
    )
    outside = clearance(fill(Slots(1), sphere, path=path), path)[0] >= 0.0
    both = outside[:-1] & outside[1:]
    relative = path - sphere.position_at(TIMES)
    part = np.linspace(0.0, 1.0, 51)[:, None, None]
    between = np.linalg.norm((1 - part) * relative[:-1] + part * relative[1:], axis=2).min(axis=0)
    assert np.all(between[both] >= 0.5 + MARGIN - 1e-9)
