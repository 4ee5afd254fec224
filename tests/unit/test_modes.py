# SPDX-License-Identifier: MIT
"""Every transition of the mode table, and what must hold whatever the inputs are."""

import dataclasses
import itertools
import math

import pytest
from flight_stub import GOOD, PARAMS

from nmpc_control.config import config_directory
from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.mode_inputs import AUTOMATIC, PLANNED, STREAMING, Mode, Request
from nmpc_control.mode_rules import RULES
from nmpc_control.modes import answer, next_mode
from nmpc_control.modes_table import table
from nmpc_control.preflight import preflight
from nmpc_control.state import Goal

P = dataclasses.replace(PARAMS.modes, needs_switch=True, battery_action="return")
WARM = dataclasses.replace(
    GOOD,
    verified_plans=P.warm_up_plans,
    plan_usable=True,
    usable_time=5.0,
    time_in_mode=5.0,
    switched_to_f=True,
)
ON_GROUND = {"flight_status": FlightStatus.ON_GROUND}
IN_AIR = {"flight_status": FlightStatus.IN_AIR, "authority": True}
ITS_OWN = {"flight_status": FlightStatus.LANDING, "authority": True}  # the flight controller's
SETTLED = {**IN_AIR, "settled_time": P.take_off_settle}
NO_PLAN = {"plan_usable": False, "plan_finding": "the plan is 0.60 s old"}
GIVEN_BACK = {"brakes_after_start": True}
SILENT_LANDS = Mode.LANDING, "nothing has been heard of the battery for"
OLD = 0.6  # [s] older than any state timeout

# mode, what differs from good, mode that follows, part of the reason
TABLE = [
    # preflight
    (Mode.WAITING, {}, Mode.READY, "start may be asked for"),
    (Mode.READY, {}, Mode.READY, ""),
    (Mode.READY, {"battery": 0.1}, Mode.WAITING, ""),
    (Mode.WAITING, {"battery": 0.1}, Mode.WAITING, ""),
    # start
    (Mode.READY, {"request": Request.START}, Mode.TAKING_OFF, "on the ground"),
    (Mode.WAITING, {"request": Request.START}, Mode.TAKING_OFF, "on the ground"),
    (Mode.READY, {"request": Request.START, **IN_AIR}, Mode.BRAKING, "brake first"),
    (Mode.RELEASED, {"request": Request.START, **IN_AIR}, Mode.BRAKING, "brake first"),
    (Mode.FAULT, {"request": Request.START}, Mode.TAKING_OFF, "on the ground"),
    (Mode.READY, {"request": Request.START, "sticks": 0.5}, Mode.WAITING, ""),
    (Mode.RELEASED, {"request": Request.START, "sticks": 0.5}, Mode.RELEASED, ""),
    (Mode.RELEASED, {}, Mode.RELEASED, ""),
    (Mode.FAULT, {}, Mode.FAULT, ""),
    # the guard is told to end
    (Mode.FLYING, {**IN_AIR, "leaving": True}, Mode.BRAKING, "until authority is given back"),
    (Mode.HOVERING, {**IN_AIR, "leaving": True}, Mode.BRAKING, "told to end"),
    (Mode.BRAKING, {**IN_AIR, "leaving": True}, Mode.BRAKING, ""),
    # take-off
    (Mode.TAKING_OFF, ON_GROUND, Mode.TAKING_OFF, ""),
    (Mode.TAKING_OFF, SETTLED, Mode.HOVERING, "done"),
    (Mode.TAKING_OFF, {**SETTLED, **NO_PLAN}, Mode.BRAKING, "0.60 s old"),
    (Mode.TAKING_OFF, {**SETTLED, "authority": False}, Mode.TAKING_OFF, ""),
    (Mode.TAKING_OFF, {**IN_AIR, "settled_time": 0.2}, Mode.TAKING_OFF, ""),
    (Mode.TAKING_OFF, {"time_in_mode": 31.0}, Mode.FAULT, "30 s"),
    (Mode.TAKING_OFF, {"failure": "refused (ack 6)"}, Mode.FAULT, "refused (ack 6)"),
    (Mode.TAKING_OFF, {"request": Request.LAND, **IN_AIR}, Mode.LANDING, "asked"),
    (Mode.TAKING_OFF, {"request": Request.RELEASE}, Mode.RELEASED, "asked"),
    (Mode.TAKING_OFF, {"attitude_age": OLD}, Mode.RELEASED, "attitude is 0.60 s old"),
    (Mode.TAKING_OFF, {"status_age": OLD}, Mode.RELEASED, "flight status"),
    (Mode.TAKING_OFF, {"position_age": OLD}, Mode.TAKING_OFF, ""),
    # flying and hovering
    (Mode.HOVERING, IN_AIR, Mode.HOVERING, ""),
    (Mode.HOVERING, {**IN_AIR, "goal": Goal.APPROACH}, Mode.FLYING, "goal"),
    (Mode.HOVERING, {**IN_AIR, "goal": Goal.TRAJECTORY}, Mode.FLYING, "goal"),
    (Mode.FLYING, {**IN_AIR, "goal": Goal.TRAJECTORY}, Mode.FLYING, ""),
    (Mode.FLYING, IN_AIR, Mode.HOVERING, "holds"),
    (Mode.FLYING, {**IN_AIR, **NO_PLAN}, Mode.BRAKING, "the plan is 0.60 s old"),
    (Mode.HOVERING, {**IN_AIR, "position_age": OLD}, Mode.BRAKING, "position is 0.60 s old"),
    (Mode.HOVERING, {**IN_AIR, "velocity_age": OLD}, Mode.BRAKING, "velocity is 0.60 s old"),
    (Mode.HOVERING, {**IN_AIR, "attitude_age": OLD}, Mode.RELEASED, "attitude is 0.60 s old"),
    (Mode.FLYING, {**IN_AIR, "authority": False}, Mode.RELEASED, "authority is lost"),
    (Mode.HOVERING, {**IN_AIR, "request": Request.LAND}, Mode.LANDING, "asked"),
    (Mode.FLYING, {**IN_AIR, "request": Request.RELEASE}, Mode.RELEASED, "asked"),
    (Mode.HOVERING, {**IN_AIR, "failure": "refused"}, Mode.RELEASED, "refused"),
    (Mode.HOVERING, {**IN_AIR, **ON_GROUND}, Mode.RELEASED, "on the ground"),
    (
        Mode.FLYING,
        {**IN_AIR, "flight_status": FlightStatus.LANDING},
        Mode.LANDING,
        "lands by itself",
    ),
    (
        Mode.HOVERING,
        {**IN_AIR, "request": Request.HOVER, "goal": Goal.TRAJECTORY},
        Mode.FLYING,
        "goal",
    ),
    (Mode.HOVERING, {**IN_AIR, "battery": 0.1, "sticks": 1.0}, Mode.HOVERING, ""),
    # watchdogs
    (Mode.FLYING, {**IN_AIR, "alarm": "the speed is 15.0 m/s"}, Mode.BRAKING, "15.0 m/s"),
    (Mode.HOVERING, {**IN_AIR, "tilt_time": 0.6}, Mode.RELEASED, "tilt"),
    (Mode.HOVERING, {**IN_AIR, "tilt_time": 0.4}, Mode.HOVERING, ""),
    (Mode.FLYING, {**IN_AIR, "effectless_time": 0.7}, Mode.BRAKING, "not followed"),
    (Mode.BRAKING, {**IN_AIR, "effectless_time": 0.7}, Mode.HOVERING, "usable again"),
    (Mode.BRAKING, {**IN_AIR, "effectless_total": 1.6}, Mode.RELEASED, "lost silently"),
    (Mode.FLYING, {**IN_AIR, "effectless_total": 1.6}, Mode.RELEASED, "lost silently"),
    (Mode.BRAKING, {**IN_AIR, "alarm": "the position"}, Mode.BRAKING, ""),
    (Mode.FLYING, {**IN_AIR, "gps_lost_time": 1.1}, Mode.BRAKING, "no good health for 1.1 s"),
    (Mode.HOVERING, {**IN_AIR, "gps_lost_time": 0.9}, Mode.HOVERING, ""),
    (Mode.BRAKING, {**IN_AIR, "gps_lost_time": 0.1}, Mode.BRAKING, ""),
    # battery
    (Mode.FLYING, {**IN_AIR, "battery_low_time": 3.0}, Mode.HOVERING, "holds"),
    (Mode.HOVERING, {**IN_AIR, "battery_low_time": 3.0}, Mode.HOVERING, ""),
    (Mode.HOVERING, {**IN_AIR, "battery_low_time": 3.0, "is_home": True}, Mode.LANDING, "90%"),
    (Mode.HOVERING, {**IN_AIR, "battery_low_time": 1.0, "is_home": True}, Mode.HOVERING, ""),
    (Mode.FLYING, {**IN_AIR, "battery_low_time": 62.1}, Mode.LANDING, "90%"),
    (Mode.BRAKING, {**IN_AIR, "battery_low_time": 62.1}, Mode.LANDING, "90%"),
    (Mode.HOVERING, {**IN_AIR, "battery_silent_time": 31.0}, Mode.HOVERING, ""),
    (Mode.HOVERING, {**IN_AIR, "battery_silent_time": 29.0, "is_home": True}, Mode.HOVERING, ""),
    (Mode.HOVERING, {**IN_AIR, "battery_silent_time": 31.0, "is_home": True}, *SILENT_LANDS),
    (Mode.BRAKING, {**IN_AIR, "battery_silent_time": 90.1}, *SILENT_LANDS),
    (Mode.BRAKING, {**IN_AIR, "battery_low_time": 99.0, "time_in_mode": 0.5}, Mode.BRAKING, ""),
    (Mode.HOVERING, {**IN_AIR, "battery_critical_time": 2.1}, Mode.LANDING, "90%"),
    # braking
    (Mode.BRAKING, IN_AIR, Mode.HOVERING, "usable again"),
    (Mode.BRAKING, {**IN_AIR, "goal": Goal.TRAJECTORY}, Mode.FLYING, "usable again"),
    (Mode.BRAKING, {**IN_AIR, "usable_time": 0.9}, Mode.BRAKING, ""),
    (Mode.BRAKING, {**IN_AIR, "time_in_mode": 0.9}, Mode.BRAKING, ""),
    (Mode.BRAKING, {**IN_AIR, **NO_PLAN}, Mode.BRAKING, ""),
    (Mode.BRAKING, {**IN_AIR, "speed": 3.0}, Mode.HOVERING, "usable again"),
    (Mode.BRAKING, {**IN_AIR, **GIVEN_BACK, "speed": 3.0}, Mode.BRAKING, ""),
    (Mode.BRAKING, {**IN_AIR, **GIVEN_BACK, "speed": 0.4}, Mode.HOVERING, "usable again"),
    (
        Mode.BRAKING,
        {**IN_AIR, **GIVEN_BACK, "speed": 3.0, "time_in_mode": 6.1},
        Mode.HOVERING,
        "usable again",
    ),
    (Mode.BRAKING, {**IN_AIR, "authority": False}, Mode.BRAKING, ""),
    (
        Mode.BRAKING,
        {**IN_AIR, "authority": False, "time_in_mode": 12.1},
        Mode.RELEASED,
        "12 s",
    ),
    (Mode.BRAKING, {**IN_AIR, **NO_PLAN, "brake_time_left": 0.0}, Mode.RELEASED, "lost"),
    (Mode.BRAKING, {**IN_AIR, **NO_PLAN, "brake_time_left": 0.1}, Mode.BRAKING, ""),
    (Mode.BRAKING, {**IN_AIR, **NO_PLAN, "blind_time": 5.1}, Mode.RELEASED, "position is lost"),
    (Mode.BRAKING, {**IN_AIR, "attitude_age": OLD}, Mode.RELEASED, "attitude"),
    (Mode.BRAKING, {**IN_AIR, "request": Request.LAND}, Mode.LANDING, "asked"),
    # landing
    (Mode.LANDING, IN_AIR, Mode.LANDING, ""),
    (Mode.LANDING, {"flight_status": FlightStatus.LANDED}, Mode.LANDING, ""),
    (Mode.LANDING, ON_GROUND, Mode.WAITING, "landed"),
    (Mode.LANDING, {**IN_AIR, "failure": "refused (ack 1)"}, Mode.BRAKING, "refused (ack 1)"),
    (Mode.LANDING, {**IN_AIR, "time_in_mode": 121.0}, Mode.FAULT, "120 s"),
    (Mode.LANDING, {**IN_AIR, "request": Request.RELEASE}, Mode.RELEASED, "asked"),
    (Mode.LANDING, {**IN_AIR, "attitude_age": OLD}, Mode.RELEASED, "attitude is 0.60 s old"),
    (Mode.LANDING, {**IN_AIR, "tilt_time": 1.0}, Mode.RELEASED, "the tilt has been"),
    (Mode.LANDING, {**IN_AIR, "blind_time": 9.0}, Mode.RELEASED, "landing does not begin"),
    (Mode.LANDING, {**IN_AIR, "brake_time_left": -9.0}, Mode.RELEASED, "landing does not begin"),
    (Mode.LANDING, {**ITS_OWN, "attitude_age": OLD}, Mode.LANDING, ""),
    (Mode.LANDING, {**ITS_OWN, "tilt_time": 1.0}, Mode.LANDING, ""),
    (Mode.LANDING, {**ITS_OWN, "blind_time": 9.0}, Mode.LANDING, ""),
    # the pilot
    (Mode.MANUAL, IN_AIR, Mode.WAITING, "new start"),
    (Mode.MANUAL, {**IN_AIR, "request": Request.START}, Mode.WAITING, "new start"),
    (Mode.MANUAL, {**IN_AIR, "rc": RcMode.P}, Mode.MANUAL, ""),
    (Mode.MANUAL, {**IN_AIR, "rc_age": 0.4}, Mode.MANUAL, ""),
    (Mode.MANUAL, {**ON_GROUND, "rc": RcMode.P}, Mode.WAITING, "landed"),
    (Mode.WAITING, {**IN_AIR, "rc": RcMode.P}, Mode.MANUAL, "RC P"),
    (Mode.READY, {**ON_GROUND, "rc": RcMode.P}, Mode.WAITING, ""),
]


@pytest.mark.parametrize(("mode", "changes", "expected", "reason"), TABLE)
def test_table(mode, changes, expected, reason):
    transition = next_mode(mode, dataclasses.replace(WARM, **changes), P)
    assert transition.mode is expected
    assert reason in transition.reason
    assert bool(transition.reason) == (expected is not mode) or expected is Mode.WAITING


def test_every_rule_is_met_by_the_table():
    fired = set()
    for mode, changes, _, _ in TABLE:
        inputs = dataclasses.replace(WARM, **changes)
        fired |= {
            next((n for n, r in enumerate(RULES) if mode in r.modes and r.when(inputs, P)), None)
        }
        transition = next_mode(mode, inputs, P)
        assert bool(transition.code) == (transition.mode is not mode)
    silent = [RULES[n].reason for n in range(len(RULES)) if n not in fired]
    assert silent == [RULES[0].reason]  # the pilot: a test of its own below


PILOT = [
    {"rc": RcMode.P},
    {"rc": RcMode.A},
    {"rc": RcMode.OFF},
    {"rc": RcMode.UNKNOWN},
    {"rc_age": 0.31},
    {"rc_age": math.inf},
]
WORST = [
    {},
    {"attitude_age": OLD},
    {"request": Request.START},
    {"request": Request.LAND},
    {"failure": "refused"},
    {"goal": Goal.TRAJECTORY},
    {"authority": False, "time_in_mode": 1e3},
    {"flight_status": FlightStatus.LANDING},
]


@pytest.mark.parametrize("mode", AUTOMATIC)
@pytest.mark.parametrize("pilot", PILOT)
@pytest.mark.parametrize("worst", WORST)
def test_the_pilot_wins_over_everything(mode, pilot, worst):
    inputs = dataclasses.replace(WARM, **{**IN_AIR, **worst, **pilot})
    assert next_mode(mode, inputs, P).mode is Mode.MANUAL


def combinations():
    axes = {
        "rc": [RcMode.F, RcMode.P],
        "flight_status": list(FlightStatus),
        "attitude_age": [0.0, 1.0],
        "position_age": [0.0, 1.0],
        "plan_usable": [False, True],
        "authority": [False, True],
        "goal": [Goal.HOLD, Goal.TRAJECTORY],
        "request": [None, *Request],
        "failure": ["", "refused"],
    }
    for values in itertools.product(*axes.values()):
        yield dataclasses.replace(WARM, **dict(zip(axes, values)))


def test_what_holds_for_all_combinations():
    for inputs, mode in itertools.product(combinations(), Mode):
        after = next_mode(mode, inputs, P).mode
        if inputs.rc is not RcMode.F:
            assert after not in AUTOMATIC
        if after in AUTOMATIC and mode not in AUTOMATIC:
            assert inputs.request is Request.START
            assert mode is not Mode.MANUAL
            assert not preflight(inputs, P)
        if after in STREAMING and mode in STREAMING:
            assert inputs.attitude_age == 0.0
        if after in PLANNED:
            assert inputs.plan_usable
            assert inputs.authority
        if inputs.request is not None:
            granted, sentence = answer(mode, inputs, P)
            assert sentence
            if not granted and mode not in AUTOMATIC:
                assert after not in AUTOMATIC
            if granted and inputs.request is Request.START:
                assert after in (Mode.TAKING_OFF, Mode.BRAKING)


PREFLIGHT = [
    ({"attitude_age": math.inf}, "attitude is missing"),
    ({"velocity_age": 0.3}, "velocity is 0.30 s old"),
    ({"position_age": 0.3}, "position is 0.30 s old"),
    ({"rc_age": 0.4}, "RC is 0.40 s old"),
    ({"rc": RcMode.P}, "the RC switch is not in F but P"),
    ({"switched_to_f": False}, "take it away and back"),
    ({"position_age": math.inf}, "no local position reference yet"),
    ({"objections": ("the position jumps",)}, "the position jumps"),
    ({"sticks": 0.11}, "sticks"),
    ({"sticks": math.nan}, "sticks"),
    ({"status_age": 0.6}, "flight status is 0.60 s old"),
    ({"flight_status": FlightStatus.LANDING}, "landing"),
    ({"battery_age": 3.1}, "battery"),
    ({"battery": 0.24}, "24 %, 25 % are needed"),
    ({"battery": math.nan}, "battery"),
    ({"gps_health": 3}, "GPS health is 3"),
    ({"gps_age": 1.0}, "GPS health is 1.00 s old"),
    ({"gps_age": math.inf, "gps_health": 0}, "GPS health is missing"),
    ({"rc_age": math.inf, "rc": RcMode.UNKNOWN, "sticks": math.inf}, "RC is missing"),
    ({"verified_plans": 9, "plan_finding": "no plan has come"}, "9 of 10"),
]


@pytest.mark.parametrize(("changes", "sentence"), PREFLIGHT)
def test_each_finding_before_the_flight_refuses_the_start_in_words(changes, sentence):
    inputs = dataclasses.replace(WARM, request=Request.START, **changes)
    findings = preflight(inputs, P)
    assert len(findings) == 1
    assert sentence in findings[0]
    for mode in (Mode.WAITING, Mode.READY, Mode.RELEASED, Mode.FAULT):
        granted, words = answer(mode, inputs, P)
        assert not granted
        assert findings[0] in words
        assert next_mode(mode, inputs, P).mode not in AUTOMATIC


@pytest.mark.parametrize("action", ["land", "hover"])
def test_what_a_low_battery_does_is_configured(action):
    low = dataclasses.replace(WARM, **IN_AIR, battery_low_time=3.0)
    p = dataclasses.replace(P, battery_action=action)
    expected = Mode.LANDING if action == "land" else Mode.HOVERING
    assert next_mode(Mode.HOVERING, low, p).mode is expected
    silent = dataclasses.replace(WARM, **IN_AIR, battery_silent_time=31.0)
    assert next_mode(Mode.HOVERING, silent, p).mode is expected
    critical = dataclasses.replace(low, battery_critical_time=3.0)
    assert next_mode(Mode.HOVERING, critical, p).mode is Mode.LANDING


def test_the_document_is_what_is_flown():
    document = config_directory().parent / "doc" / "modes.md"
    assert document.read_text(encoding="utf-8") == table(), "run python -m nmpc_control.modes_table"
    for rule in RULES:
        assert rule.words in table()


def test_gps_may_be_bad_where_the_position_comes_from_elsewhere():
    inputs = dataclasses.replace(WARM, needs_gps=False, gps_health=0, gps_age=math.inf)
    assert preflight(inputs, P) == ()


@pytest.mark.parametrize(
    ("mode", "request_", "granted", "words"),
    [
        (Mode.HOVERING, Request.START, False, "under way: hovering"),
        (Mode.MANUAL, Request.START, False, "the pilot has control"),
        (Mode.READY, Request.START, True, "taking off"),
        (Mode.FLYING, Request.HOVER, True, "hovering"),
        (Mode.READY, Request.HOVER, False, "not in flight: ready"),
        (Mode.LANDING, Request.HOVER, False, "not in flight: landing"),
        (Mode.BRAKING, Request.LAND, True, "landing"),
        (Mode.WAITING, Request.LAND, False, "not in flight: waiting"),
        (Mode.FLYING, Request.RELEASE, True, "giving authority back"),
        (Mode.MANUAL, Request.RELEASE, False, "nothing held: manual"),
    ],
)
def test_answers(mode, request_, granted, words):
    given, sentence = answer(mode, dataclasses.replace(WARM, request=request_), P)
    assert given is granted
    assert words in sentence
