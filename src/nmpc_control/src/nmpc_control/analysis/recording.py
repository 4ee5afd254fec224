# SPDX-License-Identifier: MIT
"""Reading a ROS 1 bag without ROS: rows of numbers by role, on one clock that starts with the bag.

Header stamps are used where a message has one, the time of recording otherwise.
"""

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

import numpy as np
from rosbags.rosbag1 import Reader

from nmpc_control.analysis.definitions import Decode, decoder
from nmpc_control.analysis.messages import EVENTS, NAN_MEANS_ABSENT, ROWS
from nmpc_control.analysis.record import Series
from nmpc_control.analysis.topics import ROLES, Selection, select
from nmpc_control.errors import BagError

# From messages and their number to the same messages
Progress = Callable[[Iterable[Any], int], Iterable[Any]]


class Event(NamedTuple):
    """A message that is not a row of numbers."""

    time: float  # [s] recorded
    stamp: Optional[float]  # [s] of the header; None where it is zero or absent
    content: Any


@dataclass
class Recording:
    """What a bag says about one vehicle; times in s since the bag's first message."""

    selection: Selection
    rows: Dict[str, Series] = field(default_factory=dict)
    events: Dict[str, List[Event]] = field(default_factory=dict)
    remarks: List[str] = field(default_factory=list)  # what was left out, and why


def read(
    path: Path, namespace: Optional[str] = None, progress: Optional[Progress] = None
) -> Recording:
    """Return what a bag holds.

    Args:
        path: The bag.
        namespace: Vehicle to read; None for the best recorded one.
        progress: Wraps the messages to show how far reading is.

    Raises:
        BagError: it cannot be read, or holds no topic that can be evaluated.
    """
    if not path.is_file():
        raise BagError("is a directory, expected a ROS 1 bag" if path.is_dir() else "no such file")
    if path.stat().st_size == 0:
        raise BagError("empty file, expected a ROS 1 bag")
    try:
        with Reader(path) as reader:
            return _read(reader, namespace, progress or (lambda messages, _: messages))
    except BagError:
        raise
    except PermissionError:
        raise BagError("cannot be opened: permission denied") from None
    except Exception as error:  # what the library's parser stumbles over in a damaged file
        raise BagError(f"not a readable ROS 1 bag: {_one_line(error)}") from None


def _read(reader: Reader, namespace: Optional[str], progress: Progress) -> Recording:
    if not reader.message_count:
        raise BagError("the bag holds no messages")
    recording = Recording(select(reader.connections, namespace))
    recording.remarks.extend(recording.selection.remarks)
    roles = {c.id: role for role, group in recording.selection.connections.items() for c in group}
    if not roles:
        expected = ", ".join(
            ROLES[role].suffix for role in ("odometry", "status", "setpoint", "imu")
        )
        raise BagError(f"no topic that can be evaluated (expected names like {expected})")
    connections = [c for c in reader.connections if c.id in roles]
    collector = _Collector(reader.start_time, _decoders(connections, recording))
    count = sum(c.msgcount for c in connections)
    for connection, time, raw in progress(reader.messages(connections=connections), count):
        collector.add(roles[connection.id], connection.id, time, raw)
    collector.finish(recording)
    return recording


def _decoders(connections: List[Any], recording: Recording) -> Dict[int, Decode]:
    decoders: Dict[int, Decode] = {}
    for connection in connections:
        msgdef = connection.msgdef  # text itself in rosbags 0.9
        definition = getattr(msgdef, "data", msgdef)
        try:
            decoders[connection.id] = decoder(connection.msgtype, definition)
        except BagError as error:
            recording.remarks.append(f"{connection.topic}: {error}: not read")
    return decoders


class _Collector:
    """Gathers rows compactly; a message that cannot be decoded or used is counted, not raised."""

    def __init__(self, start: int, decoders: Dict[int, Decode]) -> None:
        self._start = start  # [ns]
        self._decoders = decoders
        self._numbers: Dict[str, Tuple[array, array]] = {}  # times [s], values row after row
        self._events: Dict[str, List[Event]] = {}
        self._unusable: Dict[str, int] = {}

    def add(self, role: str, connection_id: int, time: int, raw: bytes) -> None:
        if connection_id not in self._decoders:
            return
        try:
            message = self._decoders[connection_id](raw)
            stamp = _stamp(message)
            if role in EVENTS:
                content = EVENTS[role](message)
                event = Event(self._seconds(time), stamp and self._seconds(stamp), content)
                self._events.setdefault(role, []).append(event)
                return
            row = [float(value) for value in ROWS[role][1](message)]
        except Exception:  # untrusted content, decoded by an untrusted definition
            self._unusable[role] = self._unusable.get(role, 0) + 1
            return
        times, values = self._numbers.setdefault(role, (array("d"), array("d")))
        times.append(self._seconds(stamp or time))
        values.extend(row)

    def finish(self, recording: Recording) -> None:
        for role, (times, values) in self._numbers.items():
            table = np.array(values).reshape(len(times), ROWS[role][0])
            finite = np.isfinite(table).all(axis=1) | (role in NAN_MEANS_ABSENT)
            if not finite.all():
                recording.remarks.append(
                    f"{_name(role)}: {np.sum(~finite)} samples are not finite: left out"
                )
            if finite.any():
                recording.rows[role] = Series(np.array(times)[finite], table[finite])
        recording.events = self._events
        for role, count in self._unusable.items():
            recording.remarks.append(f"{_name(role)}: {count} messages cannot be used: left out")

    def _seconds(self, nanoseconds: int) -> float:
        return (nanoseconds - self._start) * 1e-9


def _stamp(message: Any) -> Optional[int]:
    """Return the header's stamp [ns], None where there is none or it is zero."""
    header = getattr(message, "header", None)
    return header and (header.stamp.sec * 10**9 + header.stamp.nanosec or None)


def _name(role: str) -> str:
    return ROLES[role].suffix if role in ROLES else "mav_msgs command"


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())[:160] or type(error).__name__
    return "".join(c for c in text if c.isprintable())
