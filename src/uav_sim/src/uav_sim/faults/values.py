# SPDX-License-Identifier: MIT
"""Packets' values made wrong: every number changed, or the whole displaced."""

import dataclasses
import math
from typing import Any, Callable, Tuple

from uav_sim.plant import Vector
from uav_sim.preset import GeoPoint
from uav_sim.telemetry import EARTH_RADIUS, quaternion

BYTES = ("gps_health", "flight_status")  # topics of whole numbers
_BYTE = 255


def map_numbers(value: Any, change: Callable[[float], float]) -> Any:
    """Return a packet's value with every number changed."""
    if isinstance(value, (int, float)):
        return change(value)
    if isinstance(value, tuple):
        parts = [map_numbers(part, change) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    parts = {f.name: map_numbers(getattr(value, f.name), change) for f in dataclasses.fields(value)}
    return dataclasses.replace(value, **parts)


def shifted(topic: str, value: Any, offset: Vector) -> Any:
    """Return a packet's value displaced by an offset (3,) in the topic's own unit.

    Attitudes turn by roll, pitch, yaw [rad] about world axes; ``imu`` changes its body rates
    [rad/s], ``gps_position`` moves by metres east, north, up; a scalar takes the first number,
    ``rc`` adds to its first three axes.
    """
    if topic == "attitude":
        return _product(quaternion(*offset), value)
    if topic == "imu":
        return value._replace(angular_velocity=_sum(value.angular_velocity, offset))
    if isinstance(value, GeoPoint):
        circle = EARTH_RADIUS * math.cos(math.radians(value.latitude))
        return GeoPoint(
            value.latitude + math.degrees(offset[1] / EARTH_RADIUS),
            value.longitude + math.degrees(offset[0] / circle),
            value.altitude + offset[2],
        )
    if topic in BYTES:
        return min(max(value + round(offset[0]), 0), _BYTE)
    if isinstance(value, tuple):
        return _sum(value[:3], offset) + tuple(value[3:])
    return value + offset[0]


def _sum(a: Tuple[float, ...], b: Tuple[float, ...]) -> Tuple[float, ...]:
    return tuple(x + y for x, y in zip(a, b))


def _product(p: Tuple[float, ...], q: Tuple[float, ...]) -> Tuple[float, ...]:
    """Return the Hamilton product of two quaternions x, y, z, w."""
    (px, py, pz, pw), (qx, qy, qz, qw) = p, q
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )
