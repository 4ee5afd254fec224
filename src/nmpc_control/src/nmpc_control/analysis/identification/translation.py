# SPDX-License-Identifier: MIT
"""Equations of translation, averaged over short windows, linear in what is to be identified.

Over a window, the change of velocity is the integral of thrust along the body's z axis, of drag and
of gravity. Nothing is differentiated: the same mean is taken on both sides, so that a window costs
resolution in time but no bias, and dead times can be told finer than the samples. Velocity between
two samples is interpolated, which smooths it, and its model is smoothed alike: else thrust would
seem to have a lag of half the time between samples.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import List, Optional, Sequence

import numpy as np

from nmpc_control.analysis.identification.log import SILENCE
from nmpc_control.analysis.identification.passages import Stretch
from nmpc_control.analysis.identification.response import LONGEST_DEAD_TIME, lagged_mean
from nmpc_control.analysis.record import Series
from nmpc_control.analysis.windows import runs

WINDOW = 0.2  # [s]
_GRID = 0.01  # [s]
_STEP = 2  # points of the grid from one window to the next
_STEPS = int(round(WINDOW / _GRID))


@dataclass(frozen=True)
class Motion:
    """Motion of one stretch on a grid, and the windows over it."""

    grid: np.ndarray  # (m + 1,) [s]
    attitude: Series  # (k, 3) [rad] roll, pitch, yaw of the log
    velocity: np.ndarray  # (m + 1, 3) [m/s] world
    heading: np.ndarray  # (m + 1, 2) cosine and sine of yaw
    thrust: Series  # (c, 1) [percent] commanded
    number: int  # of the stretch
    sampled: np.ndarray  # (s,) [s] samples of the velocity, and both ends of the grid
    battery: Optional[Series] = None  # (n, 1) [percent]

    @cached_property
    def up(self) -> np.ndarray:
        """Body z axis (m, 3) in the world, mean in each interval of the grid."""
        return self.up_late(0.0)

    def up_late(self, lag: float) -> np.ndarray:
        """Return the same as it was a lag [s] before."""
        angles = self.attitude.at(self.grid - lag)
        return _body_z(0.5 * (angles[1:] + angles[:-1]))

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

    def percent(self, dead_time: float, lag: float = 0.0) -> np.ndarray:
        """Return the thrust (m,) [percent] a dead time [s] after its command, behind a lag [s]."""
        given = self.thrust
        return lagged_mean(given.times, given.values[:, 0], self.grid - dead_time, lag)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Return the means (w, ...) of values (m, ...) over each window, as velocity has them."""
        zero = np.zeros((1, *values.shape[1:]))
        total = np.concatenate([zero, np.cumsum(values, axis=0)])
        total = _between(self.grid, self.sampled, _between(self.sampled, self.grid, total))
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
    parts = [part for stretch in stretches for part in _known(stretch)]
    found = []
    for number, (log, begin, finish) in enumerate(parts):
        first, last = max(begin, start) + LONGEST_DEAD_TIME, min(finish, end)
        sampled = log.velocity.between(first, last).times
        if not len(sampled) or last - sampled[0] < 2.0 * WINDOW:
            continue
        thrust = Series(log.commands.times, log.commands.values[:, :1])
        given = thrust.between(begin, last)
        given.times[0] = begin  # the newest command before holds, and is of the same run
        first = sampled[0]
        grid = first + _GRID * np.arange(int((last - first) / _GRID) + 1)
        yaw = log.attitude.at(grid)[:, 2]
        heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        velocity = log.velocity.at(grid)
        attitude = log.attitude
        sampled = np.append(sampled[sampled < grid[-1]], grid[-1])
        found.append(Motion(grid, attitude, velocity, heading, given, number, sampled, log.battery))
    return found


def _known(stretch: Stretch) -> List[Stretch]:
    """Return the parts of a stretch with thrust commands and without gaps in the velocity."""
    log, begin, finish = stretch
    if log.velocity is None:
        return []
    sent = log.commands.times
    times = sent[(sent >= begin) & (sent <= finish)]
    thrust = log.commands.held_at(times)[:, 0]
    after = np.clip(np.searchsorted(log.velocity.times, times), 1, len(log.velocity) - 1)
    gap = log.velocity.times[after] - log.velocity.times[after - 1]
    inside = (times >= log.velocity.times[0]) & (times <= log.velocity.times[-1])
    is_known = np.isfinite(thrust) & (gap < SILENCE) & inside
    return [Stretch(log, *period) for period in runs(times, is_known)]


def _between(at: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (n, ...) at other times (k,) [s] than their own (n,), along straight lines."""
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = (at - times[index]) / (times[index + 1] - times[index])
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return values[index] + share * (values[index + 1] - values[index])


def _body_z(rpy: np.ndarray) -> np.ndarray:
    """Return the body's z axis (n, 3) in the world for roll, pitch, yaw (n, 3) [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy).T, np.sin(rpy).T
    return np.stack([cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp], axis=1)
