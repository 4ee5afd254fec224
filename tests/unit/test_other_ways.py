# SPDX-License-Identifier: MIT
"""Ways round that one local solution does not find, and a side that is kept."""

import dataclasses
import sys

import numpy as np
import pytest

from nmpc_control.guides import Turns
from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.other_ways import OtherWays
from nmpc_control.params import load_parameters
from nmpc_control.state import hover_input, hover_state

SPEED, TICK = 1.5, 0.1  # [m/s], [s]
BALL = Obstacle("ball", np.array([5.0, 0.0, 5.0]), np.array([0.5]))
POLE = Obstacle("pole", np.array([5.0, 0.0, 5.0]), np.array([0.5, 40.0]), "cylinder")
MARGIN = 1.0  # [m] of the centre from a surface


@pytest.fixture(scope="module")
def nmpc() -> Nmpc:
    return Nmpc(with_guides(1))


def with_guides(count, backend="compiled"):
    usual = load_parameters()
    patient = dataclasses.replace(usual.solver, backend=backend).with_budget(time_budget=10.0)
    avoidance = dataclasses.replace(usual.avoidance, guides=count)
    return dataclasses.replace(usual, solver=patient, avoidance=avoidance)


def fly(nmpc, guides, obstacles, ticks, y=0.0, noise=0.0):
    """Fly the model straight along x from rest; returns states (ticks + 1, 10) and the plans."""
    nmpc.use(with_guides(guides))
    nmpc.reset()
    nmpc._other_ways = type(nmpc._other_ways)(guides, shooting=True)
    rng = np.random.default_rng(3)
    x, u = hover_state(np.array([0.0, y, 5.0])), hover_input()
    states, plans = [x], []
    for i in range(ticks):
        x_ref = np.zeros((nmpc.structure.horizon + 1, 10))
        x_ref[:, 0] = SPEED * (TICK * i + nmpc.structure.dt * np.arange(len(x_ref)))
        x_ref[:, 2], x_ref[:, 6] = 5.0, SPEED
        plan = nmpc.solve(TICK * i, x, x_ref, u, obstacles)
        nmpc.prepare()
        assert plan.found
        u, x = plan.inputs[0], plan.states[1].copy()
        x[:3] += noise * rng.normal(size=3)
        states.append(x)
        plans.append(plan)
    return np.array(states), plans


def side(plan):
    """Return where (2,) [1] a plan is, seen along x, where it passes the ball; None if nowhere."""
    passing = np.nonzero(plan.states[:, 0] >= BALL.position[0])[0]
    if not len(passing):
        return None
    offset = plan.states[passing[0], 1:3] - BALL.position[1:]
    return offset / np.linalg.norm(offset)


def test_head_on_a_way_is_found_that_the_plain_solver_does_not_see(nmpc):
    """Exactly in the middle no gradient points to any side."""
    states, _ = fly(nmpc, 1, (POLE,), 70)
    assert states[-1, 0] > POLE.position[0] + 1.5
    assert POLE.distance(states[:, :3]).min() > MARGIN
    assert nmpc.held_up_by == ()
    stays, _ = fly(nmpc, 0, (POLE,), 45)
    assert stays[-1, 0] < POLE.position[0] - MARGIN, "the twin stands before it"
    assert nmpc.held_up_by == ("pole",)


def test_the_side_is_kept(nmpc):
    """Noise that favours now one side and now another flips it never."""
    _, plans = fly(nmpc, 1, (BALL,), 40, noise=0.01)
    chosen = [way for way in map(side, plans) if way is not None]
    assert len(chosen) > 30
    settled = chosen[5:]  # all sides have had their turn
    assert min(float(way @ settled[-1]) for way in settled) > 0.7
    assert nmpc._other_ways.changes <= 3


class Counting:
    """A solver that counts its solves."""

    def __init__(self, solver):
        self.solver, self.solves = solver, 0

    def solve(self, instance, guess=None):
        self.solves += 1
        return self.solver.solve(instance, guess)


@pytest.fixture
def counting(nmpc):
    """Yield the counter of a controller's solver."""
    nmpc.solver = Counting(nmpc.solver)
    yield nmpc.solver
    nmpc.solver = nmpc.solver.solver


def test_what_does_not_stand_in_the_way_costs_nothing(nmpc, counting):
    beside = dataclasses.replace(BALL, position=np.array([5.0, 2.5, 5.0]))
    fly(nmpc, 1, (beside,), 4)
    assert counting.solves == 4


def test_a_tick_from_scratch_tries_few_sides_and_the_next_ones_the_others(nmpc, counting):
    """Each try is two solves: of the way itself, and of the problem from there."""
    tried = []
    take = Turns.take

    def noted(self, count):
        tried.append(take(self, count))
        return tried[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Turns, "take", noted)
        fly(nmpc, 1, (BALL,), 1)
        assert counting.solves <= 1 + 2 * 3
        tried.clear()
        fly(nmpc, 1, (BALL,), 6)
        assert [len(sides) for sides in tried] == [3, 1, 1, 1, 1, 1]
        assert sorted(sum(tried, [])) == list(range(8)), "all had their turn"
        tried.clear()
        fly(nmpc, 1, (BALL,), 12)
        assert len(tried) == 6 + 2, "then one now and then"


def test_a_plan_does_not_wait_for_other_ways(nmpc, counting):
    """They are looked for until the next solve; at its beginning where there was no time."""
    _, plans = fly(nmpc, 1, (BALL,), 2)
    x_ref, x = np.tile(plans[-1].states[0], (nmpc.structure.horizon + 1, 1)), plans[-1].states[2]
    x_ref[:, 0] += np.linspace(0.0, 10.0, len(x_ref))
    starts = []
    for prepares in (True, False):
        fly(nmpc, 1, (BALL,), 2)
        counting.solves = 0
        nmpc.solve(2 * TICK, x, x_ref, hover_input(), (BALL,))
        assert counting.solves == 1
        if prepares:
            nmpc.prepare()
            assert counting.solves > 1
        starts.append(nmpc.solve(3 * TICK, x, x_ref, hover_input(), (BALL,)).states)
    assert np.array_equal(*starts)


def test_ticks_that_find_nothing_try_all_sides_in_turn(nmpc):
    nowhere = OtherWays(1, shooting=True)
    nowhere._turns.take(5)
    tried = [nowhere._due(at_once=True) for _ in range(4)]
    assert tried == [[0, 1, 2], [3, 4, 5], [6, 7, 0], [0, 1, 2]], "each round begins with the right"


def test_a_dead_end_is_left_for_the_side_that_is_open(nmpc):
    """From the left of the middle the near side is left, but a wall stands there."""
    wall = Obstacle("wall", np.array([5.0, 3.0, 5.0]), np.array([2.9]))
    states, _ = fly(nmpc, 1, (BALL, wall), 75, y=0.05)
    least = min(o.distance(states[:, :3]).min() for o in (BALL, wall))
    assert least > MARGIN
    assert states[-1, 0] > BALL.position[0] + 1.0


def test_a_long_way_round_is_worked_out_before_it_is_judged(nmpc, monkeypatch):
    """Around four large spheres the first iterations are still dearer than to wait."""
    monkeypatch.setattr(sys.modules[__name__], "SPEED", 1.0)
    places = {
        "over": (0.0, 2.08),
        "under": (0.0, -2.08),
        "left": (2.08, 0.0),
        "right": (-2.08, 0.0),
    }
    four = [
        Obstacle(n, np.array([4.3, y, 5.0 + z]), np.array([1.91])) for n, (y, z) in places.items()
    ]
    states, _ = fly(nmpc, 1, four, 60)
    assert states[-1, 0] > 4.0
    assert min(o.distance(states[:, :3]).min() for o in four) > MARGIN
    monkeypatch.setattr("nmpc_control.other_ways._ROUNDS", 0)
    waiting, _ = fly(nmpc, 1, four, 60)
    assert waiting[-1, 0] < 2.5, "the twin hesitates"


def posed(nmpc, speed=SPEED, own=0.0):
    """Return the problem of an aircraft at rest, or at its own speed [m/s], at the origin."""
    x_ref = np.zeros((nmpc.structure.horizon + 1, 10))
    x_ref[:, 0] = speed * nmpc.structure.dt * np.arange(len(x_ref))
    x_ref[:, 2], x_ref[:, 6] = 5.0, speed
    x0 = hover_state(np.array([0.0, 0.0, 5.0]))
    x0[6] = own
    return nmpc._pose(0.0, x0, x_ref, hover_input(), [BALL], None)


@pytest.mark.parametrize(
    ("when", "depth", "counts"),
    [
        (0.5, 0.06, True),
        (0.5, 0.01, False),
        (3.0, 0.06, False),
        (3.0, 0.15, True),
        (5.0, 0.5, False),
    ],
)
def test_a_short_cut_counts_where_it_is_soon_and_more_than_a_touch(nmpc, when, depth, counts):
    problem = posed(nmpc)
    found = nmpc.solver.solve(problem.free(problem.x_ref[:, :3]))
    states = np.tile(problem.x0, (len(problem.times), 1))
    k = int(round(when / nmpc.structure.dt))
    states[k, :3] = BALL.position - [0.5 + problem.margin - depth, 0.0, 0.0]
    cut = problem.short_cut(ObstacleField([BALL]), dataclasses.replace(found, states=states))
    assert (cut > 0.0) is counts


def test_in_haste_it_keeps_farther_off(nmpc):
    assert posed(nmpc, own=SPEED).margin == posed(nmpc).margin
    assert posed(nmpc, own=3.3).margin == pytest.approx(posed(nmpc).margin + 0.12)
    assert posed(nmpc, own=9.0).margin == pytest.approx(posed(nmpc).margin + 0.2)
