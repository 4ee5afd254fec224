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
UP = np.array([1.0, 0.0, 3.0])  # [m] mostly


def flown(vehicle="dji_hil", plant="eth", target=TARGET, seconds=16.0, **changes):
    """Return a flight to a point; one hovers at 38 % of thrust, the other at 30."""
    guard = dataclasses.replace(load_guard_parameters(profile=PROFILE), **changes)
    parameters = load_parameters(vehicle, profile=PROFILE)
    loop = ClosedLoop(load_preset(plant), World((), 0.5), parameters, guard)
    loop.aircraft.place([0.0, 0.0, HEIGHT])
    while not loop.controller.engaged:
        loop.inbox.request = Request.START
        loop.step()
        assert loop.t < 20.0, loop.log.outputs[-1][1].reason
    began = loop.t
    x = loop.controller.estimator.estimate(loop.t).vector
    loop.controller.itinerary.go_to(loop.t, x[:3], x[5], target, 0.5)
    while loop.t < began + seconds:
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
    assert highest(flown(vertical_command="thrust")) > 0.3


def test_the_height_settles_with_a_model_without_dead_time():
    loop = flown("eth", "dji_hil", UP, 8.0)
    heights = np.array([truth.position[2] for truth in loop.log.truths])
    assert heights.max() < UP[2] + 0.1
    assert np.ptp(heights[-100:]) < 0.05


def test_twin_commanding_the_velocity_of_now_it_swings():
    """DJI's velocity loop lags; what it is asked for must be what the plan has that much later."""
    loop = flown("eth", "dji_hil", UP, 8.0, vertical_lead=0.0)
    heights = np.array([truth.position[2] for truth in loop.log.truths])
    assert heights.max() > UP[2] + 0.5
