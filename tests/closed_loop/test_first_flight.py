# SPDX-License-Identifier: MIT
"""The first flight's profile, on an aircraft whose thrust map is not known."""

import dataclasses

import numpy as np
import pytest

from nmpc_control import dji
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import STREAMING, Request
from nmpc_control.params import load_parameters
from uav_sim.closed_loop.loop import ClosedLoop
from uav_sim.preset import load_preset
from uav_sim.world import World

PROFILE = "first_flight"
HEIGHT = 2.0  # [m]
TARGET = np.array([4.0, -3.0, 3.0])  # [m]


def flown(vertical_command=None):
    """Return a flight to a point; the model hovers at 38 %, the aircraft at 30."""
    guard = load_guard_parameters(profile=PROFILE)
    if vertical_command:
        guard = dataclasses.replace(guard, vertical_command=vertical_command)
    parameters = load_parameters("dji_hil", profile=PROFILE)
    loop = ClosedLoop(load_preset("eth"), World((), 0.5), parameters, guard)
    loop.aircraft.place([0.0, 0.0, HEIGHT])
    while not loop.controller.engaged:
        loop.inbox.request = Request.START
        loop.step()
        assert loop.t < 20.0, loop.log.outputs[-1][1].reason
    began = loop.t
    x = loop.controller.estimator.estimate(loop.t).vector
    loop.controller.itinerary.go_to(loop.t, x[:3], x[5], TARGET, 0.5)
    while loop.t < began + 16.0:
        loop.step()
    loop.began = began
    return loop


@pytest.fixture(scope="module")
def flight():
    return flown()


def test_it_arrives_gently(flight):
    assert flight.controller.itinerary.outcome.arrived, flight.controller.itinerary.outcome
    x = flight.controller.estimator.estimate(flight.t).vector
    assert np.linalg.norm(x[:3] - TARGET) < 0.5
    speeds = [np.linalg.norm(truth.velocity) for truth in flight.log.truths]
    assert max(speeds) < 1.5
    assert flight.guard.mode in STREAMING
    assert not flight.aircraft.collisions


def test_no_thrust_leaves_and_little_of_anything_else(flight):
    limits = load_guard_parameters(profile=PROFILE).setpoint_limits
    sent = [o.axes for _, o in flight.log.outputs if o.axes is not None]
    assert sent
    assert {axes[4] for axes in sent} <= {dji.ATTITUDE_VERTICAL_VELOCITY, dji.VELOCITY}
    by_attitude = [axes for axes in sent if axes[4] == dji.ATTITUDE_VERTICAL_VELOCITY]
    assert max(np.hypot(*axes[:2]) for axes in by_attitude) <= limits.tilt * 1.001
    assert max(abs(axes[2]) for axes in sent) <= limits.vertical_velocity
    assert max(abs(axes[3]) for axes in sent) <= limits.yaw_rate


def test_twin_by_thrust_the_same_wrong_map_throws_it_up(flight):
    def highest(loop):
        early = [truth.position[2] for truth in loop.log.truths if truth.t < loop.began + 2.0]
        return max(early) - HEIGHT

    assert highest(flight) < 0.2
    assert highest(flown("thrust")) > 0.3
