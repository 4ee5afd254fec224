# SPDX-License-Identifier: MIT
"""Motion capture: poses of the aircraft at 50-200 Hz, with drop-outs; the source indoors.

Interface: ``Vicon(parameters, seed)``; ``poses(t, position, rpy)`` once per plant step returns the
poses received in it. The stamp is the time of capture, as ``vicon_bridge`` gives it on ``/tf``.
"""

import math
from dataclasses import dataclass, field
from random import Random
from typing import List, NamedTuple, Tuple

from uav_sim.link import Channel, LinkParameters
from uav_sim.motion import Vector
from uav_sim.noise import normals
from uav_sim.telemetry import quaternion


class ViconPose(NamedTuple):
    """One pose of the body in the world."""

    t: float  # [s] of capture
    position: Vector  # [m]
    orientation: Tuple[float, float, float, float]  # x, y, z, w, body FLU to ENU


@dataclass(frozen=True)
class ViconParameters:
    """What the system delivers."""

    enabled: bool = field()
    rate: float = field(metadata={"min": 50.0, "max": 200.0})  # [Hz]
    position: float = field(metadata={"min": 0.0})  # [m] sigma per axis, white
    attitude: float = field(metadata={"min": 0.0})  # [rad] sigma per axis, white
    dropout_rate: float = field(metadata={"min": 0.0})  # [1/s] drop-outs begin so often, at random
    dropout_time: float = field(metadata={"min": 0.0})  # [s] longest; uniform between 0 and this
    link: LinkParameters = field()  # on the network


class Vicon:
    """Poses of one aircraft."""

    def __init__(self, parameters: ViconParameters, seed: str) -> None:
        self.parameters = parameters
        self._draw = normals(f"{seed}/noise")
        self._gaps = Random(f"{seed}/dropout")
        self._channel = Channel(parameters.link, Random(f"{seed}/link"))
        self._frames = 0
        self._gap: Tuple[float, float] = (-math.inf, -math.inf)
        self._next_gap(0.0)

    def poses(self, t: float, position: Vector, rpy: Vector) -> List[ViconPose]:
        """Capture if a frame is due at ``t`` [s]; return the poses received until then.

        Args:
            t: now [s].
            position: true (3,) [m], world frame.
            rpy: true roll, pitch, yaw [rad].
        """
        if t + 1e-9 >= self._frames / self.parameters.rate:
            self._frames += 1
            while t > self._gap[1]:
                self._next_gap(self._gap[1])
            if t < self._gap[0]:
                self._channel.send(t, self._pose(t, position, rpy))
        return self._channel.receive(t)

    def _pose(self, t: float, position: Vector, rpy: Vector) -> ViconPose:
        draw, p = self._draw, self.parameters
        x, y, z = (v + p.position * draw() for v in position)
        roll, pitch, yaw = (v + p.attitude * draw() for v in rpy)
        return ViconPose(t, (x, y, z), quaternion(roll, pitch, yaw))

    def _next_gap(self, after: float) -> None:
        p = self.parameters
        if p.dropout_rate == 0.0 or p.dropout_time == 0.0:
            self._gap = (math.inf, math.inf)
            return
        begin = after + self._gaps.expovariate(p.dropout_rate)
        self._gap = (begin, begin + self._gaps.uniform(0.0, p.dropout_time))
