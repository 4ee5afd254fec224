# SPDX-License-Identifier: MIT
"""Gathers decoded messages by role: rows of numbers many at a time, events one by one."""

from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.columns import batches
from nmpc_control.analysis.definitions import Decoder
from nmpc_control.analysis.messages import EVENTS, NAN_MEANS_ABSENT, ROWS
from nmpc_control.analysis.topics import ROLES

_BATCH_BYTES = 1 << 22  # raw messages of one connection that are held before they are decoded
_MOST_EVENTS = 500_000  # of one role
_LARGEST_OFFSET = 5.0  # [s] of stamps from the time of recording

Rows = Tuple[np.ndarray, np.ndarray]  # times (n,) [s], values (n, k)


class Event(NamedTuple):
    """A message that is not a row of numbers."""

    time: float  # [s] recorded
    stamp: Optional[float]  # [s] of the header; None where it is zero or absent
    content: Any


class Collector:
    """A message that cannot be decoded or used is counted, not raised."""

    def __init__(self, start: int, roles: Dict[int, str], decoders: Dict[int, Decoder]) -> None:
        self.count = 0  # messages that came
        self._start = start  # [ns]
        self._roles = roles
        self._decoders = decoders
        self._add: Dict[int, Callable[[int, bytes], None]] = {
            i: self._adder(i) for i in roles if i in decoders
        }
        self._pending: Dict[int, Tuple[List[int], List[bytes]]] = {}
        self._rows: Dict[str, List[Rows]] = {}
        self._events: Dict[str, List[Event]] = {}
        self._unusable: Dict[str, int] = {}
        self._offsets: Dict[str, float] = {}  # [s] between stamps and recording
        self._wrong: Dict[str, int] = {}  # stamps that cannot be

    def add(self, connection_id: int, time: int, raw: bytes) -> None:
        """Take one raw message, recorded at a time [ns]."""
        self.count += 1
        add = self._add.get(connection_id)
        if add is not None:
            add(time, raw)

    def finish(self) -> Tuple[Dict[str, Rows], Dict[str, List[Event]], List[str]]:
        """Return rows and events by role, and what was left out in words."""
        for connection_id in list(self._pending):
            self._decode(connection_id)
        found: Dict[str, Rows] = {}
        remarks = []
        for role, parts in self._rows.items():
            times, values = (np.concatenate(list(column)) for column in zip(*parts))
            parts.clear()
            wrong = np.isinf(values) if role in NAN_MEANS_ABSENT else ~np.isfinite(values)
            finite = ~wrong.any(axis=1)
            if not finite.all():
                remarks.append(f"{_name(role)}: {np.sum(~finite)} samples are not finite: left out")
                times, values = times[finite], values[finite]
            if len(times):
                found[role] = times, values
        for role, count in self._unusable.items():
            remarks.append(f"{_name(role)}: {count} messages cannot be used: left out")
        for role, count in self._wrong.items():
            if count:
                remarks.append(
                    f"{_name(role)}: {count} stamps are over {_LARGEST_OFFSET:.0f} s from all "
                    "others': the time of recording counts"
                )
        for role, offset in self._offsets.items():
            if offset > _LARGEST_OFFSET:
                remarks.append(
                    f"{_name(role)}: stamps are {offset:.1f} s from the time of recording: "
                    "its clock is another one"
                )
        for events in self._events.values():
            events.sort(key=lambda event: event.time)
        return found, self._events, remarks

    def _adder(self, connection_id: int) -> Callable[[int, bytes], None]:
        role = self._roles[connection_id]
        if role in EVENTS:
            decode = self._decoders[connection_id]
            return lambda time, raw: self._add_event(role, decode, time, raw)
        return self._row_adder(connection_id)

    def _row_adder(self, connection_id: int) -> Callable[[int, bytes], None]:
        held = 0

        def add(time: int, raw: bytes) -> None:
            nonlocal held
            times, messages = self._pending.setdefault(connection_id, ([], []))
            times.append(time)
            messages.append(raw)
            held += len(raw)
            if held > _BATCH_BYTES:
                self._decode(connection_id)
                held = 0

        return add

    def _add_event(self, role: str, decode: Decoder, time: int, raw: bytes) -> None:
        events = self._events.setdefault(role, [])
        try:
            if len(events) >= _MOST_EVENTS:
                raise ValueError("too many")
            message = decode(raw)
            stamp = _stamp(message)
            content = EVENTS[role](message)
        except Exception:  # untrusted content, decoded by an untrusted definition
            self._unusable[role] = self._unusable.get(role, 0) + 1
            return
        seconds = self._seconds(stamp) if stamp else None
        events.append(Event(self._seconds(time), seconds, content))

    def _decode(self, connection_id: int) -> None:
        role = self._roles[connection_id]
        columns, rows_of = ROWS[role]
        decoder = self._decoders[connection_id]
        recorded, messages = self._pending.pop(connection_id)
        found = []
        for numbers, batch in batches(decoder.fields, decoder.msgtype, messages):
            times = np.array(recorded, dtype=np.int64)[numbers]
            try:
                stamps = _stamp(batch)
                values = _table(rows_of(batch), len(numbers), columns)
            except Exception:  # fields that are absent, or are not numbers
                continue
            stamps = np.zeros_like(times) if stamps is None else stamps
            found.append((numbers, times, stamps, values))
        used = 0
        if found:
            numbers, times, stamps, values = (np.concatenate(column) for column in zip(*found))
            order, used = np.argsort(numbers), len(numbers)
            times = self._seconds(self._times(role, times, stamps))
            self._rows.setdefault(role, []).append((times[order], values[order]))
        if used < len(messages):
            self._unusable[role] = self._unusable.get(role, 0) + len(messages) - used

    def _times(self, role: str, recorded: np.ndarray, stamps: np.ndarray) -> np.ndarray:
        """Return the stamps (n,) [ns]; the time of recording for those that are absent or wrong.

        Delays vary little: a stamp that is far from what most of them are before the recording is
        wrong. If most are far there is no common offset: such a clock runs at another speed.
        """
        given = stamps != 0
        if not given.any():
            return recorded
        offsets = (stamps - recorded) * 1e-9
        offset = float(np.median(offsets[given]))
        self._offsets[role] = max(self._offsets.get(role, 0.0), abs(offset))
        is_wrong = given & (np.abs(offsets - offset) > _LARGEST_OFFSET)
        if 2 * is_wrong.sum() < given.sum():
            self._wrong[role] = self._wrong.get(role, 0) + int(is_wrong.sum())
            given &= ~is_wrong
        return np.where(given, stamps, recorded)

    def _seconds(self, nanoseconds: Any) -> Any:
        return (nanoseconds - self._start) * 1e-9


def _table(values: Sequence[np.ndarray], count: int, columns: int) -> np.ndarray:
    if len(values) != columns:
        raise ValueError(f"{len(values)} columns")
    return np.stack([np.broadcast_to(v, (count,)) for v in values], axis=1).astype(float)


def _stamp(message: Any) -> Any:
    """Return the header's stamp [ns], of one message or of many; None where there is no header."""
    header = getattr(message, "header", None)
    return None if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec


def _name(role: str) -> str:
    return ROLES[role].suffix if role in ROLES else "mav_msgs command"
