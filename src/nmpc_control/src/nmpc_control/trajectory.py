# SPDX-License-Identifier: MIT
"""References in time: a curve, its timing and its yaw, sampled with velocity and acceleration.

All positions in the world frame (ENU) [m], yaw [rad]. A trajectory is flown either in a
``duration`` [s] or at a mean ``speed`` [m/s], that is ``duration = length / speed``, with the
timing ``uniform`` (curve parameter uniform in time, the paper's) or ``arc_length`` (constant
speed).
"""

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Callable, Optional, Sequence, Union

import numpy as np

from nmpc_control.bspline import BSpline
from nmpc_control.curves import ArcLength, Curve, CurveError, Segment, lemniscate
from nmpc_control.curves import circle as circle_curve
from nmpc_control.heading import Heading, LinearHeading, SplineHeading, TangentHeading
from nmpc_control.rotations import nearest_angle
from nmpc_control.timing import ConstantSpeed, Jump, RestToRest, Timing, Uniform

TIMINGS = ("uniform", "arc_length")
TANGENT = "tangent"

Yaw = Union[float, str, Heading]  # constant [rad], "tangent", or a function of the curve parameter


@dataclass(frozen=True)
class TrajectorySample:
    """The reference at M times."""

    position: np.ndarray  # (M, 3) [m]
    velocity: np.ndarray  # (M, 3) [m/s]
    acceleration: np.ndarray  # (M, 3) [m/s^2]
    yaw: np.ndarray  # (M,) [rad], not wrapped
    yaw_rate: np.ndarray  # (M,) [rad/s]


@dataclass(frozen=True)
class Trajectory:
    """A curve, where to be on it at what time, and the yaw along it."""

    curve: Curve
    timing: Timing
    heading: Heading

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.timing.duration

    @cached_property
    def length(self) -> float:
        """Length of the curve [m]."""
        return ArcLength(self.curve).total

    @cached_property
    def start(self) -> np.ndarray:
        """First point (3,) [m]."""
        return self.sample(0.0).position[0]

    @cached_property
    def end(self) -> np.ndarray:
        """Last point (3,) [m]."""
        return self.sample(self.duration).position[0]

    def positions(self, times: np.ndarray) -> np.ndarray:
        """Return the points (M, 3) [m] of ``sample`` at times (M,) [s], and nothing else."""
        return self.curve(self.timing(np.clip(times, 0.0, self.duration))[0])

    def sample(self, times: Union[float, np.ndarray]) -> TrajectorySample:
        """Return the reference at times (M,) [s]; before 0 and from the duration on it rests."""
        times = np.atleast_1d(np.asarray(times, float))
        s, rate, rate_change = self.timing(np.clip(times, 0.0, self.duration))
        moving = (times >= 0.0) & (times < self.duration)
        rate, rate_change = rate * moving, rate_change * moving
        tangent, bend = self.curve(s, 1), self.curve(s, 2)
        yaw, yaw_slope = self.heading(s)
        return TrajectorySample(
            position=self.curve(s),
            velocity=tangent * rate[:, None],
            acceleration=bend * rate[:, None] ** 2 + tangent * rate_change[:, None],
            yaw=yaw,
            yaw_rate=yaw_slope * rate,
        )


def along(
    curve: Curve,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    timing: str = "uniform",
    yaw: Yaw = 0.0,
) -> Trajectory:
    """Return the flight along a curve at a mean speed, or in a duration.

    Raises:
        CurveError: not exactly one of speed and duration, one that is not positive, a curve
            without length, an unknown timing or yaw.
    """
    if (speed is None) == (duration is None):
        raise CurveError("speed", speed, f"a speed or a duration, not both (duration {duration!r})")
    length = ArcLength(curve).total
    if not length > 0.0:
        raise CurveError("length", length, "a way longer than 0 m")
    duration = (
        _positive(duration, "duration") if speed is None else length / _positive(speed, "speed")
    )
    if timing not in TIMINGS:
        raise CurveError("timing", timing, " or ".join(TIMINGS))
    clock = Uniform(duration) if timing == "uniform" else ConstantSpeed(curve, duration)
    return Trajectory(curve, clock, _heading(yaw, curve))


def hold(position: np.ndarray, duration: float, yaw: float = 0.0) -> Trajectory:
    """Return staying at a point (3,) [m]."""
    curve = Segment(_point(position), _point(position))
    return Trajectory(curve, Uniform(_positive(duration, "duration")), _heading(yaw, curve))


def line(
    start: np.ndarray,
    end: np.ndarray,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    yaw: Yaw = 0.0,
) -> Trajectory:
    """Return a straight line at constant speed."""
    return along(Segment(_point(start), _point(end)), speed, duration, yaw=yaw)


def waypoints(
    points: np.ndarray,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    timing: str = "uniform",
    yaw: Union[Yaw, Sequence[float]] = 0.0,
    spline: Optional[Callable[[np.ndarray], BSpline]] = None,
) -> Trajectory:
    """Return a flight along the B-spline of points (n, 3) [m].

    Args:
        points: (n, 3) waypoints, or control points where the spline approximates.
        speed: mean speed [m/s], or None.
        duration: [s], or None.
        timing: ``uniform`` or ``arc_length``.
        yaw: constant [rad], ``tangent``, or one yaw per point, joined by the same spline on the
            shorter way round.
        spline: what makes a curve of points, like ``partial(BSpline.approximate, degree=2)``; by
            default the interpolating one of degree 3, or less with fewer than four points.

    Raises:
        CurveError: naming what does not fit.
    """
    points = np.array(points, float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
        raise CurveError("points", points.tolist(), "two points or more, each with three numbers")
    if spline is None:
        spline = partial(BSpline.interpolate, degree=min(3, max(1, len(points) - 1)))
    if isinstance(yaw, (list, tuple, np.ndarray)):
        if np.shape(yaw) != (len(points),):
            raise CurveError("yaw", yaw, f"one number per point, {len(points)}")
        joined = spline(np.column_stack([points, np.unwrap(yaw)]))
        return along(
            joined.columns(0, 3), speed, duration, timing, SplineHeading(joined.columns(3, 4))
        )
    return along(spline(points), speed, duration, timing, yaw)


def polyline(
    points: np.ndarray,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    timing: str = "uniform",
    yaw: Union[Yaw, Sequence[float]] = 0.0,
    closed: bool = False,
) -> Trajectory:
    """Return straight lines from point to point (n, 3): a B-spline of degree 1."""
    spline = partial(BSpline.interpolate, degree=1, closed=closed)
    return waypoints(points, speed, duration, timing, yaw, spline)


def circle(
    center: np.ndarray,
    radius: float,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    turns: float = 1.0,
    start_angle: float = 0.0,
    yaw: Yaw = 0.0,
) -> Trajectory:
    """Return a level circle, counter-clockwise from an angle [rad]; negative turns: clockwise."""
    curve = circle_curve(_point(center), _positive(radius, "radius"), start_angle, turns)
    return along(curve, speed, duration, yaw=yaw)


def sinusoidal(
    center: np.ndarray,
    width: float,
    height: float,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    timing: str = "uniform",
    yaw: Yaw = 0.0,
) -> Trajectory:
    """Return one period of ``center + (width sin a, width sin a cos a, height cos a)`` [m]."""
    return along(
        lemniscate(_point(center), _positive(width, "width"), height), speed, duration, timing, yaw
    )


def step(
    start: np.ndarray, end: np.ndarray, time: float, duration: float, yaw: float = 0.0
) -> Trajectory:
    """Return staying at a point until a time [s], and at another from then on."""
    curve = Segment(_point(start), _point(end))
    return Trajectory(curve, Jump(time, _positive(duration, "duration")), _heading(yaw, curve))


def approach(
    start: np.ndarray,
    end: np.ndarray,
    speed: float,
    acceleration: float,
    start_yaw: float = 0.0,
    end_yaw: float = 0.0,
    yaw_rate: float = 0.5,
) -> Trajectory:
    """Return a straight line from rest to rest, trapezoidal in speed, turning the shorter way.

    Args:
        start: (3,) [m].
        end: (3,) [m].
        speed: most speed [m/s].
        acceleration: its rate of change [m/s^2].
        start_yaw: [rad].
        end_yaw: [rad].
        yaw_rate: most yaw rate [rad/s], reached in one second at the soonest.
    """
    curve = Segment(_point(start), _point(end))
    heading = LinearHeading(start_yaw, nearest_angle(end_yaw, start_yaw))
    rates, accelerations = [], []
    for way, fastest, hardest in (
        (float(np.linalg.norm(curve.end - curve.start)), speed, acceleration),
        (abs(heading.end - heading.start), yaw_rate, yaw_rate),
    ):
        if way > 0.0:
            rates.append(_positive(fastest, "speed") / way)
            accelerations.append(_positive(hardest, "acceleration") / way)
    timing = RestToRest(min(rates), min(accelerations)) if rates else Jump(0.0, 0.0)
    return Trajectory(curve, timing, heading)


def _heading(yaw: Yaw, curve: Curve) -> Heading:
    if isinstance(yaw, str):
        if yaw != TANGENT:
            raise CurveError(
                "yaw", yaw, f"a number [rad], {TANGENT}, or a list with one number per waypoint"
            )
        return TangentHeading(curve)
    if callable(yaw):
        return yaw
    if not math.isfinite(yaw):
        raise CurveError("yaw", yaw, "a finite number [rad]")
    return LinearHeading(yaw, yaw)


def _point(point: np.ndarray) -> np.ndarray:
    array = np.array(point, float)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise CurveError("position", array.tolist(), "three finite numbers [m]")
    return array


def _positive(value: float, argument: str) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise CurveError(argument, value, "a positive number")
    return float(value)
