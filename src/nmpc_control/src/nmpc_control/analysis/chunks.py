# SPDX-License-Identifier: MIT
"""Records of a ROS 1 bag and what a chunk holds. Source: ROS wiki, Bags/Format/2.0."""

import bz2
import struct
from typing import Dict, Iterator, NamedTuple, Optional, Tuple

import lz4.frame

MESSAGE, CHUNK, CHUNK_INFO, CONNECTION = 0x02, 0x05, 0x06, 0x07  # values of op
_LARGEST_CHUNK = 1 << 28  # [bytes] unpacked
_TIME = struct.Struct("<II").unpack_from  # [s], [ns]
_U32 = struct.Struct("<I").unpack_from

Fields = Dict[bytes, bytes]


class Record(NamedTuple):
    """A record; positions are those of the file or the chunk."""

    operation: int
    fields: Fields
    data: bytes
    data_start: int
    end: int


def u32(data: bytes, at: int) -> int:
    """Return the unsigned number at a position; raises struct.error beyond the end."""
    return _U32(data, at)[0]


def fields_of(header: bytes) -> Optional[Fields]:
    """Return name and value of each field; None if it is no header."""
    fields: Fields = {}
    at = 0
    while at + 4 <= len(header):
        end = at + 4 + u32(header, at)
        name, separator, value = header[at + 4 : end].partition(b"=")
        if not separator or end > len(header):
            return None
        fields[name] = value
        at = end
    return fields if at == len(header) else None


def decompress(fields: Fields, data: bytes) -> Tuple[bytes, bool]:
    """Return what a chunk holds, as far as it can be unpacked, and whether that is all of it."""
    size = int.from_bytes(fields.get(b"size", b""), "little")
    kind = fields.get(b"compression")
    if kind == b"none":
        content = data
    elif kind not in (b"bz2", b"lz4") or size > _LARGEST_CHUNK:
        content = b""
    else:
        content = _unpack(kind, data, size)
    return content, len(content) == size


def _unpack(kind: bytes, data: bytes, size: int) -> bytes:
    unpacker = bz2.BZ2Decompressor() if kind == b"bz2" else lz4.frame.LZ4FrameDecompressor()
    parts, length = [], 0
    try:
        while length < size and not unpacker.eof:
            part = unpacker.decompress(data if not parts else b"", max_length=size - length)
            if not part and parts:
                break
            parts.append(part)
            length += len(part)
    except (OSError, RuntimeError, ValueError):  # damaged: keep what came before
        pass
    return b"".join(parts)


def records_of(chunk: bytes) -> Iterator[Record]:
    """Yield the records of a chunk up to the first that is cut or damaged."""
    at = 0
    while at + 8 <= len(chunk):
        data_at = at + 4 + u32(chunk, at)
        if data_at + 4 > len(chunk):
            return
        end = data_at + 4 + u32(chunk, data_at)
        fields = fields_of(chunk[at + 4 : data_at])
        if end > len(chunk) or not fields or len(fields.get(b"op", b"")) != 1:
            return
        yield Record(fields[b"op"][0], fields, chunk[data_at + 4 : end], data_at + 4, end)
        at = end


def messages_of(chunk: bytes) -> Iterator[Tuple[int, int, bytes]]:
    """Yield connection, time [ns] and content of the messages; the rest after damage is lost.

    A recorder writes all headers alike: where conn and time stand is looked up once a length.
    """
    at, end = 0, len(chunk)
    known_size, conn_at, time_at = -1, 0, 0
    while at + 8 <= end:
        (size,) = _U32(chunk, at)
        data_at = at + 4 + size
        if data_at + 4 > end:
            return
        start = data_at + 4
        next_at = start + _U32(chunk, data_at)[0]
        if next_at > end:
            return
        if (
            size != known_size
            or chunk[at + conn_at - 5 : at + conn_at] != b"conn="
            or chunk[at + time_at - 5 : at + time_at] != b"time="
        ):
            fields = fields_of(chunk[at + 4 : data_at])
            if fields is None:
                return
            known_size = -1
            if fields.get(b"op") == bytes([MESSAGE]) and _is_plain(fields):
                known_size = size
                conn_at = 4 + chunk[at + 4 : data_at].index(b"conn=") + 5
                time_at = 4 + chunk[at + 4 : data_at].index(b"time=") + 5
        if size == known_size:
            seconds, nanoseconds = _TIME(chunk, at + time_at)
            yield (
                _U32(chunk, at + conn_at)[0],
                seconds * 10**9 + nanoseconds,
                chunk[start:next_at],
            )
        at = next_at


def _is_plain(fields: Fields) -> bool:
    """Return whether the fields are those of a message, with values that cannot be mistaken."""
    return (
        set(fields) == {b"op", b"conn", b"time"}
        and len(fields[b"conn"]) == 4
        and len(fields[b"time"]) == 8
    )
