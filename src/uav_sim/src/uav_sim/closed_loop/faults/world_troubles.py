# SPDX-License-Identifier: MIT
"""Troubles of what is heard: stamps, order, and everything about obstacles."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence

from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting
from uav_sim.closed_loop.faults.trouble import Trouble
from uav_sim.faults.topics import TOPICS
from uav_sim.motion import STILL, Vector
from uav_sim.telemetry import Packet
from uav_sim.vicon import ViconPose

if TYPE_CHECKING:
    from uav_sim.closed_loop.faults.faulty_loop import FaultyLoop


@dataclass
class StampsShifted(Trouble):
    """Stamps of a topic are off."""

    topic: str = field(metadata={"choices": TOPICS})
    offset: float = field()  # [s]

    def hear(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Shift the stamps."""
        return [
            p._replace(t=p.t + self.offset) if self.topic in ("all", p.topic) else p
            for p in packets
        ]


@dataclass
class OutOfOrder(Trouble):
    """Of a topic every second message is overtaken by the next one, and keeps its stamp."""

    topic: str = field(metadata={"choices": TOPICS})

    def begin(self, loop: "FaultyLoop") -> None:
        """Hold nothing back yet."""
        self._held: Dict[str, Packet] = {}

    def hear(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Swap neighbours."""
        result = []
        for packet in packets:
            if self.topic not in ("all", packet.topic):
                result.append(packet)
            elif packet.topic in self._held:
                result += [packet, self._held.pop(packet.topic)]
            else:
                self._held[packet.topic] = packet
        return result


@dataclass
class ViconSilent(Trouble):
    """Motion capture falls silent."""

    def capture(self, poses: List[ViconPose]) -> List[ViconPose]:
        """Lose the poses."""
        return []


@dataclass
class ObstaclesSilent(Trouble):
    """Nothing more is heard of obstacles."""

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Lose the list."""
        return None


@dataclass
class ObstaclesNan(Trouble):
    """Every position of an obstacle is NaN."""

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Replace the positions."""
        return [s._replace(position=(math.nan,) * 3) for s in sightings]


@dataclass
class ObstaclesOld(Trouble):
    """What is said of obstacles carries an old stamp."""

    age: float = field(metadata={"min": 0.0})  # [s]

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Shift the stamps."""
        return [s._replace(stamp=s.stamp - self.age) for s in sightings]


@dataclass
class ObstaclesStand(Trouble):
    """Of obstacles only those are heard of that stand still."""

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Leave those out that move."""
        return [s for s in sightings if not s.moves]


@dataclass
class ObstaclesFlood(Trouble):
    """Lists are full of things far away that move, also of another sender that is heard first."""

    count: int = field(metadata={"min": 0, "max": 1000})  # [1] in the list that there is
    others: int = field(default=0, metadata={"min": 0, "max": MAX_OBSTACLES})  # [1] of the other

    def sight(self, sightings: List[Sighting]) -> Optional[List[Sighting]]:
        """Add to the list, in front of what is there."""
        stamp = max((s.stamp for s in sightings), default=0.0)
        return [*_far(self.count, 60.0, stamp), *sightings]

    def crowd(self, t: float) -> Optional[List[Sighting]]:
        """Return the list of the other sender."""
        return _far(self.others, 80.0, t) if self.others else None


def _far(count: int, north: float, stamp: float) -> List[Sighting]:
    return [
        Sighting(f"far{i}", "sphere", (0.5,), (60.0 + i, north, 12.0), (0.1, 0.0, 0.0), stamp=stamp)
        for i in range(count)
    ]


@dataclass(frozen=True)
class Places:
    """A vector (3,) for each situation."""

    hover: Vector = STILL
    turn: Vector = STILL
    beside: Vector = STILL


@dataclass
class ObstacleAppears(Trouble):
    """A sphere is there that was not; where depends on the situation."""

    at: Places  # [m]
    velocity: Places = Places()  # [m/s]
    radius: float = field(default=0.5, metadata={"min": 0.01})  # [m]

    def scenery(self, situation: str, t: float) -> Sequence[Dict[str, Any]]:
        """Return the sphere that appears at ``t`` [s]."""
        place, velocity = getattr(self.at, situation), getattr(self.velocity, situation)
        entry = {"id": "appeared", "position": place, "radius": self.radius, "appear": {"at": t}}
        return ({**entry, "velocity": velocity} if any(velocity) else entry,)
