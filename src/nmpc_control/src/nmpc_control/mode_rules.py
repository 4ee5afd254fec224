# SPDX-License-Identifier: MIT
"""The table of a flight's transitions: from which modes, to which, when, and why in plain words.

The first rule that applies to the present mode wins, so the order is the priority: the pilot first,
then what cannot be flown without, then the operator, then the course of the flight.
"""

from typing import Tuple

from nmpc_control.course_rules import COURSE
from nmpc_control.mode_conditions import (
    UNTIL_IT_LANDS,
    Rule,
    asked,
    awaits_landing,
    pilot_has_control,
    start,
)
from nmpc_control.mode_inputs import AUTOMATIC, PLANNED, STARTABLE, STREAMING, Mode, Request

IN_FLIGHT = (Mode.TAKING_OFF, *STREAMING)

RULES: Tuple[Rule, ...] = (
    # the pilot
    Rule(
        "pilot",
        AUTOMATIC,
        Mode.MANUAL,
        "RC not in F, off, or older than `rc_timeout`",
        pilot_has_control,
        "the pilot has control: RC {i.rc.value}",
    ),
    Rule(
        "pilot",
        STARTABLE,
        Mode.MANUAL,
        "the same, in the air",
        lambda i, p: i.in_air and pilot_has_control(i, p),
        "the pilot has control: RC {i.rc.value}",
    ),
    Rule(
        "pilot_gave_back",
        (Mode.MANUAL,),
        Mode.WAITING,
        "RC in F and heard of",
        lambda i, p: not pilot_has_control(i, p),
        "RC is back in F; automatic flight needs a new start",
    ),
    Rule(
        "pilot_landed",
        (Mode.MANUAL,),
        Mode.WAITING,
        "the flight controller says: on the ground",
        lambda i, p: i.on_ground,
        "the pilot has landed",
    ),
    # what cannot be flown without
    Rule(
        "attitude_stale",
        IN_FLIGHT,
        Mode.RELEASED,
        "attitude or body rates older than `attitude_timeout`",
        lambda i, p: i.attitude_age > p.attitude_timeout,
        "attitude is {i.attitude_age:.2f} s old",
    ),
    Rule(
        "attitude_stale",
        (Mode.LANDING,),
        Mode.RELEASED,
        f"the same, {UNTIL_IT_LANDS}",
        lambda i, p: awaits_landing(i, p) and i.attitude_age > p.attitude_timeout,
        "attitude is {i.attitude_age:.2f} s old",
    ),
    Rule(
        "status_stale",
        IN_FLIGHT,
        Mode.RELEASED,
        "flight status older than `status_timeout`",
        lambda i, p: i.status_age > p.status_timeout,
        "flight status is {i.status_age:.2f} s old",
    ),
    Rule(
        "tilt",
        IN_FLIGHT,
        Mode.RELEASED,
        "tilt beyond `watch.tilt` for longer than `tilt_timeout`",
        lambda i, p: i.tilt_time > p.tilt_timeout,
        "the tilt has been beyond its limit for {i.tilt_time:.1f} s",
    ),
    Rule(
        "tilt",
        (Mode.LANDING,),
        Mode.RELEASED,
        f"the same, {UNTIL_IT_LANDS}",
        lambda i, p: awaits_landing(i, p) and i.tilt_time > p.tilt_timeout,
        "the tilt has been beyond its limit for {i.tilt_time:.1f} s",
    ),
    Rule(
        "leaving",
        PLANNED,
        Mode.BRAKING,
        "the guard was told to end",
        lambda i, p: i.leaving,
        "the guard was told to end: it holds on until authority is given back",
    ),
    Rule(
        "authority_lost",
        PLANNED,
        Mode.RELEASED,
        "dji_sdk says that authority is not held",
        lambda i, p: not i.authority,
        "control authority is lost",
    ),
    Rule(
        "authority_lost",
        STREAMING,
        Mode.RELEASED,
        "commands without effect for `effect_release` in all since the last that had effect, or "
        "for `effect_brake` twice within half a minute",
        lambda i, p: i.effectless_total > p.effect_release or i.unheeded,
        "control authority is lost silently: the aircraft has not followed the commands for "
        "{i.effectless_total:.1f} s",
    ),
    Rule(
        "authority_refused",
        (Mode.BRAKING,),
        Mode.RELEASED,
        "authority not given within `authority_timeout`",
        lambda i, p: not i.authority and i.time_in_mode > p.authority_timeout,
        "control authority was not given within {p.authority_timeout:g} s",
    ),
    # the operator
    Rule(
        "asked",
        (*AUTOMATIC, Mode.READY, Mode.FAULT),
        Mode.RELEASED,
        "`release` asked for",
        asked(Request.RELEASE),
        "release was asked for",
    ),
    Rule(
        "asked",
        IN_FLIGHT,
        Mode.LANDING,
        "`land` asked for",
        asked(Request.LAND),
        "landing was asked for",
    ),
    Rule(
        "asked",
        STARTABLE,
        Mode.TAKING_OFF,
        "`start` asked for on the ground, nothing against it",
        start(lambda i, p: i.on_ground),
        "start was asked for on the ground",
    ),
    Rule(
        "asked",
        STARTABLE,
        Mode.BRAKING,
        "`start` asked for in the air, nothing against it",
        start(lambda i, p: i.in_air),
        "start was asked for in the air: brake first",
    ),
    *COURSE,
)
