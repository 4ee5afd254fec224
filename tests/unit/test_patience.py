# SPDX-License-Identifier: MIT
"""When a goal is late, and when it makes no headway."""

import numpy as np
import pytest

from nmpc_control.itinerary import Itinerary
from nmpc_control.params import load_parameters
from nmpc_control.state import Goal
from nmpc_control.trajectory import hold, line

START, END = np.array([5.0, 0.0, 2.0]), np.array([11.0, 0.0, 2.0])
REST = np.zeros(3)


@pytest.fixture
def itinerary() -> Itinerary:
    return Itinerary(load_parameters().flight)


def test_when_the_way_opens_late_there_is_all_the_time_to_arrive(itinerary):
    """Time of the reference that has passed before an obstacle around its end does not press."""
    timeout = itinerary.flight.arrival_timeout
    ways = (
        lambda: itinerary.go_to(0.0, END - [4.0, 0.0, 0.0], 0.0, END, 0.0),
        lambda: itinerary.begin(0.0, line(END - [4.0, 0.0, 0.0], END, speed=1.5)),
    )
    for set_out in ways:
        set_out()
        near = END - [1.5, 0.0, 0.0]
        for t in np.arange(0.0, 2.0, 0.1):
            itinerary.update(t, near - [0.8 * (2.0 - t), 0.0, 0.0], REST)
        for t in np.arange(2.0, 3.0 * timeout, 0.1):
            itinerary.update(t, near, REST, held_up=True)
        for t in 3.0 * timeout + np.arange(0.0, timeout - 0.2, 0.1):
            itinerary.update(t, near, REST)
            assert itinerary.is_pursuing
        for t in 4.0 * timeout + np.arange(0.0, timeout, 0.1):
            itinerary.update(t, near, REST)
        assert "not reached" in itinerary.outcome.message, "it is late in the end"


@pytest.mark.parametrize("held", [lambda t: False, lambda t: t % 8.0 < 1.0])
def test_without_headway_a_goal_ends_whoever_is_to_blame(itinerary, held):
    """As in wind that it cannot stand: nothing holds it up, the reference waits, and so on."""
    itinerary.begin(0.0, line(START, END, speed=1.5))
    patience = itinerary.flight.patience
    for t in np.arange(0.0, 4.0 * patience, 0.2):
        sway = [0.3 * np.sin(t), 0.0, 0.0]
        itinerary.update(t, START + sway, REST, held_up=held(t))
        if not itinerary.is_pursuing:
            break
    assert (1.0 if held(0.0) is False else 3.0) * patience < t < 3.0 * patience + 10.0
    assert not itinerary.outcome.arrived
    assert "no headway" in itinerary.outcome.message


def test_a_long_way_and_a_long_hover_are_headway(itinerary):
    patience = itinerary.flight.patience
    for long in (hold(START, 3.0 * patience), line(START, START + [0, 300.0, 0], speed=1.5)):
        itinerary.begin(0.0, long)
        for t in np.arange(0.0, long.duration - 1.0, 0.25):
            there = long.sample(np.array([t]))
            itinerary.update(t, there.position[0], there.velocity[0])
        assert itinerary.goal is Goal.TRAJECTORY
