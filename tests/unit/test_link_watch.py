# SPDX-License-Identifier: MIT
"""The offset between two clocks and the delay of the link, from plans alone."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import PARAMS, Flight, make_plan
from hypothesis import given
from hypothesis import strategies as st

from nmpc_control.link_watch import WINDOW, LinkParameters, LinkWatch
from nmpc_control.mode_inputs import Mode
from nmpc_control.state import Goal, Plan, hover_input, hover_state

TOLERANCE = PARAMS.link.clock_tolerance


def plan(t, state_t, solve_time=0.0):
    states = np.tile(hover_state(np.zeros(3)), (2, 1))
    inputs = hover_input()[None]
    return Plan(t, 0.1, 0.1, states, inputs, solve_time=solve_time, state_t=state_t)


def watch(offset, down, up, solving=0.002, count=WINDOW):
    """Return a watch that has seen plans over a link with these delays (functions of nothing)."""
    it = LinkWatch(LinkParameters(TOLERANCE))
    for k in range(count):
        measured = 100.0 + 0.05 * k
        solved = measured + down()
        it.take(solved + solving + up(), plan(solved + offset, measured, solving))
    return it


@given(
    offset=st.floats(-5.0, 5.0),
    down=st.floats(0.0, 0.3),
    up=st.floats(0.0, 0.3),
)
def test_the_offset_is_known_to_half_of_what_the_two_ways_differ_by(offset, down, up):
    seen = watch(offset, lambda: down, lambda: up)
    assert seen.offset == pytest.approx(offset + 0.5 * (down - up), abs=1e-9)
    assert seen.delay == pytest.approx(down + up, abs=1e-9)


def test_what_comes_late_now_and_then_does_not_move_the_offset():
    rng = np.random.default_rng(1)
    seen = watch(0.05, lambda: 0.01 + rng.exponential(0.1), lambda: 0.01 + rng.exponential(0.3))
    assert seen.offset == pytest.approx(0.05, abs=0.01)
    assert seen.finding == ""
    assert seen.delay > 0.3


@pytest.mark.parametrize(
    ("offset", "words"),
    [(0.42, "0.42 s ahead of the guard's"), (-0.15, "0.15 s behind the guard's")],
)
def test_a_skew_is_named(offset, words):
    assert words in watch(offset, lambda: 0.02, lambda: 0.02).finding


def test_a_clock_that_is_set_right_is_believed_at_once():
    seen = watch(3.0, lambda: 0.02, lambda: 0.02)
    seen.take(200.04, plan(200.02, 200.0))
    assert seen.offset == pytest.approx(0.0, abs=1e-9)
    assert seen.finding == ""


def test_a_slow_solver_is_no_skew():
    assert watch(0.0, lambda: 0.01, lambda: 0.01, solving=0.4).offset == pytest.approx(0.0)


def test_plans_that_do_not_tell_are_not_judged():
    seen = LinkWatch(LinkParameters(TOLERANCE))
    seen.take(100.0, plan(105.0, math.nan))
    assert math.isnan(seen.offset)
    assert seen.finding == ""


def skewed(offset):
    """Return a solver beside the guard whose plans carry the stamps of a skewed clock."""

    def solve(t, x):
        made = make_plan(x, t)
        return Plan(t + offset, made.dt, made.delay, made.states, made.inputs, state_t=t), Goal.HOLD

    return solve


def hover_with(offset, tolerance=TOLERANCE):
    params = dataclasses.replace(PARAMS, link=LinkParameters(tolerance))
    flight = Flight(params).hovering()
    flight.solver = skewed(offset)
    return flight


@pytest.mark.parametrize("offset", [0.15, -0.2, 0.8])
def test_the_guard_does_not_fly_on_a_skewed_clock_and_says_why(offset):
    flight = hover_with(offset)
    output = flight.run(1.5)
    assert output.mode is Mode.BRAKING
    assert f"the controller's clock is {abs(offset):.2f} s" in output.reason


def test_without_the_check_a_skew_would_be_flown():
    """Twin: a clock a little behind passes every other check."""
    flight = hover_with(-0.2, tolerance=10.0)
    assert flight.run(1.5).mode is Mode.HOVERING


def test_a_skew_that_is_put_right_ends_the_brake():
    flight = hover_with(0.5)
    assert flight.run(1.5).mode is Mode.BRAKING
    flight.solver = skewed(0.0)
    assert flight.run(3.0).mode is Mode.HOVERING
