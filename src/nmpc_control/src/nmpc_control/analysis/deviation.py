# SPDX-License-Identifier: MIT
"""Distance between the flown path and the reference, and the moment of arrival."""

from typing import Optional

import numpy as np
from scipy.spatial import cKDTree

from nmpc_control.analysis.record import Reference, Series

ARRIVAL_DISTANCE = 0.3  # [m] from the end of the reference
ARRIVAL_SPEED = 0.2  # [m/s]
_BLOCK = 500_000  # point-segment pairs that are held in memory at a time
_MOST_PAIRS = 5_000_000  # that are all looked at; beyond it samples of the curve stand for it
_SPACING = 0.005  # [m] of these samples
_MOST_SAMPLES = 2_000_000


def errors(position: Series, reference: Reference, start: float, end: float) -> Series:
    """Return position minus the reference at the same time (n, 3) [m], from start to end [s].

    A stamp that comes again counts once.
    """
    flown = position.between(start, end)
    again = np.diff(flown.times, prepend=-np.inf) <= 0.0
    if again.any():
        flown = Series(flown.times[~again], flown.values[~again])
    return Series(flown.times, flown.values - reference.position_at(flown.times))


def path_deviation(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Return the distance [m] of points (n, 3) to the nearest point of a polyline (m, 3)."""
    if len(curve) < 2:
        return np.linalg.norm(points - curve[0], axis=1)
    if len(points) * len(curve) > _MOST_PAIRS:
        return _deviation_by_tree(points, curve)
    starts, steps = curve[:-1], np.diff(curve, axis=0)
    nearest = np.empty(len(points), dtype=int)
    block = max(1, _BLOCK // len(steps))
    for first in range(0, len(points), block):
        part = slice(first, first + block)
        nearest[part] = _nearest_segments(points[part], starts, steps)
    offsets, steps = points - starts[nearest], steps[nearest]
    along = np.clip(np.einsum("ij,ij->i", offsets, steps) / _squared(steps), 0.0, 1.0)
    return np.linalg.norm(offsets - along[:, None] * steps, axis=1)


def _deviation_by_tree(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Return the distance [m] to the samples of the polyline that lie at most ``_SPACING`` apart.

    It exceeds the distance to the polyline itself by less than half of the spacing, far from the
    path by its square over eight times the distance.
    """
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))))
    count = min(_MOST_SAMPLES, int(length[-1] / _SPACING) + 2)
    along = np.linspace(0.0, length[-1], count)
    samples = np.stack([np.interp(along, length, column) for column in curve.T], axis=1)
    return cKDTree(samples).query(points)[0]


def _nearest_segments(points: np.ndarray, starts: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the index (n,) of the segment nearest to each point, by matrix products alone."""
    centre = starts.mean(axis=0)
    points, starts = points - centre, starts - centre
    projection = points @ steps.T - np.einsum("ij,ij->i", starts, steps)
    along = np.clip(projection / _squared(steps), 0.0, 1.0)
    distance = np.einsum("ij,ij->i", starts, starts) - 2.0 * points @ starts.T
    distance += along * (along * _squared(steps) - 2.0 * projection)
    return distance.argmin(axis=1)


def _squared(steps: np.ndarray) -> np.ndarray:
    return np.maximum(np.einsum("ij,ij->i", steps, steps), np.finfo(float).tiny)


def arrival_time(
    position: Series, velocity: Series, reference: Reference, end: float
) -> Optional[float]:
    """Return when the aircraft came to the end of the reference, closer and slower than the limits.

    A closed path begins where it ends, so arrival counts only once the reference itself has come
    to its end for good; for one that never leaves it (hover) that is when its time is over.

    Args:
        position: Estimate (n, 3) [m].
        velocity: Estimate (n, 3) [m/s].
        reference: What was to be flown.
        end: Last moment [s] that counts.

    Returns:
        Time [s] on the flight's clock, or None.
    """
    goal = reference.path.values[-1]
    away = np.linalg.norm(reference.path.values - goal, axis=1) >= ARRIVAL_DISTANCE
    last_away = np.flatnonzero(away)
    earliest = reference.path.times[last_away[-1]] if len(last_away) else reference.duration
    flown = position.between(reference.start + earliest, end)
    near = np.linalg.norm(flown.values - goal, axis=1) < ARRIVAL_DISTANCE
    slow = np.linalg.norm(velocity.at(flown.times), axis=1) < ARRIVAL_SPEED
    arrived = np.flatnonzero(near & slow)
    return float(flown.times[arrived[0]]) if len(arrived) else None
