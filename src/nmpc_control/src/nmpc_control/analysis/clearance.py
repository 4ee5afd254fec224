# SPDX-License-Identifier: MIT
"""Distance between a flown path and the obstacles, between the samples too, and what was hit."""

import math
from typing import List, Optional, Sequence

import numpy as np

from nmpc_control.analysis.gaps import LONGEST_GAP, uncovered
from nmpc_control.analysis.record import FlightRecord, Metrics, ObstacleTrack, Series
from nmpc_control.analysis.windows import Window

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_BISECTIONS = 60  # shrink a segment by 0.618 each, to 3e-13 of its length


def clearance(position: Series, track: ObstacleTrack, radius: float) -> Optional[float]:
    """Return the least distance [m] from a hull to an obstacle's surface, negative where it hit.

    Aircraft and obstacle move straight between two samples, so in the obstacle's frame the
    aircraft does too. The signed distance to a convex shape is convex along a line: a
    golden-section search finds its minimum.

    Args:
        position: Centre of the aircraft (n, 3) [m].
        track: The obstacle.
        radius: Radius of the aircraft's hull [m].

    Returns:
        The distance, or None where the two were never there at the same time.
    """
    position = position.between(track.begin, track.end)
    if not len(position):
        return None
    obstacle = track.obstacle
    points = position.values - track.centre_at(position.times) + obstacle.position
    at_samples = obstacle.distance(points)
    least = float(at_samples.min())
    starts, steps = points[:-1], np.diff(points, axis=0)
    # Distance changes no faster than the path is long: only these segments can come closer.
    bound = (at_samples[:-1] + at_samples[1:] - np.linalg.norm(steps, axis=1)) / 2.0
    starts, steps = starts[bound < least], steps[bound < least]
    if len(starts):
        low, high = np.zeros(len(starts)), np.ones(len(starts))
        for _ in range(_BISECTIONS):
            left = high - _GOLDEN * (high - low)
            right = low + _GOLDEN * (high - low)
            is_left = obstacle.distance(starts + left[:, None] * steps) < obstacle.distance(
                starts + right[:, None] * steps
            )
            low, high = np.where(is_left, low, left), np.where(is_left, right, high)
        middle = (low + high) / 2.0
        least = min(least, float(obstacle.distance(starts + middle[:, None] * steps).min()))
    return least - radius


def clearance_figures(
    record: FlightRecord, window: Optional[Window], radius: float, missing: List[str]
) -> Metrics:
    """Return clearance to each obstacle in the window, and collisions in the whole flight."""
    figures: Metrics = {
        "clearance_m": None,
        "clearance_by": None,
        "collisions": record.reported_collisions,
    }
    position = record.true_position if record.true_position is not None else record.position
    if record.obstacles is None:
        missing.append("no list of obstacles: no clearance")
        return figures
    if position is None or window is None or not len(position):
        missing.append("no positions: no clearance")
        return figures
    flown = position.between(window.start, window.end)
    lost = uncovered(flown.times, window.start, window.end)
    if len(flown) > 1 and np.diff(flown.times).max() > LONGEST_GAP:
        lost -= uncovered(flown.times, flown.times[0], flown.times[-1])
        gap = np.diff(flown.times).max()
        missing.append(
            f"positions are missing for up to {gap:.1f} s: clearance there is along a straight line"
        )
    if lost > 0.0:
        missing.append(
            f"positions are missing for {lost:.1f} s before the first or after the last: "
            "no clearance there"
        )
    _say_unobserved(record.obstacles, window, missing)
    figures["clearance_m"] = {t.obstacle.id: clearance(flown, t, radius) for t in record.obstacles}
    figures["clearance_by"] = "truth" if record.true_position is not None else "estimate"
    if record.true_position is None:
        missing.append("no ground truth: clearance is by the estimate, collisions are not judged")
        return figures
    first, last = record.automatic or (-math.inf, math.inf)
    whole = position.between(first, last)
    touched = sum(_is_touched(whole, track, radius) for track in record.obstacles)
    figures["collisions"] = max(touched, record.reported_collisions or 0)
    return figures


def _say_unobserved(tracks: Sequence[ObstacleTrack], window: Window, missing: List[str]) -> None:
    """Name the moving obstacles that were guessed rather than observed for a part of the window."""
    lost = {}
    for track in tracks:
        start, end = max(window.start, track.begin), min(window.end, track.end)
        if track.observed is not None and start < end:
            lost[track.obstacle.id] = uncovered(track.observed, start, end)
    names = ", ".join(name for name, seconds in lost.items() if seconds > 0.0)
    if names:
        missing.append(
            f"moving obstacles ({names}) were not observed for up to {max(lost.values()):.1f} s: "
            "clearance there is to where their velocity takes them"
        )


def _is_touched(position: Series, track: ObstacleTrack, radius: float) -> bool:
    least = clearance(position, track, radius)
    return least is not None and least < 0.0
