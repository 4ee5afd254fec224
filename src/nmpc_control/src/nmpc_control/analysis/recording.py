# SPDX-License-Identifier: MIT
"""Reading a ROS 1 bag without ROS: rows of numbers by role, on one clock that starts with the bag.

Header stamps are used where a message has one, the time of recording otherwise.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Optional

from nmpc_control.analysis.bag_file import BagFile, Connection
from nmpc_control.analysis.collector import Collector, Event
from nmpc_control.analysis.definitions import Decoder, decoder
from nmpc_control.analysis.messages import text
from nmpc_control.analysis.record import Series
from nmpc_control.analysis.topics import ROLES, Selection, select
from nmpc_control.errors import BagError

# From messages and their number to the same messages
Progress = Callable[[Iterable[Any], int], Iterable[Any]]


@dataclass
class Recording:
    """What a bag says about one vehicle; times in s since the bag's first message."""

    selection: Selection
    rows: Dict[str, Series] = field(default_factory=dict)
    events: Dict[str, List[Event]] = field(default_factory=dict)
    remarks: List[str] = field(default_factory=list)  # what was left out, and why
    start_time: float = 0.0  # [s] of the bag's first message, since 1970 or of the simulation


def read(
    path: Path, namespace: Optional[str] = None, progress: Optional[Progress] = None
) -> Recording:
    """Return what a bag holds, of a damaged one as much as can be read.

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
        with BagFile(path) as bag:
            return _read(bag, namespace, progress or (lambda messages, _: messages))
    except PermissionError:
        raise BagError("cannot be opened: permission denied") from None
    except OSError as error:
        raise BagError(f"cannot be read: {error.strerror or error}") from None


def _read(bag: BagFile, namespace: Optional[str], progress: Progress) -> Recording:
    connections = bag.connections
    if not any(c.msgcount for c in connections):
        raise BagError("; ".join(["the bag holds no messages", *bag.remarks]))
    recording = Recording(select(connections, namespace), start_time=bag.start_time * 1e-9)
    recording.remarks.extend(recording.selection.remarks)
    roles = {c.id: role for role, group in recording.selection.connections.items() for c in group}
    if not roles:
        expected = ", ".join(
            ROLES[role].suffix for role in ("odometry", "status", "setpoint", "imu")
        )
        raise BagError(f"no topic that can be evaluated (expected names like {expected})")
    used = [c for c in connections if c.id in roles]
    collector = Collector(bag.start_time, roles, _decoders(used, recording))
    count = sum(c.msgcount for c in used)
    for connection_id, time, raw in progress(bag.messages(roles), count):
        collector.add(connection_id, time, raw)
    numbers, recording.events, left_out = collector.finish()
    recording.rows = {role: Series(times, values) for role, (times, values) in numbers.items()}
    recording.remarks.extend(bag.remarks + left_out)
    if collector.count < count:
        recording.remarks.append(f"{count - collector.count} of {count} messages cannot be read")
    empty = sorted({c.topic for c in used if not c.msgcount})
    if empty:
        recording.remarks.append(f"topics without messages: {', '.join(map(text, empty))}")
    return recording


def _decoders(connections: List[Connection], recording: Recording) -> Dict[int, Decoder]:
    decoders: Dict[int, Decoder] = {}
    for connection in connections:
        try:
            decoders[connection.id] = decoder(connection.msgtype, connection.definition)
        except BagError as error:
            recording.remarks.append(f"{connection.topic}: {error}: not read")
    return decoders
