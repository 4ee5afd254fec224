"""Sequence of references: hold, approach, settle, trajectory, hold."""

import numpy as np
import pytest

from nmpc_control.itinerary import Itinerary
from nmpc_control.params import load_parameters
from nmpc_control.state import POSITION, VELOCITY, YAW, Goal
from nmpc_control.trajectory import line

START, END = np.array([5.0, 0.0, 2.0]), np.array([11.0, 0.0, 2.0])
REST = np.zeros(3)


@pytest.fixture
def itinerary() -> Itinerary:
    i = Itinerary(load_parameters().flight)
    i.hold(np.zeros(3), 0.3)
    return i


def follow(itinerary: Itinerary, t: float, until: float, dt: float = 0.05) -> float:
    """Move a perfect follower along the reference; returns the time reached."""
    while t < until:
        x = itinerary.reference(np.array([t]))[0]
        itinerary.update(t, x[POSITION], x[VELOCITY])
        t += dt
    return t


def test_hold_is_the_same_at_all_times(itinerary):
    x = itinerary.reference(np.array([0.0, 5.0, 100.0]))
    assert np.all(x[:, POSITION] == 0.0)
    assert np.all(x[:, YAW] == 0.3)
    assert np.isnan(itinerary.reference_time(3.0))


def test_trajectory_begins_after_the_approach_has_settled(itinerary):
    itinerary.fly(0.0, np.zeros(3), 0.3, line(START, END, speed=1.5))
    leg = 5.0 / itinerary.flight.approach_speed
    follow(itinerary, 0.0, leg)
    assert itinerary.goal is Goal.APPROACH
    follow(itinerary, leg, leg + 20.0)
    assert (
        itinerary.clock_start is None or itinerary.clock_start >= leg + itinerary.flight.settle_time
    )


def test_the_reference_does_not_look_into_the_trajectory_before_its_clock_runs(itinerary):
    itinerary.fly(0.0, np.zeros(3), 0.0, line(START, END, speed=1.5))
    far = itinerary.reference(np.array([1000.0]))[0]
    assert far[POSITION] == pytest.approx(START)


def test_whole_flight_ends_arrived_and_holds_the_end(itinerary):
    itinerary.fly(0.0, np.zeros(3), 0.0, line(START, END, speed=1.5))
    t = follow(itinerary, 0.0, 30.0)
    assert itinerary.goal is Goal.HOLD
    assert itinerary.outcome.arrived
    assert itinerary.reference(np.array([t]))[0, POSITION] == pytest.approx(END)


def test_clock_of_the_trajectory_runs_while_it_is_followed(itinerary):
    itinerary.begin(10.0, line(START, END, speed=1.5))
    follow(itinerary, 10.0, 12.01)
    assert itinerary.reference_time(12.0) == pytest.approx(2.0)
    assert itinerary.reference(np.array([12.0]))[0, POSITION] == pytest.approx([8.0, 0.0, 2.0])


def test_the_reference_waits_for_an_aircraft_that_does_not_come(itinerary):
    itinerary.begin(10.0, line(START, END, speed=1.5))
    for t in np.arange(10.0, 30.0, 0.05):
        itinerary.update(t, START, REST)
    assert itinerary.goal is Goal.TRAJECTORY
    waiting = itinerary.reference(np.array([30.0]))[0, POSITION]
    assert waiting[0] - START[0] < 1.5 * (2 * itinerary.flight.wait_lag + 0.2)


def test_a_suspended_goal_goes_on_where_it_was(itinerary):
    itinerary.begin(0.0, line(START, END, speed=1.5))
    follow(itinerary, 0.0, 2.01)
    itinerary.suspend(np.array([8.2, 0.4, 2.0]), 0.5)
    assert itinerary.goal is Goal.HOLD
    assert itinerary.outcome is None
    assert itinerary.is_pursuing
    for t in np.arange(2.0, 40.0, 0.5):
        itinerary.update(t, np.array([8.2, 0.4, 2.0]), REST)
    held = itinerary.reference(np.array([40.0, 45.0]))
    assert np.all(held[:, POSITION] == [8.2, 0.4, 2.0])
    assert np.all(held[:, YAW] == 0.5)
    itinerary.resume(40.0)
    assert itinerary.goal is Goal.TRAJECTORY
    assert itinerary.reference(np.array([40.0]))[0, POSITION] == pytest.approx([8, 0, 2], abs=0.1)
    follow(itinerary, 40.0, 50.0)
    assert itinerary.outcome.arrived


def test_a_goal_suspended_again_and_again_is_given_up(itinerary):
    """As where the guard brakes for what the solver does not see."""
    itinerary.begin(0.0, line(START, END, speed=1.5))
    patience, given_up = itinerary.flight.patience, None
    for t in np.arange(0.0, patience + 20.0, 0.1):
        if t % 1.5 < 1.0:
            itinerary.suspend(START, 0.0)
        else:
            itinerary.resume(t)
        itinerary.update(t, START, REST)
        if itinerary.outcome is not None:
            given_up = t
            break
    assert given_up == pytest.approx(patience, abs=2.0)
    assert "held up" in itinerary.outcome.message
    itinerary.resume(given_up + 1.0)
    assert itinerary.goal is Goal.HOLD


def test_a_new_goal_has_all_of_the_patience(itinerary):
    patience = itinerary.flight.patience
    itinerary.go_to(0.0, np.zeros(3), 0.0, START, 0.0)
    itinerary.update(0.0, np.zeros(3), REST, held_up=True)
    itinerary.update(0.9 * patience, np.zeros(3), REST, held_up=True)
    itinerary.go_to(0.9 * patience, np.zeros(3), 0.0, END, 0.0)
    itinerary.update(1.8 * patience, np.zeros(3), REST, held_up=True)
    assert itinerary.goal is Goal.APPROACH


def test_resume_without_a_suspended_goal_changes_nothing(itinerary):
    itinerary.resume(3.0)
    assert itinerary.goal is Goal.HOLD
    itinerary.begin(0.0, line(START, END, speed=1.5))
    itinerary.suspend(START, 0.0)
    itinerary.hold(END, 0.0, "told to hold")
    assert not itinerary.outcome.arrived, "holding ends the goal, suspended or not"
    assert not itinerary.is_pursuing
    itinerary.resume(5.0)
    assert itinerary.goal is Goal.HOLD
    assert np.all(itinerary.reference(np.array([6.0]))[0, POSITION] == END)


def test_held_up_by_obstacles_time_does_not_press_but_patience_ends(itinerary):
    patience = itinerary.flight.patience
    itinerary.go_to(0.0, np.zeros(3), 0.0, START, 0.0)
    leg = 5.0 / itinerary.flight.approach_speed
    for t in np.arange(0.0, patience - 0.1, 0.1):
        itinerary.update(t, np.zeros(3), REST, held_up=True)
    assert patience > leg + itinerary.flight.arrival_timeout + 10.0
    assert itinerary.goal is Goal.APPROACH
    for t in np.arange(patience, patience + 4.0, 0.1):
        itinerary.update(t, np.zeros(3), REST, held_up=False)
    itinerary.update(patience + 4.0, np.zeros(3), REST, held_up=True)
    assert itinerary.goal is Goal.APPROACH, "once it went on, patience begins anew"
    itinerary.update(2.0 * patience + 3.9, np.zeros(3), REST, held_up=True)
    assert itinerary.goal is Goal.APPROACH
    itinerary.update(2.0 * patience + 4.1, np.zeros(3), REST, held_up=True)
    assert itinerary.goal is Goal.HOLD
    assert "held up" in itinerary.outcome.message
    held = itinerary.reference(np.array([500.0]))[0, POSITION]
    assert np.all(held == 0.0), "what was not reached is not chased"


def test_not_reaching_the_end_is_said(itinerary):
    itinerary.begin(0.0, line(START, END, speed=1.5))
    t = 4.0 + itinerary.flight.arrival_timeout
    itinerary.update(t, START, REST)
    assert itinerary.goal is Goal.TRAJECTORY
    itinerary.update(t + 0.1, START, REST)
    assert itinerary.goal is Goal.HOLD
    assert not itinerary.outcome.arrived
    assert "not reached" in itinerary.outcome.message
    held = itinerary.reference(np.array([t + 1.0]))[0, POSITION]
    assert held == pytest.approx(START), "what was not reached is not chased"


def test_passing_the_end_at_speed_is_no_arrival(itinerary):
    itinerary.begin(0.0, line(START, END, speed=1.5))
    itinerary.update(4.5, END, np.array([0.5, 0.0, 0.0]))
    assert itinerary.goal is Goal.TRAJECTORY
    itinerary.update(4.6, END, np.array([0.1, 0.0, 0.0]))
    assert itinerary.outcome.arrived


def test_go_to_arrives_and_hold_interrupts(itinerary):
    itinerary.go_to(0.0, np.zeros(3), 0.0, START, 1.0)
    follow(itinerary, 0.0, 15.0)
    assert itinerary.outcome.arrived
    assert itinerary.reference(np.array([20.0]))[0, YAW] == pytest.approx(1.0)
    assert not itinerary.is_going_to(START)
    itinerary.go_to(20.0, START, 1.0, END, 1.0)
    assert itinerary.is_going_to(END)
    itinerary.hold(START, 1.0)
    assert not itinerary.outcome.arrived
    assert itinerary.goal is Goal.HOLD
