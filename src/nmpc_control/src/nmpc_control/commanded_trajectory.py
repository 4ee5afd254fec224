# SPDX-License-Identifier: MIT
"""A trajectory that somebody commands point by point: joined, and refused where it cannot be flown.

Points are met at their times. Without velocities they are joined by cubic splines whose
acceleration is continuous, with them by cubics that also meet the velocities (Hermite). It begins
and ends at rest: its start is flown to first, its end is held.
"""

import math
from typing import List, Optional, Tuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from nmpc_control.errors import NmpcError
from nmpc_control.heading import Heading, LinearHeading
from nmpc_control.params import Limits
from nmpc_control.state import GRAVITY
from nmpc_control.timing import Uniform
from nmpc_control.trajectory import Trajectory

MOST_POINTS = 5000
LEAST_STEP = 0.01  # [s] between two points
LONGEST = 3600.0  # [s]
REST = 0.05  # [m/s] that still counts as at rest, at both ends
_SAMPLE_PERIOD = 0.02  # [s] between two looks
_MOST_SAMPLES = 20000
_SLACK = 1.0 + 1e-6


class CommandError(NmpcError):
    """A command that is not followed; the text says why."""


class _Splined:
    """Splines over time as a curve over s in [0, 1]."""

    def __init__(self, spline: CubicSpline, times: np.ndarray) -> None:
        self._spline, self._duration = spline, times[-1]
        self.breaks = times / times[-1]

    def __call__(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        t = np.atleast_1d(s) * self._duration
        return self._spline(t, derivative) * self._duration**derivative


class _SplinedHeading:
    """The same of yaw."""

    def __init__(self, curve: _Splined) -> None:
        self._curve = curve

    def __call__(self, s: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        return self._curve(s), self._curve(s, 1)


def commanded_trajectory(
    times: np.ndarray,
    positions: np.ndarray,
    yaws: Optional[np.ndarray],
    velocities: Optional[np.ndarray],
    present_yaw: float,
    limits: Limits,
) -> Trajectory:
    """Return the trajectory through points.

    Args:
        times: (n,) [s] increasing, of the trajectory's clock; it begins with the first.
        positions: (n, 3) [m] in the world frame.
        yaws: (n,) [rad]; None: the present one throughout.
        velocities: (n, 3) [m/s]; None: whatever makes it smooth.
        present_yaw: [rad] of the aircraft.
        limits: of the controller; what lies beyond them is refused.

    Raises:
        CommandError: naming the point or the moment, its value and what was expected.
    """
    _check_points(times, positions, yaws, velocities)
    times = times - times[0]
    if velocities is None:
        spline = CubicSpline(times, positions, bc_type="clamped")
    else:
        spline = CubicHermiteSpline(times, positions, velocities)
    heading: Heading = LinearHeading(present_yaw, present_yaw)
    if yaws is not None:
        turn = CubicSpline(times, np.unwrap(yaws), bc_type="clamped")
        heading = _SplinedHeading(_Splined(turn, times))
    trajectory = Trajectory(_Splined(spline, times), Uniform(float(times[-1])), heading)
    _check_flight(trajectory, limits)
    return trajectory


def _check_points(
    times: np.ndarray,
    positions: np.ndarray,
    yaws: Optional[np.ndarray],
    velocities: Optional[np.ndarray],
) -> None:
    if not 2 <= len(times) <= MOST_POINTS:
        raise CommandError(f"got {len(times)} points, expected 2 to {MOST_POINTS}")
    for name, values in (("position", positions), ("velocity", velocities), ("yaw", yaws)):
        if values is None:
            continue
        bad = np.flatnonzero(~np.isfinite(values).reshape(len(times), -1).all(axis=1))
        if len(bad):
            raise CommandError(f"point {bad[0] + 1}: its {name} is not finite")
    if not np.all(np.isfinite(times)) or times[0] < 0.0:
        raise CommandError("times from the start must be finite, and none negative")
    close = np.flatnonzero(np.diff(times) < LEAST_STEP)
    if len(close):
        raise CommandError(
            f"point {close[0] + 2}: at {times[close[0] + 1]:g} s, expected {LEAST_STEP:g} s or "
            "more after the one before"
        )
    if times[-1] - times[0] > LONGEST:
        raise CommandError(f"it takes {times[-1] - times[0]:g} s, at most {LONGEST:g} are taken")
    if velocities is not None:
        for index, word in ((0, "begin"), (len(times) - 1, "end")):
            speed = float(np.linalg.norm(velocities[index]))
            if speed > REST:
                raise CommandError(f"point {index + 1}: {speed:.2f} m/s, it must {word} at rest")


def _check_flight(trajectory: Trajectory, limits: Limits) -> None:
    """Raise CommandError at the first moment that cannot be flown, or is beyond the fence."""
    count = min(_MOST_SAMPLES, math.ceil(trajectory.duration / _SAMPLE_PERIOD) + 1)
    t = np.linspace(0.0, trajectory.duration, max(count, 2))
    sample = trajectory.sample(t)
    low, high = limits.fence_min, limits.fence_max
    outside = np.any((sample.position < low) | (sample.position > high), axis=1)
    speed = np.linalg.norm(sample.velocity, axis=1)
    push = sample.acceleration + np.array([0.0, 0.0, GRAVITY])  # what the thrust has to give
    thrust = np.linalg.norm(push, axis=1)
    tilt = np.arctan2(np.hypot(push[:, 0], push[:, 1]), push[:, 2])
    most_tilt = float(np.min(np.abs([limits.input_min[1:3], limits.input_max[1:3]])))
    most_turn = float(min(-limits.input_min[3], limits.input_max[3]))
    turn = np.abs(sample.yaw_rate)
    findings: List[Tuple[np.ndarray, str, np.ndarray, str]] = [
        (outside, "the place is outside of the fence", sample.position, f"{low} to {high} m"),
        (speed > limits.speed * _SLACK, "speed [m/s]", speed, f"{limits.speed:g} at most"),
        (tilt > most_tilt * _SLACK, "tilt [rad]", tilt, f"{most_tilt:.3g} at most"),
        (
            thrust > limits.input_max[0],
            "thrust [m/s^2]",
            thrust,
            f"{limits.input_max[0]:g} at most",
        ),
        (
            thrust < limits.input_min[0],
            "thrust [m/s^2]",
            thrust,
            f"{limits.input_min[0]:g} at least",
        ),
        (turn > most_turn * _SLACK, "yaw rate [rad/s]", turn, f"{most_turn:.3g} at most"),
    ]
    for is_bad, what, values, expected in findings:
        if is_bad.any():
            first = int(np.argmax(is_bad))
            value = np.array2string(np.asarray(values[first]), precision=2, suppress_small=True)
            raise CommandError(f"at {t[first]:.2f} s: {what}: got {value}, expected {expected}")
