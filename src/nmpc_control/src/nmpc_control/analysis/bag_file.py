# SPDX-License-Identifier: MIT
"""A ROS 1 bag as it lies on the disk: its connections and raw messages, as far as it is whole.

Source: ROS wiki, Bags/Format/2.0. The index is used for what it tells beforehand and never needed:
a bag without one, cut off or damaged gives the messages that can still be read.
"""

import re
import struct
from pathlib import Path
from typing import Any, BinaryIO, Collection, Dict, Iterator, List, NamedTuple, Optional, Tuple

from nmpc_control.analysis.chunks import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    Fields,
    Record,
    decompress,
    fields_of,
    messages_of,
    records_of,
    u32,
)
from nmpc_control.errors import BagError

MAGIC = b"#ROSBAG V2.0\n"
_MOST_CONNECTIONS = 10_000
_LARGEST_HEADER = 1 << 20  # [bytes] of a record; a definition is its data, not its header
_LARGEST_DATA = 1 << 28  # [bytes] of a record
_CHUNK_MARK = re.compile(b"op=\x05", re.DOTALL)
_LONGEST_CHUNK_HEADER = 100  # [bytes]

RawMessage = Tuple[int, int, bytes]  # connection, time of recording [ns], content


class Connection(NamedTuple):
    """A topic that one publisher wrote to."""

    id: int
    topic: str
    msgtype: str  # package/msg/Name
    definition: str
    msgcount: int


class BagFile:
    """An open bag; ``remarks`` says in plain words what is wrong with it.

    Raises:
        BagError: it is no ROS 1 bag of format 2.0.
    """

    def __init__(self, path: Path) -> None:
        self.remarks: List[str] = []
        self._found: Dict[int, Tuple[str, str, str]] = {}
        self._counts: Dict[int, int] = {}
        self.start_time = 0  # [ns] of the first message; 0 is a time too: simulations begin there
        self._file: BinaryIO = path.open("rb")
        self._size = path.stat().st_size
        try:
            if self._file.read(len(MAGIC)) != MAGIC:
                raise BagError("not a ROS 1 bag: it does not begin with #ROSBAG V2.0")
            if not self._read_index():
                self._scan()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "BagFile":
        return self

    def __exit__(self, *_: Any) -> None:
        self._file.close()

    @property
    def connections(self) -> List[Connection]:
        """Return all topics, with the number of messages of each."""
        counts = self._counts
        return [Connection(i, *self._found[i], counts.get(i, 0)) for i in sorted(self._found)]

    def messages(self, wanted: Collection[int]) -> Iterator[RawMessage]:
        """Yield the messages of some connections in the order of the file."""
        for chunk in self._chunks():
            for identifier, time, raw in messages_of(chunk):
                if identifier in wanted:
                    yield identifier, time, raw

    def _read_index(self) -> bool:
        """Return whether connections, counts and the start are known from an intact index."""
        header = self._record(len(MAGIC))
        position = header and _number(header.fields, b"index_pos", 8)
        if not position or not len(MAGIC) < position < self._size:
            self.remarks.append("the bag has no index (its recorder did not end): read as it lies")
            return False
        starts, used = [], []  # of all chunks, of those with messages
        while position < self._size:
            record = self._record(position, with_data=True)
            if record is None:
                break
            if record.operation == CONNECTION:
                self._add_connection(record.fields, record.data)
            elif record.operation == CHUNK_INFO:
                starts.append(_number(record.fields, b"start_time", 8))
                messages = 0
                for at in range(0, len(record.data) - 7, 8):
                    identifier, count = u32(record.data, at), u32(record.data, at + 4)
                    self._counts[identifier] = self._counts.get(identifier, 0) + count
                    messages += count
                used += starts[-1:] if messages else []
            position = record.end
        expected = (
            _number(header.fields, b"conn_count", 4),
            _number(header.fields, b"chunk_count", 4),
        )
        if (len(self._found), len(starts)) != expected or None in starts:
            self.remarks.append("the bag's index is damaged: read as it lies")
            self._found, self._counts = {}, {}
            return False
        self.start_time = min(map(_nanoseconds, used), default=0)
        return True

    def _scan(self) -> None:
        """Find connections, counts and the start without an index."""
        first: Optional[int] = None
        for chunk in self._chunks(is_remarked=False):
            for record in records_of(chunk):
                if record.operation == CONNECTION:
                    self._add_connection(record.fields, record.data)
            for identifier, time, _ in messages_of(chunk):
                self._counts[identifier] = self._counts.get(identifier, 0) + 1
                first = time if first is None else min(first, time)
        self.start_time = first or 0

    def _add_connection(self, fields: Fields, data: bytes) -> None:
        identifier, inner = _number(fields, b"conn", 4), fields_of(data)
        if identifier is None or inner is None or len(self._found) >= _MOST_CONNECTIONS:
            return
        topic, msgtype, definition = (
            (source.get(key, b"")).decode("utf-8", "replace")
            for source, key in (
                (fields, b"topic"),
                (inner, b"type"),
                (inner, b"message_definition"),
            )
        )
        if "/msg/" not in msgtype:
            msgtype = msgtype.replace("/", "/msg/", 1)
        self._found[identifier] = (topic, msgtype, definition)

    def _chunks(self, is_remarked: bool = True) -> Iterator[bytes]:
        """Yield the content of every chunk, the readable part of one that is cut or damaged."""
        position, lost = len(MAGIC), 0
        while position + 8 <= self._size:
            record = self._record(position)
            if record is None:
                lost += 1
                position = self._next_chunk(position + 1)
                continue
            if record.operation == CHUNK:
                self._file.seek(record.data_start)
                data = self._file.read(min(record.end, self._size) - record.data_start)
                content, is_whole = decompress(record.fields, data)
                lost += not is_whole
                yield content
            position = record.end
        is_cut = position != self._size
        if is_remarked and lost:
            self.remarks.append(f"damaged in {lost} places: what cannot be read there is left out")
        elif is_remarked and is_cut:
            self.remarks.append("the bag is cut off: what was recorded before is evaluated")

    def _record(self, position: int, with_data: bool = False) -> Optional[Record]:
        """Return a record of the file, which may reach beyond its end; None if it is none."""
        self._file.seek(position)
        size = self._file.read(4)
        if len(size) < 4 or u32(size, 0) > _LARGEST_HEADER:
            return None
        header = self._file.read(u32(size, 0))
        fields, size = fields_of(header), self._file.read(4)
        if not fields or len(fields.get(b"op", b"")) != 1 or len(size) < 4:
            return None
        start, length = position + 8 + len(header), u32(size, 0)
        if length > _LARGEST_DATA:
            return None
        data = self._file.read(length) if with_data else b""
        return Record(fields[b"op"][0], fields, data, start, start + length)

    def _next_chunk(self, position: int) -> int:
        """Return where the next record that says it is a chunk begins; the end without one."""
        step, overlap = 1 << 20, _LONGEST_CHUNK_HEADER
        while position < self._size:
            self._file.seek(position)
            window = self._file.read(step + overlap)
            for mark in _CHUNK_MARK.finditer(window):
                first = max(0, mark.start() - overlap)
                for at in range(first, mark.start()):
                    record = self._record(position + at) if _is_size(window, at) else None
                    if record is not None and record.operation == CHUNK:
                        return position + at
            position += step
        return self._size


def _is_size(window: bytes, at: int) -> bool:
    """Return whether the four bytes can be the length of a chunk's header."""
    return at + 4 <= len(window) and 20 <= u32(window, at) <= _LONGEST_CHUNK_HEADER


def _number(fields: Fields, key: bytes, size: int) -> Optional[int]:
    value = fields.get(key, b"")
    return int.from_bytes(value, "little") if len(value) == size else None


def _nanoseconds(time: int) -> int:
    seconds, nanoseconds = struct.unpack("<II", struct.pack("<Q", time))
    return seconds * 10**9 + nanoseconds
