# SPDX-License-Identifier: MIT
"""Rate and jitter of a loop, from the times of its ticks on a steady clock."""

import math
from collections import deque
from typing import Deque, Optional

WINDOW = 250  # [1] periods that are looked at
ENOUGH = 50  # [1] of them before anything is said
LATE = 1.5  # [1] periods from which on a gap counts as late


class LoopWatch:
    """The last periods of a loop."""

    def __init__(self, rate: float) -> None:
        """Begin without a tick of a loop that should run at ``rate`` [Hz]."""
        self.period = 1.0 / rate
        self._gaps: Deque[float] = deque(maxlen=WINDOW)
        self._before: Optional[float] = None

    def tick(self, now: float) -> None:
        """Take the time [s] of a tick; one that is not after the last begins anew."""
        if self._before is not None and now > self._before:
            self._gaps.append(now - self._before)
        self._before = now

    @property
    def rate(self) -> float:
        """Mean rate [Hz]; NaN before there is one."""
        if len(self._gaps) < ENOUGH:
            return math.nan
        return len(self._gaps) / sum(self._gaps)

    @property
    def worst(self) -> float:
        """Longest gap [s] between two ticks."""
        return max(self._gaps, default=0.0)

    @property
    def jitter(self) -> float:
        """By how much [s] 1 in 100 periods was longer than it should be, at least."""
        gaps = sorted(self._gaps)
        return max(0.0, gaps[int(0.99 * (len(gaps) - 1))] - self.period) if gaps else 0.0

    @property
    def late(self) -> float:
        """Part [1] of the periods that were late."""
        return sum(gap > LATE * self.period for gap in self._gaps) / max(1, len(self._gaps))
