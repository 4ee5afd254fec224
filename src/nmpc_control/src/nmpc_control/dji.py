# SPDX-License-Identifier: MIT
"""The numbers of DJI's interface: control bytes, setpoint axes, RC switch, flight status.

Source: uav_sim/doc/dji_sdk.md, sections 2 to 5. Degrees, percent and flags live here and nowhere
else. What leaves this module towards the aircraft is finite and inside the limits, or it does not
leave: a setpoint that is not finite raises SetpointError.
"""

import math
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Sequence, Tuple

from nmpc_control.errors import NmpcError
from nmpc_control.params import Vehicle

ATTITUDE_THRUST = 0x2B  # roll, pitch [rad], thrust [percent], yaw rate [rad/s], body frame
ATTITUDE_VERTICAL_VELOCITY = 0x0B  # roll, pitch [rad], up [m/s], yaw rate [rad/s], body frame
VELOCITY = 0x49  # east, north, up [m/s], yaw rate [rad/s], ground frame; holds position at zero

TRUSTED_GPS_HEALTH = 3  # position and velocity are to be trusted above this
RC_SWITCH_TOLERANCE = 1000.0  # [raw] around each of the switch's values

Axes = Tuple[float, float, float, float, float]


class SetpointError(NmpcError):
    """A setpoint that must not be sent: not finite, or outside the limits after clamping."""


class FlightStatus(IntEnum):
    """Values of ``dji_sdk/flight_status`` on an M100."""

    UNKNOWN = 0
    ON_GROUND = 1
    TAKING_OFF = 2
    IN_AIR = 3
    LANDING = 4
    LANDED = 5


class Task(IntEnum):
    """Tasks of the service ``dji_sdk/drone_task_control``."""

    GO_HOME = 1
    TAKE_OFF = 4
    LAND = 6


class RcMode(Enum):
    """Position of the transmitter's mode switch; only F lets the SDK command."""

    P = "P"
    A = "A"
    F = "F"
    OFF = "off"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Switch:
    """Raw values of the mode switch in ``rc`` axis 4; other products use other numbers."""

    p: float = field()
    a: float = field()
    f: float = field()


@dataclass(frozen=True)
class SetpointLimits:
    """The narrower of DJI's two published tables for each setpoint (uav_sim/doc/dji_sdk.md 3.4)."""

    tilt: float = field(metadata={"min": 0.01, "max": 0.6109})  # [rad] norm of (roll, pitch)
    yaw_rate: float = field(metadata={"min": 0.0, "max": 2.618})  # [rad/s]
    thrust_min: float = field(metadata={"min": 0.0, "max": 100.0})  # [percent]
    thrust_max: float = field(metadata={"min": 0.0, "max": 100.0})  # [percent]
    horizontal_velocity: float = field(metadata={"min": 0.0, "max": 30.0})  # [m/s] norm
    vertical_velocity: float = field(metadata={"min": 0.0, "max": 5.0})  # [m/s]


def attitude_thrust_axes(
    u: Sequence[float], vehicle: Vehicle, limits: SetpointLimits, gain: float = 1.0
) -> Axes:
    """Return the five Joy axes that command an input (4,) [m/s^2, rad, rad, rad/s], clamped.

    ``gain`` [1] is what the battery leaves of the thrust of the vehicle's map.

    Raises:
        SetpointError: the input is not finite.
    """
    _require_finite(u, 4)
    thrust, roll, pitch, yaw_rate = (float(value) for value in u)
    roll, pitch = _shorten(roll, pitch, min(limits.tilt, vehicle.tilt_limit))
    percent = vehicle.thrust_map.percent(thrust / gain)
    percent = _clamp(percent, limits.thrust_min, limits.thrust_max)
    axes = (
        roll,
        pitch,
        percent,
        _clamp(yaw_rate, -limits.yaw_rate, limits.yaw_rate),
        float(ATTITUDE_THRUST),
    )
    return checked(axes, limits)


def attitude_velocity_axes(
    attitude: Sequence[float], vertical: float, vehicle: Vehicle, limits: SetpointLimits
) -> Axes:
    """Return the axes for roll, pitch [rad], yaw rate [rad/s] with a vertical velocity [m/s].

    No thrust map is needed: the first flights of an airframe are flown this way.

    Raises:
        SetpointError: a value is not finite.
    """
    _require_finite((*attitude, vertical), 4)
    roll, pitch = _shorten(
        float(attitude[0]), float(attitude[1]), min(limits.tilt, vehicle.tilt_limit)
    )
    up = _clamp(float(vertical), -limits.vertical_velocity, limits.vertical_velocity)
    yaw_rate = _clamp(float(attitude[2]), -limits.yaw_rate, limits.yaw_rate)
    return checked((roll, pitch, up, yaw_rate, float(ATTITUDE_VERTICAL_VELOCITY)), limits)


def velocity_axes(velocity: Sequence[float], yaw_rate: float, limits: SetpointLimits) -> Axes:
    """Return the axes for an ENU velocity (3,) [m/s] and a yaw rate [rad/s]; needs gps_health > 3.

    Raises:
        SetpointError: a value is not finite.
    """
    _require_finite((*velocity, yaw_rate), 4)
    east, north = _shorten(float(velocity[0]), float(velocity[1]), limits.horizontal_velocity)
    up = _clamp(float(velocity[2]), -limits.vertical_velocity, limits.vertical_velocity)
    yaw_rate = _clamp(float(yaw_rate), -limits.yaw_rate, limits.yaw_rate)
    return checked((east, north, up, yaw_rate, float(VELOCITY)), limits)


def checked(axes: Sequence[float], limits: SetpointLimits) -> Axes:
    """Return the axes unchanged if they may be published: the last look before the wire.

    Raises:
        SetpointError: not five finite numbers, an unknown control byte, or outside the limits.
    """
    _require_finite(axes, 5)
    x, y, z, yaw_rate, flag = axes
    slack = 1.0 + 1e-9
    plane = limits.horizontal_velocity if flag == VELOCITY else limits.tilt
    low, high = -limits.vertical_velocity, limits.vertical_velocity
    if flag == ATTITUDE_THRUST:
        low, high = limits.thrust_min, limits.thrust_max
    elif flag not in (VELOCITY, ATTITUDE_VERTICAL_VELOCITY):
        raise SetpointError(f"setpoint with control byte {flag:g}, which this package never sends")
    if math.hypot(x, y) > plane * slack or not low <= z <= high or abs(yaw_rate) > limits.yaw_rate:
        raise SetpointError(f"setpoint {tuple(axes)} outside the limits {limits}")
    return tuple(axes)


def input_from_axes(
    axes: Sequence[float], vehicle: Vehicle, gain: float = 1.0
) -> Tuple[float, float, float, float]:
    """Return the input (4,) [m/s^2, rad, rad, rad/s] that attitude and thrust axes command."""
    return (gain * vehicle.thrust_map.thrust(axes[2]), axes[0], axes[1], axes[3])


def rc_mode(axes: Sequence[float], switch: Switch) -> RcMode:
    """Return where the mode switch stands; a gear switch (axis 5) of exactly 0 means RC off."""
    if len(axes) < 6 or not all(map(math.isfinite, axes[:6])):
        return RcMode.UNKNOWN
    if axes[5] == 0.0:
        return RcMode.OFF
    for mode, value in ((RcMode.P, switch.p), (RcMode.A, switch.a), (RcMode.F, switch.f)):
        if abs(axes[4] - value) <= RC_SWITCH_TOLERANCE:
            return mode
    return RcMode.UNKNOWN


def stick_deflection(axes: Sequence[float]) -> float:
    """Return the largest stick deflection [1], 1 at the stop; inf if it cannot be read."""
    if len(axes) < 4 or not all(map(math.isfinite, axes[:4])):
        return math.inf
    return max(abs(float(axis)) for axis in axes[:4])


def flight_status(value: int) -> FlightStatus:
    """Return the flight status of a raw value."""
    known = value in FlightStatus.__members__.values()
    return FlightStatus(value) if known else FlightStatus.UNKNOWN


def _require_finite(values: Sequence[float], length: int) -> None:
    if len(values) != length or not all(map(math.isfinite, values)):
        raise SetpointError(f"setpoint {tuple(values)}: expected {length} finite numbers")


def _clamp(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


def _shorten(x: float, y: float, limit: float) -> Tuple[float, float]:
    norm = math.hypot(x, y)
    return (x, y) if norm <= limit else (x * limit / norm, y * limit / norm)
