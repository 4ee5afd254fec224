# SPDX-License-Identifier: MIT
"""Times without samples, also those before the first and after the last one."""

import numpy as np

LONGEST_GAP = 0.5  # [s] between positions; over longer ones nothing is known


def stream_gaps(times: np.ndarray, start: float, end: float) -> np.ndarray:
    """Return the times [s] between messages from start to end [s].

    The time from the start to the first message and from the last one to the end counts where it
    is longer than all others: a stream that stops has a gap. Otherwise it is a part of a period.
    """
    every = _steps(times, start, end)
    inner, edges = every[1:-1], every[[0, -1]] if len(every) > 1 else every
    return np.concatenate((inner, edges[edges > inner.max(initial=0.0)]))


def uncovered(times: np.ndarray, start: float, end: float) -> float:
    """Return the time [s] from start to end in gaps longer than ``LONGEST_GAP``."""
    steps = _steps(times, start, end)
    return float(steps[steps > LONGEST_GAP].sum())


def distance_to_sample(times: np.ndarray, t: float) -> float:
    """Return the time [s] from a moment [s] to the nearest of the samples."""
    return float(np.abs(times - t).min(initial=np.inf))


def _steps(times: np.ndarray, start: float, end: float) -> np.ndarray:
    inside = np.sort(times[(times >= start) & (times <= end)])
    return np.diff(np.concatenate(([start], inside, [end])))
