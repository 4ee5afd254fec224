# SPDX-License-Identifier: MIT
"""Angles and quaternions.

Scalar last (x, y, z, w), body FLU to world ENU, roll-pitch-yaw about x, y, z.
"""

import math
from typing import Sequence, Tuple


def wrap_angle(angle: float) -> float:
    """Return the angle [rad] in (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


def nearest_angle(angle: float, reference: float) -> float:
    """Return the angle [rad] plus the multiple of 2 pi that is nearest to the reference [rad]."""
    return reference + wrap_angle(angle - reference)


def rpy_from_quaternion(quaternion: Sequence[float]) -> Tuple[float, float, float]:
    """Return roll, pitch, yaw [rad] of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Tuple[float, float, float, float]:
    """Return the unit quaternion (x, y, z, w) of roll, pitch, yaw [rad]."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
