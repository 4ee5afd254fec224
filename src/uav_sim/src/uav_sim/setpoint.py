# SPDX-License-Identifier: MIT
"""Setpoints as dji_sdk hands them to the flight controller (doc/dji_sdk.md 3).

A decoded setpoint is in the flight controller's convention: degrees, forward-right or north-east,
yaw clockwise from north, up positive.
"""

import enum
import functools
import math
from typing import List, NamedTuple, Sequence, Tuple

from uav_sim.errors import SetpointError
from uav_sim.plant import limit_norm, limit_tilt
from uav_sim.preset import Limits

ROUNDING = 1e-5
TOPIC_PREFIX = "flight_control_setpoint_"
# Suffix of the topic -> control byte that it implies; None: fifth axis.
FLAGS = {
    "generic": None,
    "ENUposition_yaw": 0x91,
    "ENUvelocity_yawrate": 0x49,
    "rollpitch_yawrate_zposition": 0x1B,
}


class Horizontal(enum.IntEnum):
    """Meaning of x and y."""

    ANGLE = 0x00
    VELOCITY = 0x40
    POSITION = 0x80


class Vertical(enum.IntEnum):
    """Meaning of z."""

    VELOCITY = 0x00
    POSITION = 0x10
    THRUST = 0x20


class Yaw(enum.IntEnum):
    """Meaning of yaw."""

    ANGLE = 0x00
    RATE = 0x08


class Frame(enum.IntEnum):
    """Axes of x and y."""

    GROUND = 0x00
    BODY = 0x02


class Setpoint(NamedTuple):
    """One setpoint in the flight controller's convention."""

    horizontal: Horizontal
    vertical: Vertical
    yaw_mode: Yaw
    frame: Frame
    stable: bool  # brake and hold position at zero velocity
    x: float  # roll [deg], else velocity [m/s] or offset [m]: north (GROUND) or ahead (BODY)
    y: float  # pitch, nose up [deg], else the same: east (GROUND) or right (BODY)
    z: float  # velocity [m/s], height above take-off [m] or thrust [percent]
    yaw: float  # clockwise: angle from north [deg] or rate [deg/s]

    @property
    def modes(self) -> Tuple[Horizontal, Vertical, Yaw, Frame, bool]:
        """The control byte in its parts."""
        return self[:5]

    @property
    def words(self) -> str:
        """The control byte in words."""
        words = (
            f"horizontal {self.horizontal.name}",
            f"vertical {self.vertical.name}",
            f"yaw {self.yaw_mode.name}",
            self.frame.name,
        )
        return ", ".join(words).lower() + (", stable" if self.stable else "")


class Receipt(NamedTuple):
    """What became of a setpoint; ``text`` says why it was ignored, or what was limited."""

    accepted: bool
    text: str = ""


def decode(suffix: str, axes: Sequence[float]) -> Setpoint:
    """Return the setpoint in a Joy message's axes as the flight controller gets it.

    Args:
        suffix: what follows ``flight_control_setpoint_`` in the topic's name.
        axes: x, y, z, yaw and, on the generic topic, the control byte; ENU or FLU, radians.

    Raises:
        SetpointError: too few axes, a number that is not finite, or a mode that the M100 lacks.
    """
    flag = FLAGS[suffix]
    needed = 5 if flag is None else 4
    if len(axes) < needed:
        raise SetpointError(f"{len(axes)} axes instead of {needed}")
    if not all(map(math.isfinite, axes[:needed])):
        raise SetpointError(f"axes {tuple(axes[:needed])} are not all finite")
    if flag is None:
        flag = int(axes[4])
    horizontal, vertical, yaw_mode, frame = _modes(flag)
    x, y, z, yaw = axes[:4]
    if horizontal is Horizontal.ANGLE:
        x, y = math.degrees(x), math.degrees(-y)
    elif frame is Frame.GROUND:
        x, y = y, x
    else:
        y = -y
    if yaw_mode is Yaw.ANGLE:
        yaw = 90.0 - math.degrees(yaw)
        yaw = 180.0 - (180.0 - yaw) % 360.0
    else:
        yaw = math.degrees(-yaw)
    return Setpoint(horizontal, vertical, yaw_mode, frame, bool(flag & 0x01), x, y, z, yaw)


@functools.lru_cache(maxsize=256)
def _modes(flag: int) -> Tuple[Horizontal, Vertical, Yaw, Frame]:
    if not 0 <= flag <= 0xFF:
        raise SetpointError(f"control byte {flag} is not in 0..255")
    if flag & 0xC0 == 0xC0:
        raise SetpointError(f"control byte 0x{flag:02X}: an M100 follows no angular rates")
    if flag & 0x30 == 0x30:
        raise SetpointError(f"control byte 0x{flag:02X}: vertical mode 0x30 does not exist")
    if flag & 0x04:
        raise SetpointError(f"control byte 0x{flag:02X}: frame 0x{flag & 0x06:02X} does not exist")
    return (
        Horizontal(flag & 0xC0),
        Vertical(flag & 0x30),
        Yaw(flag & 0x08),
        Frame(flag & 0x02),
    )


def limited(setpoint: Setpoint, limits: Limits, tilt_limit: float) -> Tuple[Setpoint, str]:
    """Return the setpoint within the limits, and in words what was out of range (empty if nothing).

    Args:
        setpoint: as decoded.
        limits: ranges of the flight controller.
        tilt_limit: norm of the vector (roll, pitch) [rad].
    """
    if _is_within(setpoint, limits, tilt_limit):
        return setpoint, ""
    x, y, z, yaw = setpoint.x, setpoint.y, setpoint.z, setpoint.yaw
    words: List[str] = []
    if setpoint.horizontal is Horizontal.ANGLE:
        angle, bound = math.degrees(limits.angle), math.degrees(tilt_limit)
        _note(words, "tilt", math.hypot(x, y), 0.0, bound, "deg")
        x, y = limit_tilt(x, y, angle, bound)
    elif setpoint.horizontal is Horizontal.VELOCITY:
        x, y = _shorten(words, "horizontal velocity", x, y, limits.horizontal_velocity, "m/s")
    if setpoint.vertical is Vertical.VELOCITY:
        bound = limits.vertical_velocity
        z = _clamp(words, "vertical velocity", z, -bound, bound, "m/s")
    elif setpoint.vertical is Vertical.POSITION:
        z = _clamp(words, "height", z, 0.0, limits.height, "m")
    else:
        z = _clamp(words, "thrust", z, limits.thrust_min, limits.thrust_max, "percent")
    if setpoint.yaw_mode is Yaw.RATE:
        bound = math.degrees(limits.yaw_rate)
        yaw = _clamp(words, "yaw rate", yaw, -bound, bound, "deg/s")
    return setpoint._replace(x=x, y=y, z=z, yaw=yaw), ", ".join(words)


def _is_within(setpoint: Setpoint, limits: Limits, tilt_limit: float) -> bool:
    """Whether nothing is out of range."""
    horizontal, vertical, yaw_mode, _, _, x, y, z, yaw = setpoint
    if horizontal is Horizontal.ANGLE:
        if math.hypot(x, y) > math.degrees(tilt_limit) + ROUNDING:
            return False
    elif horizontal is Horizontal.VELOCITY:
        if math.hypot(x, y) > limits.horizontal_velocity + ROUNDING:
            return False
    if vertical is Vertical.THRUST:
        low, high = limits.thrust_min, limits.thrust_max
    elif vertical is Vertical.POSITION:
        low, high = 0.0, limits.height
    else:
        high = limits.vertical_velocity
        low = -high
    if not low - ROUNDING <= z <= high + ROUNDING:
        return False
    return yaw_mode is Yaw.ANGLE or abs(yaw) <= math.degrees(limits.yaw_rate) + ROUNDING


def _shorten(
    words: List[str], name: str, x: float, y: float, bound: float, unit: str
) -> Tuple[float, float]:
    _note(words, name, math.hypot(x, y), 0.0, bound, unit)
    return limit_norm(x, y, bound)


def _clamp(words: List[str], name: str, value: float, low: float, high: float, unit: str) -> float:
    _note(words, name, value, low, high, unit)
    return min(max(value, low), high)


def _note(words: List[str], name: str, value: float, low: float, high: float, unit: str) -> None:
    # A limit that was sent as a 32-bit float is not beyond it.
    if not low - ROUNDING <= value <= high + ROUNDING:
        words.append(f"{name} {value:.4g} {unit} is not in {low:.4g}..{high:.4g}")
