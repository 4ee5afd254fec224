# SPDX-License-Identifier: MIT
"""How old what was heard is, on a steady clock: a step of the host's clock makes nothing stale."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Deque, Dict

RECEIPTS = 3  # [1] of which the least lag counts: one that a step of the clock fell into does not


@dataclass
class _Source:
    stamp: float
    heard: float  # [s] steady clock
    lags: Deque[float] = field(default_factory=lambda: deque(maxlen=RECEIPTS))


class Liveness:
    """Remembers when each source was heard last, and how late its stamps were then."""

    def __init__(self) -> None:
        self._sources: Dict[str, _Source] = {}

    def age(self, name: str, stamp: float, t: float, now: float) -> float:
        """Return the age [s] of a source's newest sample; call it at least in every tick.

        Args:
            name: of the source.
            stamp: [s] of its newest sample, on the clock that stamps; not finite: none.
            t: [s] now on that clock.
            now: [s] now on a steady clock.
        """
        if not math.isfinite(stamp):
            self._sources.pop(name, None)
            return math.inf
        source = self._sources.get(name)
        if source is None:
            source = self._sources[name] = _Source(math.nan, now)
        if stamp != source.stamp:
            source.stamp, source.heard = stamp, now
            source.lags.append(max(0.0, t - stamp))
        return now - source.heard + min(source.lags)
