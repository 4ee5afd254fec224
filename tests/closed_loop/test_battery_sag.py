# SPDX-License-Identifier: MIT
"""A battery that sags: the height after a hand-over from the pilot, and over a whole flight."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import PLANNED, Request
from nmpc_control.params import load_parameters
from uav_sim.closed_loop.loop import ClosedLoop
from uav_sim.disturbance import Disturbance, Spread, load_disturbance
from uav_sim.preset import load_preset
from uav_sim.world import World

HEIGHT = 5.0  # [m]
LOW = 30.0  # [percent]


def flown(knows, plant="dji_hil", percent=LOW, drain=1.0, seconds=8.0):
    """Return a hover after a start in the air, indoors: position by Vicon, no DJI hold before it.

    ``knows``: the controller's vehicle has the battery's curve. ``drain``: times faster than real.
    """
    preset = load_preset(plant)
    battery = dataclasses.replace(preset.battery, flight_time=preset.battery.flight_time / drain)
    indoor = load_disturbance("indoor")
    parameters, guard = load_parameters(plant), load_guard_parameters()
    if not knows:
        vehicle = dataclasses.replace(parameters.vehicle, battery=None)
        parameters = dataclasses.replace(parameters, vehicle=vehicle)
    loop = ClosedLoop(
        dataclasses.replace(preset, battery=battery),
        World((), 0.5),
        parameters,
        guard,
        Disturbance(dataclasses.replace(indoor, spread=Spread(0.0, 0.0)), 1),
    )
    loop.aircraft.place([0.0, 0.0, HEIGHT])
    loop.aircraft.battery = percent
    while not loop.controller.braking and not loop.controller.engaged:
        loop.inbox.request = Request.START
        loop.step()
        assert loop.t < 20.0, loop.log.outputs[-1][1].reason
    loop.began = loop.t
    loop.gain = loop.guard.battery_gain  # as the start found it
    while loop.t < loop.began + seconds:
        loop.step()
    return loop


def errors(loop):
    """Return times (n,) [s] since the hand-over and height errors (n,) [m]."""
    after = [truth for truth in loop.log.truths if truth.t >= loop.began]
    height = np.array([truth.position[2] for truth in after])
    return np.array([truth.t for truth in after]) - loop.began, height - height[0]


@pytest.fixture(scope="module")
def handed_over():
    return {knows: flown(knows) for knows in (True, False)}


def test_with_the_curve_the_height_is_kept_at_a_hand_over(handed_over):
    _, error = errors(handed_over[True])
    assert np.abs(error).max() < 0.2
    assert handed_over[True].guard.mode in PLANNED
    curve = load_parameters("dji_hil").vehicle.battery
    assert handed_over[True].gain == pytest.approx(curve.at(LOW / 100.0), abs=0.005)
    assert handed_over[False].gain == 1.0


def test_twin_without_it_the_aircraft_drops_first(handed_over):
    (_, known), (_, unknown) = (errors(handed_over[k]) for k in (True, False))
    assert unknown.min() < -0.4
    assert np.abs(unknown).max() > 2.5 * np.abs(known).max()


def test_the_curve_and_what_is_learnt_do_not_count_the_same_twice(handed_over):
    learnt = {k: loop.controller.disturbance[2] for k, loop in handed_over.items()}
    assert abs(learnt[True]) < 0.25
    assert -1.3 < learnt[False] < -0.5  # 9 % of the weight, where no curve has it
    for loop in handed_over.values():
        assert np.ptp(errors(loop)[1][-50:]) < 0.05  # in the end both hold


def test_a_battery_that_empties_in_flight_moves_the_height_little():
    loop = flown(True, percent=75.0, drain=30.0, seconds=16.0)
    assert loop.aircraft.battery < 35.0
    assert loop.guard.mode in PLANNED
    times, error = errors(loop)
    assert np.abs(error[times > 2.0]).max() < 0.12
