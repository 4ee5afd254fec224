# SPDX-License-Identifier: MIT
"""How near a path in time comes to obstacles, all of them at once.

An obstacle is where it is expected at each time, and as much larger as its information is old now.
"""

import math
from typing import NamedTuple, Tuple

import numpy as np

from nmpc_control.obstacle_field import ObstacleField

SPACING = 0.05  # [m] of the points between two stages at which clearance is looked at
MAX_POINTS = 40  # [1] between two stages
MANY = 64  # [1] more obstacles are worth a first look by one sphere around the whole path


class Approach(NamedTuple):
    """How near a path comes to the n obstacles that matter on it, at M times."""

    obstacles: ObstacleField  # those n
    times: np.ndarray  # (M,) [s]
    clearance: np.ndarray  # (n, M) [m] hull to surface where it is expected then
    growth: np.ndarray  # (n,) [m] by which it may be larger, by the age of the information now
    points: np.ndarray  # (M, 3) [m] centres of the hull

    @property
    def ids(self) -> Tuple[str, ...]:
        """Their ids."""
        return self.obstacles.ids

    @property
    def grown(self) -> np.ndarray:
        """Clearance (n, M) [m] from the surfaces as far out as they may be."""
        return self.clearance - self.growth[:, None]

    def rest(self, start: float, t: float) -> "Approach":
        """Return what is left of the same path from ``start`` [s] on, looked at at ``t`` [s]."""
        growth = self.obstacles.growth(np.array([t]))[:, 0]
        k = int(np.searchsorted(self.times, start, side="right"))
        if k == 0:
            return self._replace(growth=growth)
        i, j = k - 1, min(k, len(self.times) - 1)
        span = self.times[j] - self.times[i]
        w = min(1.0, (start - self.times[i]) / span) if span > 0.0 else 0.0

        def cut(values: np.ndarray) -> np.ndarray:
            here = (1.0 - w) * values[..., i] + w * values[..., j]
            return np.concatenate([here[..., None], values[..., k:]], axis=-1)

        times, clearance, points = cut(self.times), cut(self.clearance), cut(self.points.T).T
        return Approach(self.obstacles, times, clearance, growth, points)


def approach(
    points: np.ndarray,
    times: np.ndarray,
    t: float,
    obstacles: ObstacleField,
    radius: float,
    reach: float,
) -> Approach:
    """Return how near a path comes to the obstacles that matter on it.

    These are all that it may pass at less than ``reach``, and the nearest one: spheres around all
    of them and the given points are looked at first, and only what these leave open point by point.

    Args:
        points: (K, 3) [m] centres of the hull; between them it flies straight.
        times: (K,) [s] of the points, not falling.
        t: [s] now, for the age of the information.
        obstacles: whose numbers are finite.
        radius: [m] of the hull.
        reach: [m] hull to surface.
    """
    if len(obstacles) > MANY:
        bounds = _bounds_as_one(points, times, t, obstacles, radius)
        obstacles = _narrowed(obstacles, bounds, reach)
    if len(obstacles) > 1:
        bounds = _bounds_by_points(points, times, t, obstacles, radius)
        obstacles = _narrowed(obstacles, bounds, reach)
    return _refined(points, times, t, obstacles, radius)


def is_clear_of(
    points: np.ndarray,
    times: np.ndarray,
    t: float,
    obstacles: ObstacleField,
    radius: float,
    reach: float,
) -> bool:
    """Return whether a first look shows already that a path stays ``reach`` from all of them.

    Arguments as of ``approach``; False says nothing.
    """
    if not len(obstacles):
        return True
    least = _bounds_as_one(points, times, t, obstacles, radius).least
    return not obstacles.has_path.any() and bool((least >= reach).all())


class _Bounds(NamedTuple):
    """Between what the least clearance from each of n obstacles on a path must be."""

    least: np.ndarray  # (n,) [m] as large as it may be by the end of the path
    most: np.ndarray  # (n,) [m] as large as it may be now


def _narrowed(obstacles: ObstacleField, bounds: _Bounds, reach: float) -> ObstacleField:
    """Return those that matter."""
    # what follows a path of its own may leave the straight line that the bound takes
    keep = (bounds.least < max(reach, float(bounds.most.min()))) | obstacles.has_path
    if keep.all():
        return obstacles
    keep[int(np.argmin(bounds.most))] = True
    return obstacles.part(np.nonzero(keep)[0])


def _bounds_as_one(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField, radius: float
) -> _Bounds:
    """Return the bounds that one sphere around the whole path gives."""
    middle = len(times) // 2
    ends = obstacles.centres(times[[0, middle, -1]])
    travel = _lengths(ends - ends[:, 1:2]).max(axis=1)
    extent = float(_lengths(points - points[middle]).max())
    distance = _lengths(ends[:, 1] - points[middle]) - radius
    return _bounds(distance - extent - travel, distance, times[-1], t, obstacles)


def _bounds_by_points(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField, radius: float
) -> _Bounds:
    """Return the bounds that spheres around them and each point give."""
    relative = points - obstacles.centres(times)
    chord = _lengths(np.diff(relative, axis=1)).max(axis=1, initial=0.0)
    distance = _lengths(relative).min(axis=1) - radius
    return _bounds(distance - chord / 2, distance, times[-1], t, obstacles)


def _bounds(
    least: np.ndarray, most: np.ndarray, end: float, t: float, obstacles: ObstacleField
) -> _Bounds:
    """Return the bounds, given those for the distances (n,) [m] of the hull from the centres."""
    now, later = obstacles.growth(np.array([t, end])).T
    return _Bounds(least - obstacles.bounding - later, most - obstacles.inscribed - now)


def _refined(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField, radius: float
) -> Approach:
    """Return the approach to all of the obstacles, at points at most ``SPACING`` apart."""
    chords = _lengths(np.diff(points - obstacles.centres(times), axis=1))
    count = math.ceil(min(max(1.0, float(chords.max(initial=0.0)) / SPACING), MAX_POINTS))
    stages = np.arange(len(times))
    fine = np.linspace(0, len(times) - 1, count * (len(times) - 1) + 1)
    fine_times = np.interp(fine, stages, times)
    fine_points = np.stack([np.interp(fine, stages, points[:, i]) for i in range(3)], axis=1)
    clearance = obstacles.surface_distances(fine_points, fine_times) - radius
    growth = obstacles.growth(np.array([t]))[:, 0]
    return Approach(obstacles, fine_times, clearance, growth, fine_points)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
