# SPDX-License-Identifier: MIT
"""Two aircraft that exchange predictions change places, and meet without them."""

import numpy as np
import pytest

from nmpc_control.mode_inputs import Request
from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import Sighting
from nmpc_control.params import load_parameters
from nmpc_control.scenario import load_scenario
from nmpc_control.state import POSITION, VELOCITY
from nmpc_control.traffic import Course, Traffic, TrafficParameters
from uav_sim.closed_loop.loop import OBSTACLE_PERIOD
from uav_sim.closed_loop.simulate import new_loop
from uav_sim.world import World

PARAMETERS = load_parameters("dji_hil", "outdoor")
HULL = PARAMETERS.vehicle.radius
LATER = (0.0, 2.0)  # [s] after the first the second sets out
ENDS = (np.array([-5.0, 0.0, 4.0]), np.array([5.0, 0.0, 4.0]))


class Aircraft:
    """One of two, with what it is told of the other."""

    def __init__(self, start, target, **changes):
        self.loop = new_loop(load_scenario("hover"), PARAMETERS, "dji_hil", World((), HULL))
        self.loop.aircraft.place(start)
        self.target = target
        known = TrafficParameters(radius=HULL, growth=0.1, **changes)
        self.traffic = Traffic(known)
        self.memory = ObstacleMemory(load_obstacle_parameters())

    @property
    def position(self):
        return np.array(self.loop.aircraft.truth.position)

    def set_out(self):
        x = self.loop.controller.estimator.estimate(self.loop.t).vector
        self.loop.controller.itinerary.go_to(self.loop.t, x[:3], x[5], self.target, x[5])

    def hear(self, other):
        """Take the other's plan as ``nmpc_traffic`` and a node's memory would."""
        plan, t = other.loop.log.steps[-1].plan, self.loop.t
        states = plan.states
        course = Course(
            plan.t + plan.delay,
            states[0, POSITION],
            states[0, VELOCITY],
            states[1:, POSITION],
            plan.dt,
        )
        self.traffic.predict("other", course)
        (o,) = self.traffic.report()
        numbers = [tuple(map(float, a)) for a in (o.size, o.position, o.velocity, o.path.ravel())]
        sighting = Sighting(o.id, o.shape, *numbers, o.path_dt, o.growth, o.stamp)
        self.memory.hear(t, "/nmpc_traffic", [(sighting, "")])
        inbox = self.loop.inbox
        self.loop.controller.obstacles = inbox.obstacles = self.memory.obstacles(t)
        inbox.obstacles_stale = self.memory.stale(t)


def change_places(exchange, later, seconds=9.0, **changes):
    """Return the least distance [m] of the centres and the last positions."""
    two = Aircraft(*ENDS, **changes), Aircraft(*ENDS[::-1], **changes)
    hovering = [False, False]
    steps_a_look = round(OBSTACLE_PERIOD / two[0].loop.aircraft.preset.step)
    least, count, since, second_is_out = np.inf, 0, None, False
    while since is None or two[0].loop.t < since + seconds:
        for i, one in enumerate(two):
            if one.loop.guard.mode.name != "HOVERING" and not hovering[i]:
                one.loop.inbox.request = Request.START
            hovering[i] |= one.loop.controller.engaged
            one.loop.step()
        count += 1
        if all(hovering) and since is None:
            since = two[0].loop.t
            two[0].set_out()
        if since is not None and not second_is_out and two[0].loop.t > since + later:
            second_is_out = True
            two[1].set_out()
        if exchange and count % steps_a_look == 0 and all(one.loop.log.steps for one in two):
            two[0].hear(two[1])
            two[1].hear(two[0])
        least = min(least, float(np.linalg.norm(two[0].position - two[1].position)))
        assert two[0].loop.t < 60.0
    return least, two


@pytest.mark.parametrize("later", LATER)
def test_two_that_know_of_each_other_pass(later):
    least, two = change_places(True, later)
    assert least > 2 * HULL + 0.25
    for one in two:
        assert np.linalg.norm(one.position - one.target) < 0.5
        assert not one.memory.rejected
        assert "BRAKING" not in {o.mode.name for t, o in one.loop.log.outputs if t > 2.0}


@pytest.mark.parametrize("later", LATER)
def test_twin_two_that_do_not_meet(later):
    least, _ = change_places(False, later, seconds=5.5)
    assert least < 2 * HULL


def held_up(later, **changes):
    _, two = change_places(True, later, **changes)
    return any(np.linalg.norm(one.position - one.target) > 2.0 for one in two)


@pytest.mark.long
def test_that_answers_settle_keeps_two_from_holding_each_other_up():
    """Only who sets out at nearly the same time is in danger of it, and not each time."""
    together = np.arange(0.0, 0.12, 0.02)
    assert not any(held_up(later) for later in together)
    assert any(held_up(later, settling=0.0) for later in together)
