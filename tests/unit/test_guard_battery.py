# SPDX-License-Identifier: MIT
"""What a battery that is low, or not heard of any more, makes the guard do."""

import dataclasses
import math

import pytest
from flight_stub import PARAMS, TICK, Aircraft, Flight, make_plan

from nmpc_control.guard_data import Action
from nmpc_control.mode_inputs import Mode
from nmpc_control.state import Goal


def with_battery(action):
    modes = dataclasses.replace(PARAMS.modes, battery_action=action, battery_time=0.5)
    return dataclasses.replace(PARAMS, modes=modes)


def cruise(t, x):
    return make_plan(x, t), Goal.TRAJECTORY


def hover(t, x):
    return make_plan(x, t), Goal.HOLD


def actions_of(flight):
    return [action for _, _, output in flight.log for action in output.actions]


def low(flight, percent=0.18):
    flight.change = {"battery": percent}


def test_a_low_battery_sends_it_home_once_and_lands_there():
    flight = Flight(params=with_battery("return")).hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0])
    flight.run(4.0)
    flight.aircraft.x[:2] = [30.0, -4.0]
    flight.run(5.0)
    flight.solver = cruise
    low(flight)
    output = flight.run(1.0)
    assert output.mode is Mode.FLYING
    assert "the battery is at 18%: return" in output.reason
    returns = [o for _, _, o in flight.log if Action.RETURN in o.actions]
    assert len(returns) == 1
    assert returns[0].target == pytest.approx((0.0, 0.0, 5.0), abs=0.1)
    flight.solver = hover  # it is there
    flight.guard.situation.home = flight.aircraft.x[:3].copy()
    flight.run(0.5)
    assert Action.LAND in actions_of(flight)
    assert flight.log[-1][2].mode in (Mode.WAITING, Mode.READY)


def test_a_return_that_takes_too_long_lands_where_it_is():
    params = with_battery("return")
    params = dataclasses.replace(
        params, modes=dataclasses.replace(params.modes, return_timeout=1.0)
    )
    flight = Flight(params=params, aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.solver = cruise
    low(flight)
    flight.run(1.2)
    assert Action.LAND not in actions_of(flight)
    flight.run(0.5)
    assert Action.LAND in actions_of(flight)


@pytest.mark.parametrize(
    ("action", "percent", "expected"),
    [
        ("land", 0.18, Action.LAND),
        ("hover", 0.18, Action.HOLD),
        ("hover", 0.10, Action.LAND),
        ("return", 0.10, Action.LAND),
    ],
)
def test_what_a_low_battery_does(action, percent, expected):
    flight = Flight(params=with_battery(action), aircraft=Aircraft().airborne([0.0, 0.0, 5.0]))
    flight.hovering()
    flight.solver = cruise
    low(flight, percent)
    flight.run(0.6)
    assert expected in actions_of(flight)
    assert (Action.LAND in actions_of(flight)) == (expected is Action.LAND)


def test_twin_a_battery_that_sags_for_a_moment_does_nothing():
    flight = Flight(params=with_battery("land"), aircraft=Aircraft().airborne([0.0, 0.0, 5.0]))
    flight.hovering()
    for _ in range(5):
        flight.run(0.4, battery=0.1)
        flight.run(0.1)
    assert flight.log[-1][2].mode is Mode.HOVERING
    flight.run(1.0, battery=math.nan)
    assert flight.log[-1][2].mode is Mode.HOVERING
    assert Action.LAND not in actions_of(flight)


SILENCE = 1.0  # [s] instead of half a minute


def silent_flight(action, silence=SILENCE):
    """Return a flight of which the battery has not been heard for 0.9 s, one 0.5 s old counts."""
    params = with_battery(action)
    modes = dataclasses.replace(params.modes, battery_timeout=0.5, battery_silent_time=silence)
    params = dataclasses.replace(params, modes=modes)
    flight = Flight(params=params, aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.solver = cruise
    flight.run(0.4)
    go_silent(flight, 0.9)
    return flight


def go_silent(flight, seconds, age=0.0):
    output = None
    for _ in range(round(seconds / TICK)):
        age += TICK
        output = flight.tick(battery_age=age)
    return output


@pytest.mark.parametrize(
    ("action", "expected"),
    [("land", Action.LAND), ("hover", Action.HOLD), ("return", Action.RETURN)],
)
def test_a_battery_that_is_not_heard_of_for_long_counts_as_low(action, expected):
    flight = silent_flight(action)
    assert (
        flight.log[-1][2].reason
        == f"nothing has been heard of the battery for 1 s: {action} at 1 s"
    )
    assert expected not in actions_of(flight)
    go_silent(flight, 0.3, age=0.9)
    assert expected in actions_of(flight)
    if action == "land":
        assert flight.guard.situation.home is not None
        landed = [o for _, _, o in flight.log if Action.LAND in o.actions]
        assert [(o.mode, o.code) for o in landed] == [(Mode.LANDING, "battery_silent")]
    else:
        assert actions_of(flight).count(expected) == 1


@pytest.mark.parametrize("action", ["land", "hover", "return"])
def test_twin_without_a_limit_a_silent_battery_does_nothing(action):
    flight = silent_flight(action, silence=math.inf)
    before = actions_of(flight)
    assert go_silent(flight, 5.0, age=0.9).mode is Mode.FLYING
    assert actions_of(flight) == before


def test_a_battery_that_was_never_heard_of_since_the_clock_was_set_is_waited_for():
    flight = silent_flight("land")
    flight.tick()
    assert flight.run(0.9, battery_age=math.inf).mode is Mode.FLYING
    flight.run(0.3, battery_age=math.inf)
    assert Action.LAND in actions_of(flight)


def test_a_battery_that_is_heard_of_again_is_waited_for_anew():
    flight = silent_flight("land")
    flight.tick()
    go_silent(flight, 0.9)
    assert Action.LAND not in actions_of(flight)
