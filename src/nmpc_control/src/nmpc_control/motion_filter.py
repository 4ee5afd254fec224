# SPDX-License-Identifier: MIT
"""Velocity from positions: a Kalman filter of constant acceleration, the same on all three axes.

The acceleration is a random walk of density ``jerk``, positions have white noise ``sigma``; steps
follow the stamps, so drop-outs only cost certainty. A position far off what is expected counts only
as much as one at the edge of the likely (Huber's rule), as a marker that is taken for another.
"""

from typing import NamedTuple, Sequence

import numpy as np

LIKELY = 4.0  # [1] standard deviations
UNKNOWN_SPEED = 5.0  # [m/s] standard deviations at the beginning
UNKNOWN_ACCELERATION = 3.0  # [m/s^2]


class Motion(NamedTuple):
    """Where something is and how it moves, in the world frame."""

    position: np.ndarray  # (3,) [m]
    velocity: np.ndarray  # (3,) [m/s]
    acceleration: np.ndarray  # (3,) [m/s^2]

    def after(self, time: float) -> "Motion":
        """Return the motion a time [s] later, or earlier, at the same acceleration."""
        velocity = self.velocity + time * self.acceleration
        position = self.position + time * (self.velocity + 0.5 * time * self.acceleration)
        return Motion(position, velocity, self.acceleration)


class MotionFilter:
    """Position, velocity and acceleration (3, 3: one row each) and their common covariance."""

    def __init__(self, sigma: float, jerk: float) -> None:
        """Begin with nothing known; ``sigma`` [m], ``jerk`` [m/s^2.5]."""
        self._variance = sigma**2
        self._density = jerk**2
        self.t = -np.inf  # [s] of the last position
        self._state = np.zeros((3, 3))
        self._covariance = np.zeros((3, 3))

    @property
    def motion(self) -> Motion:
        """The motion at ``t``."""
        return Motion(*self._state.copy())

    @property
    def speed_sigma(self) -> float:
        """Standard deviation [m/s] of the velocity on an axis."""
        return float(np.sqrt(self._covariance[1, 1])) if np.isfinite(self.t) else np.inf

    def begin(self, t: float, position: Sequence[float]) -> None:
        """Start at a position (3,) [m] at ``t`` [s] with any velocity."""
        self.t = t
        self._state = np.array([position, np.zeros(3), np.zeros(3)], dtype=float)
        unknown = [self._variance, UNKNOWN_SPEED**2, UNKNOWN_ACCELERATION**2]
        self._covariance = np.diag(unknown)

    def move_to(self, position: Sequence[float]) -> None:
        """Take another place (3,) [m] for the present one; what is known of the motion stays."""
        self._state[0] = position

    def update(self, t: float, position: Sequence[float]) -> None:
        """Take a position (3,) [m] of ``t`` [s], later than all before."""
        dt, self.t = t - self.t, t
        f = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        self._state = f @ self._state
        self._covariance = f @ self._covariance @ f.T + self._density * _walk(dt)
        scatter = self._covariance[0, 0] + self._variance
        miss = np.asarray(position, dtype=float) - self._state[0]
        off = float(np.sqrt(miss @ miss / scatter))
        gain = self._covariance[:, 0] / scatter
        self._state += np.outer(gain, min(1.0, LIKELY / max(off, 1e-9)) * miss)
        self._covariance -= np.outer(gain, self._covariance[0])


def _walk(dt: float) -> np.ndarray:
    """Return the covariance (3, 3) that white jerk of density 1 adds in ``dt`` [s]."""
    a, b, c = dt**3 / 6.0, dt**4 / 8.0, dt**2 / 2.0
    return np.array([[dt**5 / 20.0, b, a], [b, dt**3 / 3.0, c], [a, c, dt]])
