# SPDX-License-Identifier: MIT
"""Modes of a flight, what decides between them, and what must be good before one starts."""

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Optional, Tuple

from nmpc_control.dji import TRUSTED_GPS_HEALTH, FlightStatus, RcMode
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
STARTABLE = (Mode.WAITING, Mode.READY, Mode.RELEASED, Mode.FAULT)


def _positive() -> float:
    return field(metadata={"min": 1e-6})


@dataclass(frozen=True)
class ModeParameters:
    """Ages, dwell times and conditions of the rules."""

    attitude_timeout: float = _positive()  # [s]
    velocity_timeout: float = _positive()  # [s]
    position_timeout: float = _positive()  # [s]
    rc_timeout: float = _positive()  # [s]
    status_timeout: float = _positive()  # [s] flight status and GPS health
    battery_timeout: float = _positive()  # [s]
    battery_start: float = field(metadata={"min": 0.0, "max": 1.0})  # [1] least to start with
    stick_centre: float = field(metadata={"min": 0.0, "max": 1.0})  # [1] sticks this near count
    warm_up_plans: int = field(metadata={"min": 1, "max": 10000})  # [1] verified in a row
    take_off_height: float = _positive()  # [m] at least
    take_off_settle: float = field(metadata={"min": 0.0})  # [s] steady at that height
    take_off_timeout: float = _positive()  # [s]
    landing_timeout: float = _positive()  # [s]
    authority_timeout: float = _positive()  # [s] in the air; a service of dji_sdk may take 10 s
    brake_dwell: float = field(metadata={"min": 0.0})  # [s] least time in BRAKING
    recover_time: float = field(metadata={"min": 0.0})  # [s] of usable plans that ends BRAKING
    blind_timeout: float = _positive()  # [s] of braking without position


@dataclass(frozen=True)
class ModeInputs:
    """What the rules look at; ages are infinite for what never came."""

    attitude_age: float = math.inf  # [s]
    velocity_age: float = math.inf  # [s]
    position_age: float = math.inf  # [s]
    rc_age: float = math.inf  # [s]
    rc: RcMode = RcMode.UNKNOWN
    sticks: float = math.inf  # [1] largest deflection
    status_age: float = math.inf  # [s] of the flight status
    flight_status: FlightStatus = FlightStatus.UNKNOWN
    gps_age: float = math.inf  # [s] of the GPS health
    gps_health: int = 0
    needs_gps: bool = True  # the position comes from GPS
    battery_age: float = math.inf  # [s]
    battery: float = math.nan  # [1] state of charge
    verified_plans: int = 0  # [1] in a row, the last one not too old
    plan_usable: bool = False  # rung 1 or 2
    plan_finding: str = ""  # why not
    usable_time: float = 0.0  # [s] without interruption
    goal: Goal = Goal.HOLD
    settled_time: float = 0.0  # [s] in the air at take-off height without moving vertically
    blind_time: float = 0.0  # [s] without position
    brake_time_left: float = math.inf  # [s] until a brake without velocity has done its work
    authority: bool = False
    failure: str = ""  # a service call of this mode failed: how
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


def preflight(i: ModeInputs, p: ModeParameters) -> Tuple[str, ...]:
    """Return what stands against a start, one plain sentence each; empty if nothing does."""
    has_rc, has_status = i.rc_age <= p.rc_timeout, i.status_age <= p.status_timeout
    has_battery, has_gps = i.battery_age <= p.battery_timeout, i.gps_age <= p.status_timeout
    plans = f"{i.verified_plans} of {p.warm_up_plans} plans verified in a row"
    checks = (
        (i.attitude_age > p.attitude_timeout, f"attitude is {_age(i.attitude_age)}"),
        (i.velocity_age > p.velocity_timeout, f"velocity is {_age(i.velocity_age)}"),
        (i.position_age > p.position_timeout, f"position is {_age(i.position_age)}"),
        (not has_rc, f"RC is {_age(i.rc_age)}"),
        (has_rc and i.rc is not RcMode.F, f"the RC switch is not in F but {i.rc.value}"),
        (has_rc and not i.sticks <= p.stick_centre, "the sticks are not centred"),
        (not has_status, f"flight status is {_age(i.status_age)}"),
        (
            has_status and not (i.on_ground or i.in_air),
            f"the flight controller says {i.flight_status.name.lower()}",
        ),
        (not has_battery, f"the battery's state is {_age(i.battery_age)}"),
        (
            has_battery and not i.battery >= p.battery_start,
            f"the battery is at {100 * i.battery:.0f} %, {100 * p.battery_start:.0f} % are needed",
        ),
        (i.needs_gps and not has_gps, f"GPS health is {_age(i.gps_age)}"),
        (
            i.needs_gps and has_gps and i.gps_health <= TRUSTED_GPS_HEALTH,
            f"GPS health is {i.gps_health}, more than {TRUSTED_GPS_HEALTH} is needed",
        ),
        (
            i.verified_plans < p.warm_up_plans,
            f"{plans} ({i.plan_finding})" if i.plan_finding else plans,
        ),
    )
    return tuple(sentence for stands_against, sentence in checks if stands_against)


def _age(seconds: float) -> str:
    return "missing" if math.isinf(seconds) else f"{seconds:.2f} s old"
