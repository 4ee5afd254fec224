# SPDX-License-Identifier: MIT
"""What a rule of the mode table is, and the conditions that several of them share."""

from dataclasses import dataclass
from typing import Callable, Tuple

from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.mode_inputs import Mode, ModeInputs, ModeParameters, Request
from nmpc_control.preflight import preflight

Condition = Callable[[ModeInputs, ModeParameters], bool]


@dataclass(frozen=True)
class Rule:
    """From any of ``modes`` to ``to`` if ``when``; ``reason`` is formatted with ``i`` and ``p``."""

    code: str  # of the reason, for programs
    modes: Tuple[Mode, ...]
    to: Mode
    words: str  # the condition, for people
    when: Condition
    reason: str


def pilot_has_control(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the RC is away from F, off, or not heard of."""
    return i.rc is not RcMode.F or i.rc_age > p.rc_timeout


def asked(request: Request) -> Condition:
    """Return the condition that the operator asked for it."""
    return lambda i, p: i.request is request


def start(condition: Condition) -> Condition:
    """Return the condition of a start that nothing stands against."""
    return lambda i, p: i.request is Request.START and not preflight(i, p) and condition(i, p)


def recovered(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether braking may end; what the pilot gave over in motion comes to rest first."""
    waited = i.time_in_mode >= p.brake_dwell and i.usable_time >= p.recover_time
    if i.brakes_after_start:
        waited &= i.speed <= p.return_speed or i.time_in_mode > p.return_brake
    hindered = i.alarm or i.leaving or i.gps_lost_time > 0.0
    return waited and i.plan_usable and i.authority and not hindered


def gps_is_lost(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the position is one of GPS without good health, as good as none."""
    return i.gps_lost_time > p.gps_timeout


def knows_motion(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether position and velocity are those of now."""
    is_fresh = i.position_age <= p.position_timeout and i.velocity_age <= p.velocity_timeout
    return is_fresh and not gps_is_lost(i, p)


def airborne(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the take-off has done its work."""
    return i.in_air and i.settled_time >= p.take_off_settle and i.authority


UNTIL_IT_LANDS = "until the flight controller's own landing has begun"


def awaits_landing(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the flight controller's own landing has not begun, as far as is known.

    Once its start is acknowledged, only a status that is still heard can say otherwise.
    """
    return i.in_air and (not i.landing_granted or i.status_age <= p.status_timeout)


def on_ground_again(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the flight controller says that it does not fly."""
    return i.flight_status in (FlightStatus.ON_GROUND, FlightStatus.LANDED)


def battery_is_low(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the configured action is due."""
    return i.battery_low_time > p.battery_time


def battery_is_silent(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether it is due because nothing is heard of the battery, which empties unseen."""
    return i.battery_silent_time > p.battery_silent_time


def battery_call(i: ModeInputs, p: ModeParameters) -> str:
    """Return why the configured action is due, in a word; empty where it is not."""
    return "low" if battery_is_low(i, p) else "silent" if battery_is_silent(i, p) else ""


def battery_sentence(i: ModeInputs, p: ModeParameters) -> str:
    """Return what a person must know of the battery in flight; empty: nothing."""
    if battery_is_low(i, p):
        return f"the battery is at {i.battery:.0%}: {p.battery_action}"
    if i.battery_silent_time == 0.0:
        return ""
    silence = f"nothing has been heard of the battery for {i.battery_silent_time:.0f} s"
    when = "" if battery_is_silent(i, p) else f" at {p.battery_silent_time:g} s"
    return f"{silence}: {p.battery_action}{when}"


def battery_ends_the_flight(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether the battery demands a landing here."""
    is_critical = i.battery_critical_time > p.battery_time
    over = i.battery_low_time - p.battery_time
    return is_critical or (battery_is_low(i, p) and _action_lands(i, p, over))


def silence_ends_the_flight(i: ModeInputs, p: ModeParameters) -> bool:
    """Return whether a battery that nothing is heard of demands a landing here."""
    over = i.battery_silent_time - p.battery_silent_time
    return battery_is_silent(i, p) and _action_lands(i, p, over)


def _action_lands(i: ModeInputs, p: ModeParameters, over: float) -> bool:
    """Return whether the action, due for ``over`` [s], is to land or a return that is done."""
    returned = i.is_home or over > p.return_timeout
    return p.battery_action == "land" or (p.battery_action == "return" and returned)
