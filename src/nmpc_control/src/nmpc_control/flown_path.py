# SPDX-License-Identifier: MIT
"""The way that was flown, bounded in size however long the flight lasts."""

import math
from typing import List, Optional, Tuple

import numpy as np

_LATEST = 0.5  # [s] after which a position no longer shows where the aircraft was at a full period


class FlownPath:
    """Positions at least a spacing apart, and those at every few seconds of a clock.

    When either is full, every second entry goes, and the spacing or the period doubles.
    """

    def __init__(
        self, spacing: float = 0.05, capacity: int = 2000, period: float = 5.0, labels: int = 60
    ) -> None:
        self._first_spacing, self._capacity = spacing, capacity  # [m], [1]
        self._first_period, self._label_capacity = period, labels  # [s], [1]
        self.clear()

    def clear(self) -> None:
        """Forget everything, also the clock."""
        self._spacing = self._first_spacing
        self._points: List[np.ndarray] = []
        self._last: Optional[np.ndarray] = None
        self.start_clock(None)

    def start_clock(self, t: Optional[float], duration: float = math.inf) -> None:
        """Count the labels from a time [s] for a duration [s]; None: no labels."""
        self._clock_start, self._duration, self._period = t, duration, self._first_period
        self.labels: List[Tuple[float, np.ndarray]] = []  # ([s] on the clock, (3,) [m])

    def add(self, t: float, position: np.ndarray) -> None:
        """Take note of a position (3,) [m] at a time [s]."""
        self._last = position
        if not self._points or np.linalg.norm(position - self._points[-1]) >= self._spacing:
            self._points.append(position)
            if len(self._points) > self._capacity:
                self._points, self._spacing = self._points[::2], 2 * self._spacing
        if self._clock_start is not None and t >= self._clock_start:
            self._label(t - self._clock_start, position)

    @property
    def points(self) -> np.ndarray:
        """Positions (n, 3) [m], the newest last."""
        newest = [] if self._last is None else [self._last]
        return np.array(self._points + newest).reshape(-1, 3)

    def _label(self, elapsed: float, position: np.ndarray) -> None:
        due = elapsed // self._period * self._period
        is_new = not self.labels or due > self.labels[-1][0]
        if not is_new or elapsed - due > _LATEST or due > self._duration:
            return
        self.labels.append((due, position))
        if len(self.labels) > self._label_capacity:
            self._period *= 2
            self.labels = [label for label in self.labels if label[0] % self._period == 0.0]
