# SPDX-License-Identifier: MIT
"""One tracked cylinder: a Kalman filter of constant velocity, its radius, and its life."""

import math
from collections import deque
from typing import Deque, Optional, Tuple

import numpy as np

from nmpc_control.laser_tracking.detection import Detection
from nmpc_control.laser_tracking.parameters import TrackParameters

_RADIUS_WALK = 0.02**2  # [m^2/s] so that a radius learned wrongly is unlearned
_RADIUS_FLOOR = 0.02**2  # [m^2] of a measured radius: edges are seen in steps of beams
_WALL_SHARE = 0.1  # [1] weight of one scan in whether it is a wall


class Track:
    """State x, y [m], vx, vy [m/s] at time ``t`` [s]; only methods change it."""

    def __init__(self, t: float, found: Detection, parameters: TrackParameters) -> None:
        self._parameters = p = parameters
        self.t = t  # [s]
        self.number: Optional[int] = None  # from confirmation on
        self.x = np.array([*found.centre, 0.0, 0.0])
        self.P = np.zeros((4, 4))
        self.P[:2, :2] = found.covariance
        self.P[2:, 2:] = p.velocity_sigma**2 * np.eye(2)
        self.radius, self.radius_variance = found.radius, found.radius_variance
        self.heights = found.heights  # [m] between which it was seen
        self.wall = 1.0 if found.is_wall else 0.0  # [1] share of scans that show a wall
        self.is_moving = False
        self.hit_time = t  # [s]
        self.hit_sigma = self.position_sigma  # [m] when last seen
        self.seen_through = 0.0  # [s] in a row in which it should have been seen and was not
        self._pending = 0.0  # [s] for which the other of moving and standing has held
        self._hits: Deque[bool] = deque([True], maxlen=p.confirm_scans)

    @property
    def is_wall(self) -> bool:
        """Whether it is a piece of wall, which stands by definition."""
        return self.wall > 0.5

    @property
    def position_sigma(self) -> float:
        """Greatest sigma of the position [m] over all directions."""
        return math.sqrt(_greatest(self.P[:2, :2]))

    @property
    def velocity_sigma(self) -> float:
        """Greatest sigma of the velocity [m/s] over all directions."""
        return math.sqrt(_greatest(self.P[2:, 2:]))

    @property
    def reported_radius(self) -> float:
        """Radius [m], larger by what the position has become less certain since it was seen."""
        return self.radius + max(0.0, self.position_sigma - self.hit_sigma)

    @property
    def reported_velocity(self) -> np.ndarray:
        """Velocity (2,) [m/s]: zero unless it moves."""
        return self.x[2:] if self.is_moving else np.zeros(2)

    @property
    def growth(self) -> float:
        """Growth of the radius [m/s] that the sigma of its velocity asks for."""
        p = self._parameters
        if self.is_wall:
            return 0.0
        rest = 0.0 if self.is_moving else float(np.hypot(*self.x[2:]))
        return min(p.growth_sigmas * self.velocity_sigma + rest, p.max_growth)

    def predict(self, t: float) -> None:
        """Go on to time ``t`` [s]."""
        dt = t - self.t
        F, Q = np.eye(4), np.zeros((4, 4))
        F[0, 2] = F[1, 3] = dt
        q = self._parameters.acceleration
        Q[0, 0] = Q[1, 1] = q * dt**3 / 3.0
        Q[0, 2] = Q[2, 0] = Q[1, 3] = Q[3, 1] = q * dt**2 / 2.0
        Q[2, 2] = Q[3, 3] = q * dt
        if self.is_wall:
            self.x[2:] = 0.0
            self.P[:2, 2:] = self.P[2:, :2] = 0.0
            self.P[2:, 2:] = 0.01**2 * np.eye(2)
        self.x, self.P, self.t = F @ self.x, F @ self.P @ F.T + Q, t
        self.radius_variance += _RADIUS_WALK * dt

    def innovation(self, found: Detection) -> Tuple[np.ndarray, np.ndarray]:
        """Return how far (2,) [m] a detection is off, and the covariance (2, 2) of that."""
        H = _measurement(found.lag)
        return found.centre - H @ self.x, H @ self.P @ H.T + found.covariance

    def update(self, found: Detection, dt: float) -> None:
        """Take a detection of the scan at ``t``, ``dt`` [s] after the scan before."""
        H = _measurement(found.lag)
        innovation, S = self.innovation(found)
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ innovation
        I_KH = np.eye(4) - K @ H
        self.P = I_KH @ self.P @ I_KH.T + K @ found.covariance @ K.T  # Joseph's form stays positive
        noise = found.radius_variance + _RADIUS_FLOOR
        gain = self.radius_variance / (self.radius_variance + noise)
        self.radius += gain * (found.radius - self.radius)
        self.radius_variance *= 1.0 - gain
        self.heights = (
            min(self.heights[0], found.heights[0]),
            max(self.heights[1], found.heights[1]),
        )
        self.wall += _WALL_SHARE * (float(found.is_wall) - self.wall)
        self.hit_time, self.hit_sigma, self.seen_through = self.t, self.position_sigma, 0.0
        self._hits.append(True)
        self._judge_motion(dt)

    def miss(self, dt: float, is_clear: bool) -> None:
        """Note a scan without it; ``is_clear``: the beams went through where it should be."""
        self._hits.append(False)
        if is_clear:
            self.seen_through += dt

    @property
    def deserves_number(self) -> bool:
        """Whether enough of the last scans showed it, and its velocity is known well enough."""
        p = self._parameters
        is_known = self.is_wall or self.velocity_sigma <= p.confirm_velocity_sigma
        return is_known and sum(self._hits) >= p.confirm_hits

    @property
    def is_over(self) -> bool:
        """Whether it is gone, or has been hidden for too long."""
        p = self._parameters
        if self.seen_through > p.missed_time:
            return True
        if self.number is None:
            few = len(self._hits) == p.confirm_scans and sum(self._hits) < p.confirm_hits
            return few or list(self._hits)[-3:] == [False] * 3
        return self.t - self.hit_time > p.coast_time or self.position_sigma > p.coast_sigma

    def _judge_motion(self, dt: float) -> None:
        p = self._parameters
        speed = float(np.hypot(*self.x[2:]))
        if self.is_wall:
            self.is_moving, self._pending = False, 0.0
            return
        if self.is_moving:
            wants, needed = speed < p.static_speed, p.static_time
        else:
            significance = self.x[2:] @ np.linalg.solve(self.P[2:, 2:], self.x[2:])
            wants = speed > p.moving_speed and significance > p.gate
            needed = p.moving_time
        self._pending = self._pending + dt if wants else 0.0
        if self._pending > needed:
            self.is_moving, self._pending = not self.is_moving, 0.0


def _measurement(lag: float) -> np.ndarray:
    """Return H (2, 4) of a centre seen ``lag`` [s] after the time of the state."""
    return np.array([[1.0, 0.0, lag, 0.0], [0.0, 1.0, 0.0, lag]])


def _greatest(covariance: np.ndarray) -> float:
    """Return the greatest eigenvalue of a symmetric matrix (2, 2)."""
    (a, b), (_, d) = covariance
    return 0.5 * (a + d) + math.hypot(0.5 * (a - d), b)
