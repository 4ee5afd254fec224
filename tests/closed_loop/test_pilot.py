# SPDX-License-Identifier: MIT
"""The pilot takes over on a trajectory, gives back, and it is resumed; control lost silently."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.mode_inputs import PLANNED, Mode, Request
from nmpc_control.params import load_parameters
from nmpc_control.scenario import load_scenario
from nmpc_control.state import Goal
from uav_sim.closed_loop.simulate import new_loop
from uav_sim.disturbance import Disturbance, load_disturbance

PERIOD = 0.02  # [s]
TRANSPORT = 0.02  # [s] of the RC's telemetry, and its own period


class Flight:
    """A closed loop under way on a trajectory, and a pilot beside it."""

    def __init__(self, plant, level=None, scenario="circle_xy", seconds=4.0):
        self.scenario = load_scenario(scenario)
        disturbance = None if level is None else Disturbance(load_disturbance(level), 1)
        self.loop = new_loop(self.scenario, load_parameters(plant), plant, None, disturbance)
        self.loop.aircraft.place([*self.scenario.initial_position[:2], 5.0])
        self.itinerary = self.loop.controller.itinerary
        self.start()
        self.itinerary.begin(self.loop.t, self.scenario.trajectory)
        self.run(seconds)

    @property
    def t(self):
        return self.loop.t

    @property
    def speed(self):
        return float(np.linalg.norm(self.loop.aircraft.truth.velocity))

    @property
    def last(self):
        return self.loop.log.outputs[-1][1]

    def run(self, seconds):
        self.until(lambda end=self.t + seconds: self.t >= end, seconds + 1.0)

    def until(self, condition, limit=30.0):
        end = self.t + limit
        while not condition():
            assert self.t < end, (self.loop.guard.mode, self.last)
            self.loop.step()

    def start(self):
        def started():
            self.loop.inbox.request = Request.START
            return self.loop.controller.engaged

        self.until(started)

    def since(self, t):
        return [(when, o) for when, o in self.loop.log.outputs if when > t]

    def modes(self, since):
        names = [o.mode for _, o in self.since(since)]
        return [m for k, m in enumerate(names) if k == 0 or m is not names[k - 1]]


@pytest.fixture(scope="module", params=[("dji_hil", "indoor"), ("eth", None)], ids=["own", "hold"])
def taken(request):
    """A flight that the pilot has interrupted, flown on fast, and given back; with the times."""
    flight = Flight(*request.param)
    flight.left = flight.itinerary.reference_time(flight.t)
    rc = flight.loop.aircraft.rc
    flight.took = flight.t
    rc.mode, rc.roll = "P", 0.5
    flight.run(2.0)
    flight.place = flight.loop.aircraft.truth.position
    flight.manual = flight.last
    rc.mode, rc.roll = "F", 0.0
    flight.given = flight.t
    flight.run(0.5)
    flight.between = flight.last
    flight.asked, flight.asked_speed = flight.t, flight.speed
    flight.start()
    flight.hovering, flight.hovering_speed = flight.t, flight.speed
    flight.run(0.5)
    flight.waiting_goal = flight.itinerary.goal
    flight.resumed = flight.t
    flight.answer = flight.loop.controller.take_up(flight.t)
    flight.until(lambda: flight.itinerary.goal is Goal.TRAJECTORY)
    flight.goes_on = flight.itinerary.reference_time(flight.t)
    flight.run(3.0)
    return flight


def test_leaving_f_silences_the_stream_within_a_period(taken):
    sent = [t for t, o in taken.since(taken.took) if o.axes is not None and t < taken.given]
    assert max(sent, default=taken.took) - taken.took <= PERIOD + TRANSPORT
    assert taken.manual.mode is Mode.MANUAL
    assert taken.manual.code == "pilot"


def test_f_alone_brings_nothing_back(taken):
    assert taken.between.mode in (Mode.WAITING, Mode.READY)
    silent = [o.axes for t, o in taken.since(taken.given) if t < taken.asked]
    assert set(silent) == {None}


def test_a_start_in_motion_brakes_to_rest_first(taken):
    assert taken.asked_speed > 2.0
    assert taken.modes(taken.asked)[:3] == [Mode.BRAKING, Mode.HOVERING, Mode.FLYING]
    assert taken.hovering_speed < 0.6


def test_the_trajectory_waits_until_it_is_asked_for_and_goes_on_where_it_was_left(taken):
    assert taken.waiting_goal is Goal.HOLD
    assert taken.answer == (True, "flying to where it was left")
    assert taken.goes_on == pytest.approx(taken.left, abs=0.1)
    clock = taken.itinerary.reference_time(taken.t)
    assert clock == pytest.approx(taken.goes_on + 3.0, abs=0.3)
    assert taken.loop.log.steps[-1].deviation < 0.6


def test_neither_thrust_nor_attitude_jump_at_the_return(taken):
    """From the state to the first setpoint, and over every change of mode until it flies on."""
    log = taken.since(taken.asked)
    truths = {round(x.t, 3): x for x in taken.loop.log.truths}
    first = next((t, o) for t, o in log if o.applied is not None)
    before = truths[min(truths, key=lambda t: abs(t - first[0]))]
    if taken.loop.sources[0].active != "gps":
        tilt = np.array(first[1].applied[1:3]) - before.rpy[:2]
        assert np.abs(tilt).max() < 0.1
        assert abs(first[1].applied[0] - 9.81) < 1.0
    jumps = [
        np.abs(np.subtract(b.applied, a.applied))
        for (_, a), (t, b) in zip(log, log[1:])
        if a.mode is not b.mode and a.applied and b.applied and t < taken.resumed + 0.2
    ]
    assert jumps
    assert np.max(jumps, axis=0)[0] < 0.6  # [m/s^2]
    assert np.max(jumps, axis=0)[1:3].max() < 0.2  # [rad]


def test_twin_without_braking_to_rest_thrust_jumps():
    """What the pilot gives over fast, and is flown on plans after the least time of braking."""
    flight = Flight("dji_hil", "indoor")
    params = flight.loop.guard.params
    modes = dataclasses.replace(params.modes, return_speed=100.0)
    flight.loop.guard.params = flight.loop.guard.situation.params = dataclasses.replace(
        params, modes=modes
    )
    flight.loop.aircraft.rc.mode, flight.loop.aircraft.rc.roll = "P", 0.5
    flight.run(2.0)
    flight.loop.aircraft.rc.mode, flight.loop.aircraft.rc.roll = "F", 0.0
    flight.run(0.5)
    asked = flight.t
    flight.start()
    assert flight.speed > 1.0
    log = [o for _, o in flight.since(asked) if o.applied]
    change = next((a, b) for a, b in zip(log, log[1:]) if b.mode is Mode.HOVERING is not a.mode)
    assert abs(change[1].applied[0] - change[0].applied[0]) > 0.6  # [m/s^2]


def test_a_trajectory_is_forgotten_in_time():
    flight = Flight("eth", seconds=1.0)
    flight.itinerary.flight = dataclasses.replace(flight.itinerary.flight, memory=1.0)
    flight.loop.aircraft.rc.mode = "P"
    flight.run(0.5)
    assert flight.itinerary.waits
    flight.run(1.0)
    assert not flight.itinerary.waits
    assert "not taken up again within 1 s" in flight.itinerary.outcome.message
    assert flight.loop.controller.take_up(flight.t) == (False, "nothing waits to be resumed")


@pytest.mark.parametrize("fault", ["authority_lost", "setpoints_ignored"])
def test_control_lost_silently_is_braked_and_then_given_back(fault):
    """dji_sdk goes on to say that authority is held; only the attitude tells."""
    flight = Flight("dji_hil", scenario="hexagon", seconds=4.0)
    flight.loop.aircraft.faults.apply(fault)
    lost = flight.t
    flight.until(lambda: flight.last.mode is Mode.RELEASED, 15.0)
    assert flight.last.code == "authority_lost"
    modes = flight.modes(lost)
    assert modes[:2] == [Mode.FLYING, Mode.BRAKING]
    first = next(t for t, o in flight.since(lost) if o.code == "no_effect")
    assert first - lost < 2.5
    warned = next(t for t, o in flight.since(lost) if "does not follow" in o.reason)
    assert warned < first
    assert flight.t - lost < 8.0


def test_in_hover_nothing_is_judged():
    flight = Flight("dji_hil", scenario="hover", seconds=2.0)
    flight.loop.aircraft.faults.apply("authority_lost")
    flight.run(5.0)
    assert flight.last.mode in PLANNED


@pytest.mark.parametrize(("plant", "vehicle"), [("dji_hil", "eth"), ("eth", "dji_hil")])
def test_twin_a_model_far_off_is_not_taken_for_lost_control(plant, vehicle):
    """Attitude lags of 0.10 and 0.26 s are taken for one another, on a trajectory with corners."""
    scenario = load_scenario("hexagon")
    loop = new_loop(scenario, load_parameters(vehicle), plant)
    loop.aircraft.place(scenario.initial_position, yaw=scenario.start_yaw)
    while not loop.controller.engaged:
        loop.inbox.request = Request.START
        loop.step()
    loop.controller.itinerary.begin(loop.t, scenario.trajectory)
    longest, end = 0.0, loop.t + 12.0
    while loop.t < end:
        loop.step()
        longest = max(longest, loop.guard.situation.effect.total)
    assert longest < 0.3
