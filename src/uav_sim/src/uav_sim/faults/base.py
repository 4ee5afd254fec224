# SPDX-License-Identifier: MIT
"""What a fault is: hooks into the simulated aircraft, and the values that it overrules."""

import random
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, NamedTuple, Protocol, Tuple

from uav_sim.autopilot import Autopilot
from uav_sim.plant import Plant, Vector
from uav_sim.remote_control import RemoteControl
from uav_sim.telemetry import Packet


class Aircraft(Protocol):
    """What faults reach of a SimulatedM100."""

    t: float
    battery: float
    rc: RemoteControl
    plant: Plant
    autopilot: Autopilot

    def restart_driver(self) -> None:
        """Start dji_sdk's node anew."""


class Overrides:
    """Values that faults change; what they were comes back when the last such fault ends.

    Faults that change the same value act one after the other, in the order in which they began.
    """

    def __init__(self) -> None:
        self._before: Dict[Tuple[int, str], Any] = {}
        self._changes: List[Tuple[object, object, str, Callable[[Any], Any]]] = []

    def add(self, fault: object, target: object, name: str, change: Callable[[Any], Any]) -> None:
        """Replace the attribute ``name`` of ``target`` by what ``change`` makes of its value."""
        self._before.setdefault((id(target), name), getattr(target, name))
        self._changes.append((fault, target, name, change))
        self._apply(target, name)

    def release(self, fault: object) -> None:
        """Take back all that a fault has changed."""
        gone = [change for change in self._changes if change[0] is fault]
        self._changes = [change for change in self._changes if change[0] is not fault]
        for _, target, name, _ in gone:
            if (id(target), name) in self._before:
                self._apply(target, name)

    def _apply(self, target: object, name: str) -> None:
        value = self._before[id(target), name]
        changes = [c[3] for c in self._changes if c[1] is target and c[2] == name]
        for change in changes:
            value = change(value)
        setattr(target, name, value)
        if not changes:
            del self._before[id(target), name]


class Context(NamedTuple):
    """What a fault is given when it begins."""

    aircraft: Aircraft
    overrides: Overrides
    random: random.Random  # of this fault alone
    since: float  # [s]
    until: float  # [s] infinite: until it is cleared


@dataclass
class Fault:
    """One kind of fault; its fields are the parameters, by default it does nothing."""

    def begin(self, context: Context) -> None:
        """Begin; what ``context.overrides`` was given ends by itself."""

    def end(self) -> None:
        """End; called once."""

    def step(self, t: float) -> None:
        """Act before the step of the aircraft that begins at ``t`` [s]."""

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Return what becomes of the packets received at ``t`` [s]; called every step."""
        return packets

    def flush(self, t: float) -> List[Packet]:
        """Return the packets still held back when the fault ends at ``t`` [s]."""
        return []

    def objection(self, suffix: str) -> str:
        """Return why a setpoint on a topic never arrives; empty if it does."""
        return ""

    def gust(self, t: float) -> Vector:
        """Return the velocity (3,) [m/s] that is added to the wind at ``t`` [s]."""
        return (0.0, 0.0, 0.0)

    @property
    def kills(self) -> str:
        """What dies while this fault is active: "", "driver" or "process"."""
        return ""
