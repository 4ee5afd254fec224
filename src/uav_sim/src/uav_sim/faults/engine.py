# SPDX-License-Identifier: MIT
"""The faults of one simulated aircraft: begun, ended and applied in simulated time."""

import dataclasses
import logging
import math
import random
from dataclasses import dataclass
from typing import Any, Callable, List, Mapping, Optional, Tuple

from uav_sim.config import number
from uav_sim.errors import ConfigError
from uav_sim.faults.base import Aircraft, Context, Fault, Overrides
from uav_sim.faults.kinds import make_fault
from uav_sim.telemetry import Packet

NO_RESPONSE = 0xFFFF  # ack_data where nobody answers (doc/dji_sdk.md 4)


@dataclass(frozen=True)
class Entry:
    """One fault, active or still to come."""

    id: str
    kind: str
    fault: Fault
    since: float  # [s] simulated time
    until: float  # [s] infinite: until it is cleared

    @property
    def parameters(self) -> str:
        """Values of the kind's parameters, defaults included, as a YAML mapping."""
        values = dataclasses.asdict(self.fault).items()
        lines = [f"{k}: {list(v) if isinstance(v, tuple) else v}" for k, v in values]
        return f"{{{', '.join(lines)}}}"

    def __str__(self) -> str:
        end = f"until {self.until:.2f} s" if math.isfinite(self.until) else "until cleared"
        return f"{self.id}: {self.kind} {self.parameters} from {self.since:.2f} s {end}"


class Faults:
    """Begins and ends faults of an aircraft and lets them act; the aircraft asks it at every turn.

    ``on_change`` is called with a line of text whenever a fault begins or ends.
    """

    def __init__(self, aircraft: Aircraft, seed: str = "0") -> None:
        self.on_change: Callable[[str], None] = logging.getLogger(__name__).warning
        self._aircraft = aircraft
        self._seed = seed
        self._overrides = Overrides()
        self._active: List[Entry] = []
        self._pending: List[Entry] = []
        self._late: List[Packet] = []
        self._count = 0
        self.rest = True  # nothing acts, nothing is to come: asking may be left out

    @property
    def active(self) -> Tuple[Entry, ...]:
        """The faults that act, in the order in which they began."""
        return tuple(self._active)

    @property
    def pending(self) -> Tuple[Entry, ...]:
        """The faults still to come."""
        return tuple(self._pending)

    def apply(
        self,
        kind: str,
        start: Optional[float] = None,
        duration: float = math.inf,
        **parameters: Any,
    ) -> str:
        """Begin a fault now or later; as ``inject``, with the parameters as keywords."""
        return self.inject(kind, parameters, start, duration)

    def inject(
        self,
        kind: str,
        parameters: Mapping[str, Any],
        start: Optional[float] = None,
        duration: float = math.inf,
        id: str = "",
        source: str = "fault",
    ) -> str:
        """Begin a fault now or later; returns the id by which it can be cleared.

        Args:
            kind: one of ``kinds.KINDS``.
            parameters: values of the kind's parameters; those that are missing have defaults.
            start: simulated time [s] of its begin; None or in the past: now.
            duration: [s]; infinite: until it is cleared.
            id: by default its kind and a number.
            source: where this comes from, for the words of an error.

        Raises:
            ConfigError: a kind, parameter, time or id that is wrong.
        """
        t = self._aircraft.t
        since = t if start is None else max(t, number(start, source, "start", 0.0))
        if duration != math.inf and number(duration, source, "duration", 0.0) == 0.0:
            raise ConfigError(source, "duration", duration, "more than 0 s, or none")
        fault = make_fault(kind, parameters, source)
        self._count += 1
        id = id or f"{kind}_{self._count}"
        if any(entry.id == id for entry in (*self._active, *self._pending)):
            raise ConfigError(source, "id", id, "an id that no other fault has")
        entry = Entry(id, kind, fault, since, since + duration)
        self.rest = False
        if since > t:
            self._pending.append(entry)
            self._pending.sort(key=lambda e: e.since)
        else:
            self._begin(entry)
        return entry.id

    def clear(self, id: str = "") -> Tuple[str, ...]:
        """End and forget the fault of an id, all of a kind, or all; returns their ids."""
        gone = [e for e in (*self._active, *self._pending) if id in ("", e.id, e.kind)]
        self._pending = [entry for entry in self._pending if entry not in gone]
        for entry in gone:
            if entry in self._active:
                self._end(entry, "cleared")
        return tuple(entry.id for entry in gone)

    def update(self, t: float) -> None:
        """Begin and end what is due, and act, before the step that begins at ``t`` [s]."""
        if not self._active and not self._pending:
            return
        for entry in self.active:
            if entry.until <= t + 1e-9:
                self._end(entry, "over")
        while self._pending and self._pending[0].since <= t + 1e-9:
            self._begin(self._pending.pop(0))
        for entry in self._active:
            entry.fault.step(t)
        self._blow(t)

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Return what becomes of the packets received at ``t`` [s]; called every step."""
        if self._late:
            packets, self._late = [*self._late, *packets], []
        self.rest = not self._active and not self._pending
        for entry in self._active:
            packets = entry.fault.filter(t, packets)
        return packets

    def objection(self, suffix: str) -> str:
        """Return why a setpoint never arrives; empty if it does."""
        reasons = [entry.fault.objection(suffix) for entry in self._active]
        return next((reason for reason in reasons if reason), "")

    @property
    def dead(self) -> str:
        """What has died: "", "driver" or "process"."""
        return next((entry.fault.kills for entry in self._active if entry.fault.kills), "")

    def _begin(self, entry: Entry) -> None:
        seeded = random.Random(f"{self._seed}/{entry.id}")
        self._active.append(entry)
        context = Context(self._aircraft, self._overrides, seeded, entry.since, entry.until)
        entry.fault.begin(context)
        self.on_change(f"fault begins at {self._aircraft.t:.2f} s: {entry}")

    def _end(self, entry: Entry, word: str) -> None:
        self._active.remove(entry)
        self._overrides.release(entry.fault)
        entry.fault.end()
        self._blow(self._aircraft.t)
        self._late.extend(entry.fault.flush(self._aircraft.t))
        self.on_change(f"fault ends at {self._aircraft.t:.2f} s ({word}): {entry.id}")

    def _blow(self, t: float) -> None:
        gusts = [entry.fault.gust(t) for entry in self._active]
        self._aircraft.plant.gust = tuple(math.fsum(g[k] for g in gusts) for k in range(3))
