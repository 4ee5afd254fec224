# SPDX-License-Identifier: MIT
"""From decoded messages to rows of numbers, or to small objects where a row does not fit."""

from functools import lru_cache
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle

_MOST_OBSTACLES = 256  # in one message
_MOST_POINTS = 200_000  # of one trajectory
_LONGEST_TEXT = 64  # characters
_LONGEST_PARAMETERS = 100_000  # characters
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


class Goal(NamedTuple):
    """A goal of the action ``fly_trajectory``, or how it ended."""

    id: str
    text: str  # name of the scenario, or the result in words


class LogLine(NamedTuple):
    """A line of ``/rosout``."""

    level: int  # 1 debug, 2 info, 4 warning, 8 error, 16 fatal
    node: str
    text: str


def text(value: str, longest: int = _LONGEST_TEXT) -> str:
    """Return a bag's string without control characters, shortened."""
    return "".join(c for c in value[:longest] if c.isprintable())


def _xyz(vector: Any) -> Tuple[Any, Any, Any]:
    return vector.x, vector.y, vector.z


def _xyzw(quaternion: Any) -> Tuple[Any, Any, Any, Any]:
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w


def _odometry(message: Any) -> Sequence[np.ndarray]:
    pose, twist = message.pose.pose, message.twist.twist
    return _xyz(pose.position) + _xyzw(pose.orientation) + _xyz(twist.linear)


def _imu(message: Any) -> Sequence[np.ndarray]:
    return (
        _xyzw(message.orientation)
        + _xyz(message.angular_velocity)
        + _xyz(message.linear_acceleration)
    )


def _setpoint(message: Any) -> Sequence[np.ndarray]:
    """Return thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN if the flag says other."""
    return _flagged(message, np.nan_to_num(message.axes[4]).astype(int))


def _flagged(message: Any, flag: Any) -> Sequence[np.ndarray]:
    """Return the same of axes whose meaning a control byte gives.

    Angles in the ground frame tilt towards north and east: they are no roll and pitch. What is
    not finite is infinite here: NaN means that it is not commanded.
    """
    axes = np.array([message.axes[i] for i in range(4)], dtype=float)
    x, y, z, yaw = np.where(np.isfinite(axes).all(axis=0), axes, np.inf)
    flag = np.asarray(flag) & 0xFF
    is_body_angle = (flag & 0xC0 == 0x00) & (flag & 0x06 == 0x02)
    is_thrust, is_rate = flag & 0x30 == 0x20, flag & 0x08 != 0
    bad = np.isinf(x)
    return (
        np.where(is_thrust | bad, z, np.nan),
        np.where(is_body_angle | bad, x, np.nan),
        np.where(is_body_angle | bad, y, np.nan),
        np.where(is_rate | bad, yaw, np.nan),
    )


# Columns, and what fills them from messages that came together: each field is an array (n,)
ROWS: Dict[str, Tuple[int, Callable[[Any], Sequence[np.ndarray]]]] = {
    "odometry": (10, _odometry),
    "truth": (10, _odometry),
    "reference": (3, lambda m: _xyz(m.pose.position)),
    "status": (
        5,
        lambda m: (m.mode, m.plans_rejected, m.deadline_misses, m.rung, m.authority),
    ),
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
    "world_position": (3, lambda m: _xyz(m.point)),
    "paper_reference": (3, lambda m: _xyz(m.point)),
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
    size = tuple(float(length) for length in message.size[:3])
    return _shared_obstacle(
        text(message.id), message.shape, size, _xyz(message.position), _xyz(message.velocity)
    )


@lru_cache(maxsize=4 * _MOST_OBSTACLES)  # what stands still comes again in every message
def _shared_obstacle(
    name: str,
    kind: int,
    lengths: Tuple[float, ...],
    centre: Tuple[float, ...],
    speed: Tuple[float, ...],
) -> Obstacle:
    shape, count = _SHAPES[kind]
    size = np.array(lengths[:count], dtype=float)
    position, velocity = np.array(centre), np.array(speed)
    if (
        len(size) != count
        or not np.isfinite([*size, *position, *velocity]).all()
        or (size < 0.0).any()
    ):
        raise ValueError("an obstacle that is not finite")
    return Obstacle(name, position, size, shape, velocity)


EVENTS: Dict[str, Callable[[Any], Any]] = {
    "trajectory": _trajectory,
    "obstacles": _obstacles,
    "sensed_obstacles": _obstacles,
    "collision": lambda m: text(m.data),
    "goal": lambda m: Goal(text(m.goal_id.id), text(m.goal.scenario)),
    "result": lambda m: Goal(text(m.status.goal_id.id), text(m.result.message)),
    "parameters": lambda m: m.data[:_LONGEST_PARAMETERS],
    "tf": lambda m: [
        (text(t.header.frame_id), text(t.child_frame_id), _xyz(t.transform.translation))
        for t in m.transforms[:_MOST_OBSTACLES]
    ],
    "log": lambda m: LogLine(int(m.level), text(m.name), text(m.msg, 300)),
}
