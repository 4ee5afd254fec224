# SPDX-License-Identifier: MIT
"""Equations of translation, averaged over short windows, linear in what is to be identified.

Over a window, the change of velocity is the integral of thrust along the body's z axis, of drag and
of gravity. Nothing is differentiated: the same mean is taken on both sides, so that a window costs
resolution in time but no bias, and dead times can be told finer than the samples.
"""

from dataclasses import dataclass
from typing import List, Optional, Sequence

import numpy as np

from nmpc_control.analysis.identification.passages import Stretch
from nmpc_control.analysis.identification.response import LONGEST_DEAD_TIME, held_mean
from nmpc_control.analysis.record import Series

WINDOW = 0.2  # [s]
_GRID = 0.01  # [s]
_STEP = 2  # points of the grid from one window to the next
_STEPS = int(round(WINDOW / _GRID))


@dataclass(frozen=True)
class Motion:
    """Motion of one stretch on a grid, and the windows over it."""

    grid: np.ndarray  # (m + 1,) [s]
    up: np.ndarray  # (m, 3) body z axis in the world, mean in each interval
    velocity: np.ndarray  # (m + 1, 3) [m/s] world
    heading: np.ndarray  # (m + 1, 2) cosine and sine of yaw
    thrust: Series  # (c, 1) [percent] commanded
    number: int  # of the stretch
    battery: Optional[Series] = None  # (n, 1) [percent]

    @property
    def times(self) -> np.ndarray:
        """Start (w,) [s] of each window."""
        return self.grid[:-_STEPS:_STEP]

    @property
    def acceleration(self) -> np.ndarray:
        """Mean acceleration (w, 3) [m/s^2] in each window."""
        return ((self.velocity[_STEPS:] - self.velocity[:-_STEPS]) / WINDOW)[::_STEP]

    @property
    def speed(self) -> np.ndarray:
        """Velocity (m, 3) [m/s], mean in each interval of the grid."""
        return 0.5 * (self.velocity[1:] + self.velocity[:-1])

    def percent(self, dead_time: float) -> np.ndarray:
        """Return the thrust (m,) [percent] in effect a dead time [s] after its command."""
        return held_mean(self.thrust.times, self.thrust.values, self.grid - dead_time)[:, 0]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the means (w, ...) of values (m, ...) over each window."""
        zero = np.zeros((1, *values.shape[1:]))
        total = np.concatenate([zero, np.cumsum(values, axis=0)])
        return ((total[_STEPS:] - total[:-_STEPS]) / _STEPS)[::_STEP]

    @property
    def level(self) -> np.ndarray:
        """State of charge (w,) [percent] at each window; NaN where it is not known."""
        if self.battery is None:
            return np.full(len(self.times), np.nan)
        return self.battery.held_at(self.times)[:, 0]

    def blocks(self, length: float) -> np.ndarray:
        """Return the number (w,) of the block of a length [s] that each window is in."""
        return self.number * 10**6 + (self.times / length).astype(int)


def motions(stretches: Sequence[Stretch], start: float, end: float) -> List[Motion]:
    """Return the motion of stretches between two times [s], where thrust was commanded."""
    found = []
    for number, (log, begin, finish) in enumerate(stretches):
        first, last = max(begin, start) + LONGEST_DEAD_TIME, min(finish, end)
        thrust = Series(log.commands.times, log.commands.values[:, :1])
        given = thrust.between(begin - LONGEST_DEAD_TIME, last)
        is_given = len(given) and np.isfinite(given.values).all()
        if log.velocity is None or not is_given or last - first < 2.0 * WINDOW:
            continue
        if given.times[0] > begin:  # held from before it is known, as for attitude
            given.times[0] = begin - LONGEST_DEAD_TIME
        grid = first + _GRID * np.arange(int((last - first) / _GRID) + 1)
        angles = log.attitude.at(grid)
        up = _body_z(0.5 * (angles[1:] + angles[:-1]))
        heading = np.stack([np.cos(angles[:, 2]), np.sin(angles[:, 2])], axis=1)
        velocity = log.velocity.at(grid)
        found.append(Motion(grid, up, velocity, heading, given, number, log.battery))
    return found


def _body_z(rpy: np.ndarray) -> np.ndarray:
    """Return the body's z axis (n, 3) in the world for roll, pitch, yaw (n, 3) [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy).T, np.sin(rpy).T
    return np.stack([cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp], axis=1)
