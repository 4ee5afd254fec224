# SPDX-License-Identifier: MIT
"""Faults of what is received: frozen, dropped, delayed, not a number, jumping."""

import math
import random
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Deque, Dict, List, Tuple

from uav_sim.faults.base import Context, Fault
from uav_sim.faults.values import BYTES, map_numbers, shifted
from uav_sim.telemetry import Packet

ALL = "all"
NUMBERS = (
    "attitude",
    "imu",
    "velocity",
    "gps_position",
    "local_position",
    "height_above_takeoff",
    "rc",
    "battery_state",
    "gimbal_angle",
)
TELEMETRY = (*NUMBERS, *BYTES)
SURROUNDINGS = ("obstacles", "scan", "vicon")  # not of dji_sdk; they can be late or missing too
TOPICS = (ALL, *TELEMETRY, *SURROUNDINGS)


@dataclass
class TopicFault(Fault):
    """A fault of one topic below ``dji_sdk/``, of ``obstacles``, ``scan``, ``vicon``, or of all."""

    topic: str = field(metadata={"choices": TOPICS})

    def concerns(self, packet: Packet) -> bool:
        """Return whether this fault acts on a packet; all topics are those of ``dji_sdk``."""
        if self.topic == ALL:
            return packet.topic not in SURROUNDINGS
        return packet.topic == self.topic


@dataclass
class TopicFrozen(TopicFault):
    """The value no longer changes; messages go on with new stamps."""

    def begin(self, context: Context) -> None:
        """Hold on to the first value of each topic from now on."""
        self._values: Dict[str, Any] = {}

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Repeat the first value."""
        return [
            p._replace(value=self._values.setdefault(p.topic, p.value)) if self.concerns(p) else p
            for p in packets
        ]


@dataclass
class TopicDropped(TopicFault):
    """Messages are lost: all of them, or each with a probability."""

    probability: float = field(default=1.0, metadata={"min": 0.0, "max": 1.0})  # [1]

    def begin(self, context: Context) -> None:
        """Take the fault's own random numbers."""
        self._random: random.Random = context.random

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Lose messages."""
        return [
            p
            for p in packets
            if not (self.concerns(p) and self._random.random() < self.probability)
        ]


@dataclass
class TopicDelayed(TopicFault):
    """Messages come late, in order.

    Those of ``dji_sdk`` carry the stamp of their late receipt, the others that of the measurement.
    """

    delay: float = field(default=0.2, metadata={"min": 0.0, "max": 60.0})  # [s]

    def begin(self, context: Context) -> None:
        """Hold nothing back yet."""
        self._held: Deque[Tuple[float, Packet]] = deque()

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Hold messages back."""
        prompt = []
        for packet in packets:
            if self.concerns(packet):
                self._held.append((packet.t + self.delay, packet))
            else:
                prompt.append(packet)
        late = []
        while self._held and self._held[0][0] <= t + 1e-9:
            late.append(_received(t, self._held.popleft()[1]))
        return late + prompt

    def flush(self, t: float) -> List[Packet]:
        """All that is late comes at once when the fault ends."""
        return [_received(t, packet) for _, packet in self._held]


@dataclass
class TopicNan(TopicFault):
    """Every number is NaN."""

    topic: str = field(metadata={"choices": NUMBERS})

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Replace every number."""
        return [
            p._replace(value=map_numbers(p.value, lambda _: math.nan)) if self.concerns(p) else p
            for p in packets
        ]


@dataclass
class TopicJump(TopicFault):
    """The value jumps by an offset and stays there, or jumps to and fro."""

    topic: str = field(metadata={"choices": TELEMETRY})
    offset: Tuple[float, float, float]  # in the topic's unit, see ``shifted``
    period: float = field(default=0.0, metadata={"min": 0.0})  # [s] on and off again; 0: stays

    def begin(self, context: Context) -> None:
        """Count the period from now."""
        self._since = context.since

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Displace the value."""
        if self.period > 0.0 and (t - self._since) % self.period >= 0.5 * self.period:
            return packets
        return [
            p._replace(value=shifted(p.topic, p.value, self.offset)) if self.concerns(p) else p
            for p in packets
        ]


def _received(t: float, packet: Packet) -> Packet:
    return packet if packet.topic in SURROUNDINGS else packet._replace(t=t)
