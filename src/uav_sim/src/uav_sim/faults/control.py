# SPDX-License-Identifier: MIT
"""Faults of the way in: authority, remote control, setpoints, and the death of dji_sdk's node."""

import random
from dataclasses import dataclass, field
from typing import List

from uav_sim.authority import OBTAINING
from uav_sim.faults.base import Aircraft, Context, Fault
from uav_sim.faults.topics import SURROUNDINGS
from uav_sim.telemetry import Packet

_STICK = {"min": -1.0, "max": 1.0}


@dataclass
class AuthorityRefused(Fault):
    """Requests for the control authority fail; one that is held already stays."""

    ack: int = field(default=0, metadata={"min": 0, "max": 0xFFFF})  # ack_data of the reply

    def begin(self, context: Context) -> None:
        """Refuse to give it; releasing it works."""
        control = context.aircraft.autopilot.control
        context.overrides.add(self, control, "refusal", lambda _: self.ack)


@dataclass
class AuthorityLost(Fault):
    """The authority is gone and does not stay, though requests are answered as usual."""

    def begin(self, context: Context) -> None:
        """Take it away."""
        self._aircraft: Aircraft = context.aircraft
        self.step(context.since)

    def step(self, t: float) -> None:
        """Take it away again."""
        autopilot = self._aircraft.autopilot
        if autopilot.authority:
            autopilot.authority = False
            autopilot.control_authority(False)  # now also forgets the last setpoint


@dataclass
class AuthorityTaken(AuthorityLost):
    """Somebody else takes the control: the pilot by the switch, or a mobile app unseen.

    Requests are answered "in progress" while an app has it (doc/dji_sdk.md 4).
    """

    by: str = field(default="pilot", metadata={"choices": ("pilot", "app")})
    mode: str = field(default="P", metadata={"choices": ("P", "A")})  # where the pilot switches to

    def begin(self, context: Context) -> None:
        """Move the switch, if it is the pilot; an app lets nobody else have it."""
        super().begin(context)
        if self.by == "pilot":
            context.overrides.add(self, context.aircraft.rc, "mode", lambda _: self.mode)
        else:
            control = context.aircraft.autopilot.control
            context.overrides.add(self, control, "refusal", lambda _: OBTAINING)


@dataclass
class RcOff(Fault):
    """The remote control is switched off or out of reach."""

    def begin(self, context: Context) -> None:
        """Cut the link."""
        context.overrides.add(self, context.aircraft.rc, "connected", lambda _: False)


@dataclass
class RcMode(Fault):
    """The mode switch is moved; it comes back when this ends."""

    mode: str = field(metadata={"choices": ("P", "A", "F")})

    def begin(self, context: Context) -> None:
        """Move the switch."""
        context.overrides.add(self, context.aircraft.rc, "mode", lambda _: self.mode)


@dataclass
class RcSticks(Fault):
    """Sticks are held away from the centre, in the transmitter's own sense."""

    roll: float = field(default=0.0, metadata=_STICK)  # right positive
    pitch: float = field(default=0.0, metadata=_STICK)  # forward positive
    yaw: float = field(default=0.0, metadata=_STICK)  # right, clockwise positive
    throttle: float = field(default=0.0, metadata=_STICK)  # up positive

    def begin(self, context: Context) -> None:
        """Move the sticks."""
        for name in ("roll", "pitch", "yaw", "throttle"):
            value = getattr(self, name)
            context.overrides.add(self, context.aircraft.rc, name, lambda _, v=value: v)


@dataclass
class SetpointsIgnored(Fault):
    """Setpoints do not reach the flight controller: all of them, or each with a probability."""

    probability: float = field(default=1.0, metadata={"min": 0.0, "max": 1.0})  # [1]

    def begin(self, context: Context) -> None:
        """Take the fault's own random numbers."""
        self._random: random.Random = context.random

    def objection(self, suffix: str) -> str:
        """Lose the setpoint."""
        return "lost on the link" if self._random.random() < self.probability else ""


@dataclass
class NodeKilled(Fault):
    """dji_sdk's node dies: no topic, no answer; the aircraft flies on without it.

    Through ROS the simulator's process ends, or only this vehicle's topics and services. When the
    fault ends the node is started anew.
    """

    what: str = field(default="process", metadata={"choices": ("process", "driver")})

    def begin(self, context: Context) -> None:
        """Die."""
        self._aircraft: Aircraft = context.aircraft

    def end(self) -> None:
        """Start again."""
        self._aircraft.restart_driver()

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Send nothing any more; what others publish goes on."""
        return [packet for packet in packets if packet.topic in SURROUNDINGS]

    def objection(self, suffix: str) -> str:
        """Take no setpoint any more."""
        return "dji_sdk is dead"

    @property
    def kills(self) -> str:
        """The process or the driver."""
        return self.what
