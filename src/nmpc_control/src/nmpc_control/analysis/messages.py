# SPDX-License-Identifier: MIT
"""From decoded messages to rows of numbers, or to small objects where a row does not fit."""

import math
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from nmpc_control.state import Obstacle

_MOST_OBSTACLES = 256  # in one message
_MOST_POINTS = 200_000  # of one trajectory
_LONGEST_TEXT = 64  # characters
_SHAPES = (
    ("sphere", 1),
    ("cylinder", 2),
    ("box", 3),
)  # in the order of nmpc_msgs/Obstacle: name, sizes

# Columns of rows that more than one reader needs
POSITION, QUATERNION, VELOCITY = slice(0, 3), slice(3, 7), slice(7, 10)  # odometry
IMU_QUATERNION, IMU_RATES, IMU_ACCELERATION = slice(0, 4), slice(4, 7), slice(7, 10)


class Trajectory(NamedTuple):
    """A reference as it was published."""

    name: str
    times: np.ndarray  # (m,) [s] from its start
    positions: np.ndarray  # (m, 3) [m]


def text(value: str) -> str:
    """Return a bag's string without control characters, shortened."""
    return "".join(c for c in value if c.isprintable())[:_LONGEST_TEXT]


def _xyz(vector: Any) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _xyzw(quaternion: Any) -> Tuple[float, float, float, float]:
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w


def _odometry(message: Any) -> Sequence[float]:
    pose, twist = message.pose.pose, message.twist.twist
    return _xyz(pose.position) + _xyzw(pose.orientation) + _xyz(twist.linear)


def _imu(message: Any) -> Sequence[float]:
    return (
        _xyzw(message.orientation)
        + _xyz(message.angular_velocity)
        + _xyz(message.linear_acceleration)
    )


def _setpoint(message: Any) -> Sequence[float]:
    """Return thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN if the flag says other."""
    return _flagged(message, int(message.axes[4]))


def _flagged(message: Any, flag: int) -> Sequence[float]:
    """Return the same of axes whose meaning a control byte gives.

    Angles in the ground frame tilt towards north and east: they are no roll and pitch.
    """
    x, y, z, yaw = (float(axis) for axis in message.axes[:4])
    if not all(map(math.isfinite, (x, y, z, yaw))):
        raise ValueError("a setpoint that is not finite")
    is_body_angle = flag & 0xC0 == 0x00 and flag & 0x06 == 0x02
    is_thrust, is_rate = flag & 0x30 == 0x20, bool(flag & 0x08)
    return (
        z if is_thrust else math.nan,
        x if is_body_angle else math.nan,
        y if is_body_angle else math.nan,
        yaw if is_rate else math.nan,
    )


ROWS: Dict[str, Tuple[int, Callable[[Any], Sequence[float]]]] = {
    "odometry": (10, _odometry),
    "truth": (10, _odometry),
    "reference": (3, lambda m: _xyz(m.pose.position)),
    "status": (3, lambda m: (m.mode, m.plans_rejected, m.deadline_misses)),
    "plan": (3, lambda m: (m.iterations, m.solve_time, m.found)),
    "setpoint": (4, _setpoint),
    "height_setpoint": (4, lambda m: _flagged(m, 0x1B)),
    "velocity_setpoint": (4, lambda m: _flagged(m, 0x49)),
    "position_setpoint": (4, lambda m: _flagged(m, 0x91)),
    "mav_command": (4, lambda m: (m.thrust.z, m.roll, m.pitch, m.yaw_rate)),
    "attitude": (4, lambda m: _xyzw(m.quaternion)),
    "imu": (10, _imu),
    "velocity": (3, lambda m: _xyz(m.vector)),
    "local_position": (3, lambda m: _xyz(m.point)),
    "flight_status": (1, lambda m: (m.data,)),
    "rc": (6, lambda m: [m.axes[i] for i in range(6)]),
    "battery": (1, lambda m: (m.percentage,)),
}
SETPOINTS = ("setpoint", "height_setpoint", "velocity_setpoint", "position_setpoint")
NAN_MEANS_ABSENT = SETPOINTS  # roles whose rows may hold NaN


def _trajectory(message: Any) -> Trajectory:
    points = [p for p in message.points if len(p.transforms)]
    if not 0 < len(points) <= _MOST_POINTS:
        raise ValueError(f"{len(points)} points")
    times = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])
    positions = np.array([_xyz(p.transforms[0].translation) for p in points])
    if not (np.isfinite(positions).all() and (times >= 0.0).all()):
        raise ValueError("points that are not finite")
    return Trajectory(text(message.joint_names[0]) if message.joint_names else "", times, positions)


def _obstacles(message: Any) -> List[Obstacle]:
    if len(message.obstacles) > _MOST_OBSTACLES:
        raise ValueError(f"{len(message.obstacles)} obstacles")
    return [_obstacle(o) for o in message.obstacles]


def _obstacle(message: Any) -> Obstacle:
    shape, count = _SHAPES[message.shape]
    size = np.array(message.size[:count], dtype=float)
    position, velocity = np.array(_xyz(message.position)), np.array(_xyz(message.velocity))
    if (
        len(size) != count
        or not np.isfinite([*size, *position, *velocity]).all()
        or (size < 0.0).any()
    ):
        raise ValueError("an obstacle that is not finite")
    return Obstacle(text(message.id), position, size, shape, velocity)


EVENTS: Dict[str, Callable[[Any], Any]] = {
    "trajectory": _trajectory,
    "obstacles": _obstacles,
    "sensed_obstacles": _obstacles,
    "collision": lambda m: text(m.data),
}
