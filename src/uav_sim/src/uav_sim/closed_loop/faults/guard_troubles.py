# SPDX-License-Identifier: MIT
"""Troubles of the guard's own process: its loop, its clock, its calls; and what people ask for."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nmpc_control.guard_data import Action
from nmpc_control.mode_inputs import Request
from uav_sim.closed_loop.faults.solver_troubles import FOR_EVER
from uav_sim.closed_loop.faults.trouble import Trouble

if TYPE_CHECKING:
    from uav_sim.closed_loop.faults.faulty_loop import FaultyLoop

CALLS = ("OBTAIN_AUTHORITY", "RELEASE_AUTHORITY", "TAKE_OFF", "LAND")


@dataclass
class GuardStops(Trouble):
    """The guard's process does not run for a while, once or again and again."""

    time: float = field(metadata={"min": 0.0})  # [s]
    every: float = field(default=float("inf"))  # [s] from stop to stop

    def begin(self, loop: "FaultyLoop") -> None:
        """Stop."""
        self._since = loop.t

    def runs(self, t: float) -> bool:
        """Return whether it runs."""
        return (t - self._since) % self.every >= self.time - 1e-9


@dataclass
class GuardRaises(Trouble):
    """The guard's tick raises."""

    count: int = field(default=FOR_EVER, metadata={"min": 1, "max": FOR_EVER})  # [1]

    def begin(self, loop: "FaultyLoop") -> None:
        """Begin counting."""
        self._left = self.count

    def before_judgement(self) -> None:
        """Raise."""
        self._left -= 1
        if self._left >= 0:
            raise RuntimeError("the guard has failed")


@dataclass
class ClockSteps(Trouble):
    """The clock of the onboard computer is set."""

    by: float = field()  # [s] positive: forward

    def clock(self) -> float:
        """Return by how much it is off."""
        return self.by


@dataclass
class CallBlocks(Trouble):
    """A service of dji_sdk does not answer for a while."""

    call: str = field(metadata={"choices": CALLS})
    time: float = field(metadata={"min": 0.0})  # [s]

    def call_time(self, action: Action) -> float:
        """Return for how long it blocks."""
        return self.time if action.name == self.call else 0.0


@dataclass
class CallRefused(Trouble):
    """A service of dji_sdk refuses."""

    call: str = field(metadata={"choices": CALLS})

    def refuses(self, action: Action) -> bool:
        """Return whether it is that call."""
        return action.name == self.call


@dataclass
class Asks(Trouble):
    """The operator asks for something, once."""

    request: str = field(metadata={"choices": tuple(r.name.lower() for r in Request)})

    def begin(self, loop: "FaultyLoop") -> None:
        """Ask."""
        loop.inbox.request = Request[self.request.upper()]
