# SPDX-License-Identifier: MIT
"""The kinds of ``reference:`` in a scenario file, each a dataclass that builds its trajectory.

The field names are the YAML keys; all lengths in [m], points in the world frame (ENU).
"""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Dict, Optional

import numpy as np

from nmpc_control import trajectory
from nmpc_control.bspline import BSpline
from nmpc_control.config import from_dict, number
from nmpc_control.curves import CurveError
from nmpc_control.errors import ConfigError
from nmpc_control.trajectory import TIMINGS, Trajectory, Yaw

_REACH = 1e4  # [m] no reference goes farther from the origin


@dataclass(frozen=True)
class Pace:
    """How fast: exactly one of the two is given."""

    speed: Optional[float]  # [m/s] mean
    duration: Optional[float]  # [s]

    def seconds(self) -> float:
        """Return the duration [s] of a reference that has no length to be flown at a speed."""
        if self.duration is None:
            raise CurveError("speed", self.speed, "a duration instead: this reference has no speed")
        return self.duration


def _point() -> np.ndarray:
    return field(metadata={"length": 3, "min": -_REACH, "max": _REACH})


def _length() -> float:
    return field(metadata={"min": 1e-3, "max": _REACH})


def _timing() -> str:
    return field(default="uniform", metadata={"choices": TIMINGS})


@dataclass(frozen=True)
class Hold:
    """Stay at a point."""

    position: np.ndarray = _point()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        return trajectory.hold(self.position, pace.seconds(), yaw)


@dataclass(frozen=True)
class Line:
    """Straight, at constant speed."""

    start: np.ndarray = _point()
    end: np.ndarray = _point()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        return trajectory.line(self.start, self.end, pace.speed, pace.duration, yaw)


@dataclass(frozen=True)
class Step:
    """Stay at a point, and from a moment on at another."""

    start: np.ndarray = _point()
    end: np.ndarray = _point()
    time: float = field(metadata={"min": 0.0})  # [s]

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        if self.time >= pace.seconds():
            raise CurveError("time", self.time, f"less than the duration, {pace.duration:g} s")
        return trajectory.step(self.start, self.end, self.time, pace.seconds(), yaw)


@dataclass(frozen=True)
class Circle:
    """Level circle, counter-clockwise; negative turns: clockwise."""

    center: np.ndarray = _point()
    radius: float = _length()
    turns: float = field(default=1.0, metadata={"min": -100.0, "max": 100.0})
    start_angle: float = 0.0  # [rad] of the first point, seen from the center

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        return trajectory.circle(
            self.center, self.radius, pace.speed, pace.duration, self.turns, self.start_angle, yaw
        )


@dataclass(frozen=True)
class Sinusoidal:
    """One period of ``center + (width sin a, width sin a cos a, height cos a)``."""

    center: np.ndarray = _point()
    width: float = _length()
    height: float = field(metadata={"min": 0.0, "max": _REACH})
    timing: str = _timing()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        return trajectory.sinusoidal(
            self.center, self.width, self.height, pace.speed, pace.duration, self.timing, yaw
        )


@dataclass(frozen=True)
class Polygon:
    """Level regular polygon, closed, counter-clockwise from the corner in +x of its center."""

    center: np.ndarray = _point()
    corners: int = field(metadata={"min": 3, "max": 100})
    side: float = _length()
    timing: str = _timing()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        angles = 2 * math.pi * np.arange(self.corners) / self.corners
        radius = self.side / (2 * math.sin(math.pi / self.corners))
        level = np.stack([np.cos(angles), np.sin(angles), np.zeros(self.corners)], axis=1)
        return trajectory.polyline(
            self.center + radius * level, pace.speed, pace.duration, self.timing, yaw, closed=True
        )


@dataclass(frozen=True)
class Polyline:
    """Straight lines from point to point."""

    points: Any
    closed: bool = False
    timing: str = _timing()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        _refuse_yaw_list(yaw, self.closed)
        points = _points(self.points)
        return trajectory.polyline(points, pace.speed, pace.duration, self.timing, yaw, self.closed)


@dataclass(frozen=True)
class Waypoints:
    """B-spline through the points, along them (they are its control points), or fitted to them."""

    points: Any
    method: str = field(
        default="interpolate", metadata={"choices": ("interpolate", "approximate", "fit")}
    )
    degree: Optional[int] = field(default=None, metadata={"min": 1, "max": 9})  # 3 if points allow
    knots: Any = "uniform"
    ends: Optional[str] = None  # interpolate: not_a_knot (default) or natural
    closed: bool = False
    control_points: Optional[int] = field(default=None, metadata={"min": 2})  # fit: their number
    timing: str = _timing()

    def build(self, pace: Pace, yaw: Yaw) -> Trajectory:
        """Return the trajectory."""
        _refuse_yaw_list(yaw, self.closed)
        points = _points(self.points)
        n = self.control_points or len(points)
        degree = self.degree or (3 if self.ends == "natural" else min(3, n - 1))
        options: Dict[str, Any] = {"degree": degree, "knots": self.knots}
        if self.ends is not None:
            options["ends"] = self._only("interpolate", "ends")
        if self.control_points is not None:
            options["control_points"] = self._only("fit", "control_points")
        elif self.method == "fit":
            raise CurveError("control_points", None, "their number (the key is missing)")
        if self.closed:
            if self.method == "fit":
                raise CurveError("closed", True, "false where the method is fit")
            options["closed"] = True
        method = {
            "interpolate": BSpline.interpolate,
            "approximate": BSpline.approximate,
            "fit": BSpline.fit,
        }[self.method]
        return trajectory.waypoints(
            points,
            pace.speed,
            pace.duration,
            self.timing,
            yaw,
            partial(method, **options),
        )

    def _only(self, method: str, key: str) -> Any:
        value = getattr(self, key)
        if self.method != method:
            raise CurveError(key, value, f"this key only where the method is {method}")
        return value


TYPES = {
    "hold": Hold,
    "line": Line,
    "step": Step,
    "circle": Circle,
    "sinusoidal": Sinusoidal,
    "polygon": Polygon,
    "polyline": Polyline,
    "waypoints": Waypoints,
}

_SCENARIO_KEYS = ("speed", "duration", "yaw")  # of curve errors that do not lie in the reference


def build_trajectory(data: Any, pace: Pace, yaw: Any, source: str) -> Trajectory:
    """Return the trajectory of a ``reference:`` mapping.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if not isinstance(data, dict):
        raise ConfigError(source, "reference", data, "a mapping with a type and its keys")
    options = dict(data)
    kind = options.pop("type", None)
    if not isinstance(kind, str) or kind not in TYPES:
        raise ConfigError(source, "reference.type", kind, f"one of {', '.join(TYPES)}")
    reference = from_dict(TYPES[kind], options, source, "reference")
    yaw = _checked_yaw(yaw, kind, source)
    try:
        return reference.build(pace, yaw)
    except CurveError as error:
        key = error.argument if error.argument in _SCENARIO_KEYS else f"reference.{error.argument}"
        raise ConfigError(source, key, error.value, error.expected) from None


def _checked_yaw(yaw: Any, kind: str, source: str) -> Any:
    if yaw == trajectory.TANGENT:
        return yaw
    if isinstance(yaw, list):
        if kind not in ("waypoints", "polyline"):
            raise ConfigError(
                source, "yaw", yaw, f"a number [rad] or {trajectory.TANGENT} for type {kind}"
            )
        return [number(value, source, f"yaw[{i}]", -100.0, 100.0) for i, value in enumerate(yaw)]
    if isinstance(yaw, str):
        raise ConfigError(
            source, "yaw", yaw, f"a number [rad], {trajectory.TANGENT}, or one number per waypoint"
        )
    return number(yaw, source, "yaw", -100.0, 100.0)


def _refuse_yaw_list(yaw: Any, closed: bool) -> None:
    if closed and isinstance(yaw, list):
        raise CurveError(
            "yaw", yaw, f"a number [rad] or {trajectory.TANGENT} where the curve is closed"
        )


def _points(rows: Any) -> np.ndarray:
    if not isinstance(rows, list) or len(rows) < 2:
        raise CurveError("points", rows, "a list of two points or more, each [x, y, z] in metres")
    for i, row in enumerate(rows):
        good = isinstance(row, list) and len(row) == 3
        if not good or not all(_is_coordinate(value) for value in row):
            raise CurveError(
                f"points[{i}]", row, f"[x, y, z], three numbers in [{-_REACH:g}, {_REACH:g}]"
            )
    return np.array(rows, float)


def _is_coordinate(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= _REACH
