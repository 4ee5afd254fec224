# SPDX-License-Identifier: MIT
"""Latency that varies, and loss, on top of the dead times of the preset.

Interface: ``Link(parameters, rng)``; ``arrival(t)`` returns when something due at ``t`` [s]
arrives, or None if it is lost. Without ``reorder`` arrivals increase by ``spacing`` at least, as
bytes on a serial line do. ``Channel`` holds what is on its way through a link.
"""

from collections import deque
from dataclasses import dataclass, field
from random import Random
from typing import Any, Deque, List, Mapping, Optional, Tuple


@dataclass(frozen=True)
class LinkParameters:
    """One way of the link, or one topic on it."""

    delay: float = field(metadata={"min": 0.0})  # [s] in addition to the preset's
    jitter: float = field(metadata={"min": 0.0})  # [s] uniform between 0 and this, in addition
    loss: float = field(metadata={"min": 0.0, "max": 1.0})  # [1] share that never arrives
    spacing: float = field(metadata={"min": 0.0})  # [s] least time between two arrivals
    reorder: bool = field()  # later ones may overtake

    @property
    def is_perfect(self) -> bool:
        """Whether it changes nothing."""
        return self.delay == 0.0 and self.jitter == 0.0 and self.loss == 0.0


class Link:
    """Draws the arrival of one after the other."""

    def __init__(self, parameters: LinkParameters, rng: Random) -> None:
        self.parameters = parameters
        self._rng = rng
        self._last = float("-inf")

    def arrival(self, t: float) -> Optional[float]:
        """Return when something that is due at ``t`` [s] arrives; None: it does not."""
        p = self.parameters
        if p.loss > 0.0 and self._rng.random() < p.loss:
            return None
        t += p.delay + p.jitter * self._rng.random()
        if not p.reorder:
            t = max(t, self._last + p.spacing)
            self._last = t
        return t


class TelemetryLink:
    """Links of whole packets and, after these, of single topics."""

    def __init__(
        self, packets: LinkParameters, topics: Mapping[str, LinkParameters], seed: str
    ) -> None:
        self._packets = Link(packets, Random(seed))
        self._topics = {name: Link(p, Random(f"{seed}/{name}")) for name, p in topics.items()}

    def arrivals(self, t: float, values: List[Tuple[str, Any]]) -> List[Tuple[float, str, Any]]:
        """Return arrival [s], topic and value of those parts of the packet due at ``t`` that come.

        Args:
            t: when the packet is due [s].
            values: topics and values in DJI's order.
        """
        whole = self._packets.arrival(t)
        if whole is None:
            return []
        if not self._topics:
            return [(whole, topic, value) for topic, value in values]
        result = []
        for topic, value in values:
            link = self._topics.get(topic)
            when = link.arrival(whole) if link else whole
            if when is not None:
                result.append((when, topic, value))
        return result


class Channel:
    """Things on their way through a link."""

    def __init__(self, parameters: LinkParameters, rng: Random) -> None:
        self._link = Link(parameters, rng)
        self._pending: Deque[Tuple[float, Any]] = deque()

    def send(self, t: float, thing: Any) -> None:
        """Send at ``t`` [s]."""
        when = self._link.arrival(t)
        if when is not None:
            insert(self._pending, (when, thing))

    def receive(self, t: float) -> List[Any]:
        """Return what has arrived until ``t`` [s] since the last call, in order of arrival."""
        pending, arrived = self._pending, []
        while pending and pending[0][0] <= t + 1e-9:
            arrived.append(pending.popleft()[1])
        return arrived


def insert(pending: Deque[Any], item: Any, when: int = 0) -> None:
    """Insert a tuple by its time ``item[when]``, after those of the same time."""
    k = len(pending)
    while k > 0 and pending[k - 1][when] > item[when]:
        k -= 1
    pending.insert(k, item)
