# SPDX-License-Identifier: MIT
"""The guard's own watchdogs over a flight: switch, position, tilt, landing, its loop."""

import dataclasses

import numpy as np
import pytest
from flight_stub import GOOD, LIMITS, PARAMS, TICK, VEHICLE, Aircraft, Flight

from nmpc_control import dji
from nmpc_control.dji import RcMode
from nmpc_control.estimator import StateEstimate
from nmpc_control.guard import Guard
from nmpc_control.guard_data import GuardInputs
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode, Request
from nmpc_control.sent_inputs import SentInputs
from nmpc_control.situation import Situation
from nmpc_control.state import hover_state

SWITCH = dataclasses.replace(
    PARAMS, modes=dataclasses.replace(PARAMS.modes, needs_switch=True, battery_time=0.5)
)


# the switch


def test_a_switch_that_stands_in_f_from_the_beginning_starts_nothing():
    flight = Flight(params=SWITCH)
    flight.run(1.0)
    assert "take it away and back" in flight.tick(Request.START).answer[1]
    flight.run(0.2, rc=RcMode.P)
    flight.run(0.2)
    assert flight.tick(Request.START).answer == (True, "taking off")


@pytest.mark.parametrize("lost", [{"rc_age": 1.0}, {"rc": RcMode.OFF}])
def test_after_the_rc_was_lost_its_switch_must_be_seen_to_move_again(lost):
    flight = Flight(params=SWITCH, aircraft=Aircraft().airborne([0.0, 0.0, 5.0]))
    flight.run(0.5, rc=RcMode.P)
    flight.run(0.5)
    flight.tick(Request.START)
    assert flight.run(2.0).mode is Mode.HOVERING
    flight.run(0.5, **lost)
    flight.run(0.5)
    assert "take it away and back" in flight.tick(Request.START).answer[1]
    flight.run(0.1, rc=RcMode.A)
    assert flight.tick().mode is not Mode.MANUAL
    assert flight.tick(Request.START).answer == (True, "braking to hover")


def test_the_pilots_own_takeover_counts_as_having_been_away():
    flight = Flight(params=SWITCH, aircraft=Aircraft().airborne([0.0, 0.0, 5.0]))
    flight.run(0.5, rc=RcMode.P)
    flight.run(0.5)
    flight.tick(Request.START)
    flight.run(2.0)
    assert flight.tick(rc=RcMode.P).mode is Mode.MANUAL
    flight.run(0.5)
    assert flight.tick(Request.START).answer == (True, "braking to hover")


# preflight


def test_a_launch_that_must_not_start_says_why_and_never_does():
    flight = Flight()
    flight.guard = Guard(PARAMS, VEHICLE, LIMITS, "the thrust map is a simulator's")
    output = flight.run(1.0)
    assert (output.mode, output.reason) == (Mode.WAITING, "the thrust map is a simulator's")
    assert flight.tick(Request.START).answer == (
        False,
        "not started: the thrust map is a simulator's",
    )


def test_a_position_that_jumps_on_the_ground_stands_against_a_start_for_a_while():
    flight = Flight()
    flight.run(1.0)
    flight.aircraft.x[0] = 8.0
    assert "the position jumps" in flight.run(0.5).reason
    assert flight.run(8.0).mode is Mode.READY


# in flight


def test_a_jump_of_the_position_is_braked_and_flown_on_after():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.aircraft.x[:2] += 4.0
    output = flight.tick()
    assert (output.mode, output.code) == (Mode.BRAKING, "alarm")
    assert "from where the velocity leads" in output.reason
    assert flight.run(4.0).mode is Mode.HOVERING


def test_a_position_that_jumps_twice_is_held_against_it_until_a_new_start():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    for _ in range(2):
        flight.aircraft.x[:2] += 4.0
        assert flight.tick().mode is Mode.BRAKING
        output = flight.run(4.0)
    assert output.mode is Mode.BRAKING
    assert flight.run(30.0).mode is Mode.BRAKING
    flight.tick(Request.RELEASE)
    flight.run(0.5)
    flight.tick(Request.START)
    assert flight.run(4.0).mode is Mode.HOVERING


def test_a_tilt_beyond_what_dji_ever_flies_is_braked_and_then_given_up():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    seen = []
    for _ in range(40):
        flight.aircraft.x[3] = 1.0
        output = flight.tick()
        seen.append((output.mode, output.code))
    assert seen[0] == (Mode.BRAKING, "alarm")
    assert seen[-1] == (Mode.RELEASED, "tilt")


@pytest.mark.parametrize("lost", [{"gps_health": 2}, {"gps_age": 0.6}])
def test_a_position_of_gps_without_health_is_none(lost):
    """It is braked on velocity, by attitude; then it is the pilot's."""
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    output = flight.run(0.9, **lost)
    assert output.mode is Mode.HOVERING
    output = flight.run(0.2, **lost)
    assert (output.mode, output.code, output.rung) == (Mode.BRAKING, "gps_lost", Rung.BRAKE_BLIND)
    output = flight.run(5.0, **lost)
    assert (output.mode, output.code) == (Mode.RELEASED, "blind")


def test_gps_that_comes_back_is_flown_on_and_a_moment_without_is_nothing():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    for _ in range(5):
        assert flight.run(0.8, gps_health=3).mode is Mode.HOVERING
        flight.run(0.2)
    assert flight.run(2.0, gps_health=3).mode is Mode.BRAKING
    assert flight.run(2.5).mode is Mode.HOVERING


def test_twin_where_the_position_comes_from_elsewhere_gps_may_be_bad():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    assert flight.run(8.0, gps_health=0, needs_gps=False).mode is Mode.HOVERING


@pytest.mark.parametrize(("age", "is_judged"), [(0.02, True), (1.0, False)])
def test_a_velocity_that_is_not_heard_does_not_tell_that_a_brake_has_no_effect(age, is_judged):
    situation = Situation(PARAMS, VEHICLE, LIMITS, "")
    x = hover_state(np.zeros(3))
    x[6] = 4.0
    hold = (0.0, 0.0, 0.0, 0.0, float(dji.VELOCITY))
    for t in np.arange(0.0, 4.0, TICK):
        telemetry = dataclasses.replace(GOOD, velocity_age=age)
        inputs = GuardInputs(t, telemetry, StateEstimate(t, x, 0.02, age, 0.02))
        situation.follow(inputs, TICK, Mode.BRAKING, hold, SentInputs(VEHICLE))
    assert (situation.effect.total > 0.5) == is_judged


def test_landing_is_no_brake():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.aircraft.serve = lambda actions: None  # DJI's landing does not begin yet
    output = flight.tick(Request.LAND)
    assert (output.mode, output.rung, output.code) == (Mode.LANDING, Rung.LANDING, "asked")


def landing(**answered):
    """Return a flight that was asked to land, 3 s later; the status does not change."""
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.aircraft.serve = lambda actions: None
    flight.tick(Request.LAND)
    flight.tick(**answered)
    return flight


def test_a_landing_that_was_granted_is_not_held_against_on_an_old_status():
    flight = landing(landing_granted=True)
    assert flight.tick(status_age=0.4).axes is not None, "a status that is heard: it has not begun"
    output = flight.run(10.0, status_age=0.6)
    assert (output.mode, output.axes) == (Mode.LANDING, None)


def test_twin_without_an_answer_it_is_held_whatever_the_age_of_the_status():
    flight = landing()
    assert flight.run(10.0, status_age=0.6).axes[4] == dji.VELOCITY


def test_an_answer_to_an_earlier_call_to_land_counts_for_nothing():
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.aircraft.serve = lambda actions: None
    flight.tick(landing_granted=True)
    flight.tick(Request.LAND)
    assert flight.run(1.0, status_age=0.6).axes is not None
    flight.tick(landing_granted=True)
    flight.tick(failure="refused")
    flight.run(1.5)
    assert flight.tick(Request.LAND).mode is Mode.LANDING
    assert flight.run(1.0, status_age=0.6).axes is not None


def test_a_slow_loop_is_known():
    flight = Flight()
    flight.run(2.0)
    loop = flight.guard.situation.loop
    assert loop.rate == pytest.approx(1.0 / TICK)
    assert loop.late == 0.0


# durations on a steady clock


def test_a_step_of_the_stamping_clock_does_not_end_a_take_off():
    flight = Flight()
    tick = flight.guard.tick
    steady = [0.0]

    def with_steady(inputs):
        steady[0] += TICK
        return tick(dataclasses.replace(inputs, steady=steady[0]))

    flight.guard.tick = with_steady
    flight.run(1.0)
    flight.aircraft.serve = lambda actions: setattr(flight.aircraft, "authority", True)
    flight.tick(Request.START)
    flight.t += 1000.0
    assert flight.run(1.0).mode is Mode.TAKING_OFF
    assert flight.run(30.0).mode is Mode.FAULT


def test_home_is_where_automatic_flight_began():
    flight = Flight(aircraft=Aircraft().airborne([3.0, 4.0, 5.0])).hovering()
    assert np.allclose(flight.guard.situation.home[:2], [3.0, 4.0], atol=0.1)
