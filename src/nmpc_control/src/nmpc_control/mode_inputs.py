# SPDX-License-Identifier: MIT
"""Modes of a flight, and what decides between them."""

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Optional, Tuple

from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.state import Goal


class Mode(IntEnum):
    """Values of ControllerStatus.MODE_*."""

    WAITING = 0
    READY = 1
    TAKING_OFF = 2
    FLYING = 3
    HOVERING = 4
    BRAKING = 5
    LANDING = 6
    MANUAL = 7
    RELEASED = 8
    FAULT = 9


class Request(Enum):
    """What the operator may ask for."""

    START = "start"
    HOVER = "hover"
    LAND = "land"
    RELEASE = "release"


AUTOMATIC = (Mode.TAKING_OFF, Mode.FLYING, Mode.HOVERING, Mode.BRAKING, Mode.LANDING)
STREAMING = (Mode.FLYING, Mode.HOVERING, Mode.BRAKING)
PLANNED = (Mode.FLYING, Mode.HOVERING)
FOLLOWED = (Mode.MANUAL, Mode.WAITING, Mode.READY)  # not flown, but a goal may wait meanwhile
STARTABLE = (Mode.WAITING, Mode.READY, Mode.RELEASED, Mode.FAULT)


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _not_negative() -> float:
    return field(metadata={"min": 0.0})


def _fraction() -> float:
    return field(metadata={"min": 0.0, "max": 1.0})


@dataclass(frozen=True)
class ModeParameters:
    """Ages, dwell times and conditions of the rules."""

    attitude_timeout: float = _positive()  # [s]
    velocity_timeout: float = _positive()  # [s]
    position_timeout: float = _positive()  # [s]
    rc_timeout: float = _positive()  # [s]
    status_timeout: float = _positive()  # [s] flight status and GPS health
    gps_timeout: float = _not_negative()  # [s] of bad health after which GPS gives no position
    battery_timeout: float = _positive()  # [s]
    battery_start: float = _fraction()  # [1] least to start with
    battery_low: float = _fraction()  # [1] below it `battery_action` is taken
    battery_critical: float = _fraction()  # [1] below it the aircraft lands whatever the action
    battery_time: float = _not_negative()  # [s] for which it must stay below
    battery_action: str = field(metadata={"choices": ("return", "land", "hover")})
    battery_silent_time: float = _positive()  # [s] of silence after which it counts as low
    return_timeout: float = _positive()  # [s] after which a return ends in a landing on the spot
    home_radius: float = _positive()  # [m] horizontal, around where automatic flight began
    stick_centre: float = _fraction()  # [1] sticks this near count as centred
    needs_switch: bool = field()  # start needs the switch to be seen going to F
    warm_up_plans: int = field(metadata={"min": 1, "max": 10000})  # [1] verified in a row
    take_off_height: float = _positive()  # [m] at least
    take_off_settle: float = _not_negative()  # [s] steady at that height
    take_off_timeout: float = _positive()  # [s]
    landing_timeout: float = _positive()  # [s]
    authority_timeout: float = _positive()  # [s] in the air; a service of dji_sdk may take 10 s
    brake_dwell: float = _not_negative()  # [s] least time in BRAKING
    recover_time: float = _not_negative()  # [s] of usable plans that ends BRAKING
    return_speed: float = _positive()  # [m/s] at which a start in the air has done braking
    return_brake: float = _positive()  # [s] after which it has anyway
    blind_timeout: float = _positive()  # [s] of braking without position
    tilt_timeout: float = _not_negative()  # [s] of tilt beyond the limit
    effect_brake: float = _positive()  # [s] of commands without effect before it brakes
    effect_release: float = _positive()  # [s] of them in all before authority counts as lost


@dataclass(frozen=True)
class ModeInputs:
    """What the rules look at; ages are infinite for what never came."""

    attitude_age: float = math.inf  # [s]
    velocity_age: float = math.inf  # [s]
    position_age: float = math.inf  # [s]
    rc_age: float = math.inf  # [s]
    rc: RcMode = RcMode.UNKNOWN
    switched_to_f: bool = False  # the switch was seen away from F, and then in F
    sticks: float = math.inf  # [1] largest deflection
    status_age: float = math.inf  # [s] of the flight status
    flight_status: FlightStatus = FlightStatus.UNKNOWN
    gps_age: float = math.inf  # [s] of the GPS health
    gps_health: int = 0
    needs_gps: bool = True  # the position comes from GPS
    gps_lost_time: float = 0.0  # [s] for which it has been without good health, where it is needed
    battery_age: float = math.inf  # [s]
    battery: float = math.nan  # [1] state of charge
    battery_silent_time: float = 0.0  # [s] since it was heard of, beyond `battery_timeout`; else 0
    battery_low_time: float = 0.0  # [s] for which it has been low
    battery_critical_time: float = 0.0  # [s] for which it has been critical
    is_home: bool = False  # holding position where automatic flight began
    objections: Tuple[str, ...] = ()  # what else stands against a start, a sentence each
    verified_plans: int = 0  # [1] in a row, the last one not too old
    plan_usable: bool = False  # rung 1 or 2
    plan_finding: str = ""  # why not
    usable_time: float = 0.0  # [s] without interruption
    goal: Goal = Goal.HOLD
    settled_time: float = 0.0  # [s] in the air at take-off height without moving vertically
    blind_time: float = 0.0  # [s] without position
    brake_time_left: float = math.inf  # [s] until a brake without velocity has done its work
    speed: float = 0.0  # [m/s]
    brakes_after_start: bool = False  # this BRAKING is that of a start in the air
    alarm: str = ""  # what a watchdog sees that calls for a brake
    tilt_time: float = 0.0  # [s] for which the tilt has been beyond its limit
    effectless_time: float = 0.0  # [s] of commands without effect, in this mode
    effectless_total: float = 0.0  # [s] of them since the last that had effect
    unheeded: bool = False  # commands had no effect twice since somebody asked for the flight
    authority: bool = False
    leaving: bool = False  # the guard was told to end, and gives authority back
    failure: str = ""  # a service call of this mode failed: how
    landing_granted: bool = False  # dji_sdk has answered this mode's call to land: it begins
    request: Optional[Request] = None
    time_in_mode: float = 0.0  # [s]

    @property
    def on_ground(self) -> bool:
        """Whether the flight controller says so."""
        return self.flight_status is FlightStatus.ON_GROUND

    @property
    def in_air(self) -> bool:
        """Whether the flight controller says so."""
        return self.flight_status is FlightStatus.IN_AIR
