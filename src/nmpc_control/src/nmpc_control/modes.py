# SPDX-License-Identifier: MIT
"""Transitions of a flight: one table of rules, one pure function of mode, inputs and parameters.

The first rule that applies to the present mode wins, so the order is the priority: the pilot first,
then what cannot be flown without, then the operator, then the course of the flight.
"""

from dataclasses import dataclass
from typing import Callable, Tuple

from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.mode_inputs import (
    AUTOMATIC,
    PLANNED,
    STARTABLE,
    STREAMING,
    Mode,
    ModeInputs,
    ModeParameters,
    Request,
    preflight,
)
from nmpc_control.state import Goal


@dataclass(frozen=True)
class Transition:
    """The mode to be in, and why in plain words."""

    mode: Mode
    reason: str


Condition = Callable[[ModeInputs, ModeParameters], bool]


@dataclass(frozen=True)
class Rule:
    """From any of ``modes`` to ``to`` if ``when``; ``reason`` is formatted with ``i`` and ``p``."""

    modes: Tuple[Mode, ...]
    to: Mode
    when: Condition
    reason: str


def pilot_has_control(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the RC is away from F, off, or not heard of."""
    return i.rc is not RcMode.F or i.rc_age > p.rc_timeout


def _asked(request: Request) -> Condition:
    return lambda i, p: i.request is request


def _start(condition: Condition) -> Condition:
    return lambda i, p: i.request is Request.START and not preflight(i, p) and condition(i, p)


def _recovered(i: ModeInputs, p: ModeParameters) -> bool:
    waited = i.time_in_mode >= p.brake_dwell and i.usable_time >= p.recover_time
    return waited and i.plan_usable and i.authority


def _airborne(i: ModeInputs, p: ModeParameters) -> bool:
    return i.in_air and i.settled_time >= p.take_off_settle and i.authority


def _on_ground_again(i: ModeInputs, p: ModeParameters) -> bool:
    return i.flight_status in (FlightStatus.ON_GROUND, FlightStatus.LANDED)


RULES: Tuple[Rule, ...] = (
    # the pilot
    Rule(AUTOMATIC, Mode.MANUAL, pilot_has_control, "the pilot has control: RC {i.rc.value}"),
    Rule(
        STARTABLE,
        Mode.MANUAL,
        lambda i, p: i.in_air and pilot_has_control(i, p),
        "the pilot has control: RC {i.rc.value}",
    ),
    Rule(
        (Mode.MANUAL,),
        Mode.WAITING,
        lambda i, p: not pilot_has_control(i, p),
        "RC is back in F; automatic flight needs a new start",
    ),
    # what cannot be flown without
    Rule(
        (Mode.TAKING_OFF, *STREAMING),
        Mode.RELEASED,
        lambda i, p: i.attitude_age > p.attitude_timeout,
        "attitude is {i.attitude_age:.2f} s old",
    ),
    Rule(
        (Mode.TAKING_OFF, *STREAMING),
        Mode.RELEASED,
        lambda i, p: i.status_age > p.status_timeout,
        "flight status is {i.status_age:.2f} s old",
    ),
    Rule(PLANNED, Mode.RELEASED, lambda i, p: not i.authority, "control authority is lost"),
    Rule(
        (Mode.BRAKING,),
        Mode.RELEASED,
        lambda i, p: not i.authority and i.time_in_mode > p.authority_timeout,
        "control authority was not given within {p.authority_timeout:g} s",
    ),
    # the operator
    Rule(
        (*AUTOMATIC, Mode.READY, Mode.FAULT),
        Mode.RELEASED,
        _asked(Request.RELEASE),
        "release was asked for",
    ),
    Rule(
        (Mode.TAKING_OFF, *STREAMING), Mode.LANDING, _asked(Request.LAND), "landing was asked for"
    ),
    Rule(
        STARTABLE,
        Mode.TAKING_OFF,
        _start(lambda i, p: i.on_ground),
        "start was asked for on the ground",
    ),
    Rule(
        STARTABLE,
        Mode.BRAKING,
        _start(lambda i, p: i.in_air),
        "start was asked for in the air: brake first",
    ),
    # the course of the flight
    Rule((Mode.TAKING_OFF,), Mode.FAULT, lambda i, p: bool(i.failure), "take-off: {i.failure}"),
    Rule(
        (Mode.TAKING_OFF,),
        Mode.HOVERING,
        lambda i, p: _airborne(i, p) and i.plan_usable,
        "the take-off is done",
    ),
    Rule(
        (Mode.TAKING_OFF,),
        Mode.BRAKING,
        _airborne,
        "the take-off is done, but: {i.plan_finding}",
    ),
    Rule(
        (Mode.TAKING_OFF,),
        Mode.FAULT,
        lambda i, p: i.time_in_mode > p.take_off_timeout,
        "the take-off was not done within {p.take_off_timeout:g} s",
    ),
    Rule(
        STREAMING,
        Mode.RELEASED,
        _on_ground_again,
        "the flight controller says that the aircraft is on the ground",
    ),
    Rule(
        STREAMING,
        Mode.LANDING,
        lambda i, p: i.flight_status is FlightStatus.LANDING,
        "the flight controller lands by itself",
    ),
    Rule(STREAMING, Mode.RELEASED, lambda i, p: bool(i.failure), "{i.failure}"),
    Rule(
        PLANNED,
        Mode.BRAKING,
        lambda i, p: i.position_age > p.position_timeout,
        "position is {i.position_age:.2f} s old",
    ),
    Rule(
        PLANNED,
        Mode.BRAKING,
        lambda i, p: i.velocity_age > p.velocity_timeout,
        "velocity is {i.velocity_age:.2f} s old",
    ),
    Rule(PLANNED, Mode.BRAKING, lambda i, p: not i.plan_usable, "{i.plan_finding}"),
    Rule(
        (Mode.HOVERING,),
        Mode.FLYING,
        lambda i, p: i.goal is not Goal.HOLD,
        "the plan leads to a goal",
    ),
    Rule(
        (Mode.FLYING,), Mode.HOVERING, lambda i, p: i.goal is Goal.HOLD, "the plan holds position"
    ),
    Rule(
        (Mode.BRAKING,),
        Mode.RELEASED,
        lambda i, p: i.brake_time_left <= 0.0,
        "position and velocity are lost; the brake without them has done what it can",
    ),
    Rule(
        (Mode.BRAKING,),
        Mode.RELEASED,
        lambda i, p: i.blind_time > p.blind_timeout,
        "position is lost for {i.blind_time:.1f} s",
    ),
    Rule(
        (Mode.BRAKING,),
        Mode.FLYING,
        lambda i, p: _recovered(i, p) and i.goal is not Goal.HOLD,
        "plans are usable again",
    ),
    Rule((Mode.BRAKING,), Mode.HOVERING, _recovered, "plans are usable again"),
    Rule((Mode.LANDING,), Mode.BRAKING, lambda i, p: bool(i.failure) and i.in_air, "{i.failure}"),
    Rule((Mode.LANDING,), Mode.WAITING, lambda i, p: i.on_ground, "the aircraft has landed"),
    Rule(
        (Mode.LANDING,),
        Mode.FAULT,
        lambda i, p: i.time_in_mode > p.landing_timeout,
        "the landing was not done within {p.landing_timeout:g} s",
    ),
    Rule((Mode.WAITING,), Mode.READY, lambda i, p: not preflight(i, p), "start may be asked for"),
    Rule((Mode.READY,), Mode.WAITING, lambda i, p: bool(preflight(i, p)), ""),
)


def next_mode(mode: Mode, inputs: ModeInputs, params: ModeParameters) -> Transition:
    """Return the mode that follows; its reason is empty where nothing changes."""
    for rule in RULES:
        if mode in rule.modes and rule.when(inputs, params):
            return Transition(rule.to, rule.reason.format(i=inputs, p=params))
    return Transition(mode, "")


def answer(mode: Mode, i: ModeInputs, p: ModeParameters) -> Tuple[bool, str]:
    """Return whether the request in ``i`` is granted in this mode, and a sentence about it."""
    request = i.request
    if request is Request.START:
        if mode in AUTOMATIC:
            return False, f"automatic flight is under way: {mode.name.lower()}"
        if mode is Mode.MANUAL:
            return False, f"the pilot has control: RC {i.rc.value}"
        against = preflight(i, p)
        if against:
            return False, "not started: " + "; ".join(against)
        return True, "taking off" if i.on_ground else "braking to hover"
    if request is Request.HOVER:
        granted = mode in STREAMING
        return granted, "hovering" if granted else f"not in flight: {mode.name.lower()}"
    if request is Request.LAND:
        granted = mode in (Mode.TAKING_OFF, *STREAMING)
        return granted, "landing" if granted else f"not in flight: {mode.name.lower()}"
    granted = mode in (*AUTOMATIC, Mode.READY, Mode.FAULT)
    return granted, "giving authority back" if granted else f"nothing held: {mode.name.lower()}"
