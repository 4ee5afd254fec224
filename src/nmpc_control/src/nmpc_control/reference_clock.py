# SPDX-License-Identifier: MIT
"""The clock of a reference: it waits where the aircraft is held up, and catches up afterwards."""

import numpy as np

from nmpc_control.params import Flight
from nmpc_control.trajectory import Trajectory

_LOOK_BACK = 4.0  # [s] along the reference where the aircraft is looked for
_SAMPLES = 41
_LEAST_LAG = 0.5  # [m] of lag never makes a clock wait
_LEAD = 0.1  # [s] ahead of an aircraft that was held up
_SETS_OFF = 2.0  # [s] in which it gathers speed


class ReferenceClock:
    """How far along a trajectory the reference is.

    It runs with time while the aircraft follows. From a lag of ``wait_lag`` on it slows down and at
    twice that it stands; once the aircraft is near again it runs faster by the part ``catch_up``
    until it is where it would have been. What lies ahead is always taken to be flown at full pace,
    so that a way round shows its worth.
    """

    def __init__(self, trajectory: Trajectory, t: float, flight: Flight) -> None:
        """Begin at time ``t`` [s]."""
        self.start = t
        self.time = 0.0  # [s] of the trajectory
        self.rate = 1.0  # [1]
        self._trajectory, self._flight = trajectory, flight
        self._t = t
        self._near_until = -np.inf  # [s]

    @property
    def waits(self) -> bool:
        """Whether it stands."""
        return self.rate < 0.05

    @property
    def duration(self) -> float:
        """Time [s] that the trajectory takes."""
        return self._trajectory.duration

    @property
    def over(self) -> float:
        """For how long [s] the trajectory's time has been over; negative before."""
        return self.time - self._trajectory.duration

    def resume(self, t: float) -> None:
        """Go on at ``t`` [s] where it was read last."""
        self._t, self.rate = t, 0.0

    def go_on(self, t: float, time: float) -> None:
        """Read ``time`` [s] at ``t`` [s] and run from there."""
        self._t, self.time = t, time

    def release(self, t: float) -> None:
        """Stay near the aircraft from ``t`` [s] on until it has gathered speed.

        It was held up and is let go: what is late is caught up by ``catch_up``, not by a sprint.
        """
        self._near_until = t + _SETS_OFF

    def read(self, times: np.ndarray) -> np.ndarray:
        """Return the trajectory's times [s] at times (M,) [s]."""
        return self.time + max(1.0, self.rate) * (times - self._t)

    def advance(self, t: float, position: np.ndarray) -> None:
        """Move on to time ``t`` [s] with the aircraft at a position (3,) [m]."""
        self.time += self.rate * max(0.0, t - self._t)
        self._t = t
        near = t < self._near_until
        lag = self._lag(position, 0.0 if near else _LEAST_LAG)
        wait = self._flight.wait_lag
        if near:
            self.time = min(self.time, self.duration) - max(0.0, lag - _LEAD)
            self.rate = 1.0
        elif self.over >= 0.0:
            self.rate = 1.0
        elif lag > wait:
            self.rate = max(0.0, 2.0 - lag / wait)
        elif lag < wait / 2.0 and self.time < t - self.start:
            self.rate = 1.0 + self._flight.catch_up
        else:
            self.rate = 1.0

    def _lag(self, position: np.ndarray, least: float) -> float:
        """Return how long ago [s] the reference was where the aircraft is nearest to it.

        None, where that is no longer a way than ``least`` [m].
        """
        if not self._trajectory.timing.continuous:
            return 0.0
        now = min(self.time, self._trajectory.duration)
        ago = np.linspace(0.0, min(_LOOK_BACK, now), _SAMPLES)
        points = self._trajectory.positions(now - ago)
        away = np.linalg.norm(points - position, axis=1)
        nearest = int(np.argmin(away))
        way = float(np.linalg.norm(np.diff(points[: nearest + 1], axis=0), axis=1).sum())
        return float(ago[nearest]) if way > least else 0.0
