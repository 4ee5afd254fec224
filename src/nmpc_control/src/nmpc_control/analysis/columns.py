# SPDX-License-Identifier: MIT
"""Messages that look alike, decoded together: every field of all of them is one array.

In a serialised ROS 1 message only strings and arrays of variable length move what follows them.
Messages in which all such lengths agree have every number at the same place.
"""

from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Sequence, Tuple, Union

import numpy as np
from rosbags.interfaces import Nodetype

_MOST_ELEMENTS = 100_000  # lengths, and messages inside a message, that are followed

Definitions = Callable[[str], Sequence[Tuple[str, Any]]]  # from a type to its fields


class _Numbers(NamedTuple):
    """Where numbers of one field lie."""

    start: int  # [bytes]
    dtype: np.dtype
    count: int  # 0: not an array


Field = Union[_Numbers, "Dict[str, Field]"]


class Batch:
    """Messages as one object: fields are arrays (n,), arrays of numbers are (k, n)."""

    def __init__(self, fields: "Dict[str, Field]", table: np.ndarray) -> None:
        self._fields = fields
        self._table = table  # (n, bytes)

    def __getattr__(self, name: str) -> Any:
        try:
            field = self._fields[name]
        except KeyError:
            raise AttributeError(name) from None
        if isinstance(field, dict):
            return Batch(field, self._table)
        size = field.dtype.itemsize * max(field.count, 1)
        part = np.ascontiguousarray(self._table[:, field.start : field.start + size])
        values = part.view(field.dtype)
        if field.dtype.kind in "iu":
            values = values.astype(np.int64)
        return values[:, 0] if field.count == 0 else values.T


def batches(
    definitions: Definitions, msgtype: str, messages: Sequence[bytes]
) -> Iterator[Tuple[np.ndarray, Batch]]:
    """Yield the numbers (n,) of messages that look alike, and those messages as one object.

    A message that its definition does not fit is in none of them.
    """
    sizes = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
    for size in np.unique(sizes):
        left = np.flatnonzero(sizes == size)
        content = b"".join(messages[i] for i in left)
        table = np.frombuffer(content, np.uint8).reshape(len(left), size)
        while len(left):
            try:
                layout = _Layout(definitions, msgtype, messages[left[0]])
            except (ValueError, IndexError, KeyError):
                left, table = left[1:], table[1:]
                continue
            alike = layout.fits(table)
            yield left[alike], Batch(layout.fields, table[alike])
            left, table = left[~alike], table[~alike]


class _Layout:
    """Where the fields of one message lie; raises ValueError where its definition does not fit."""

    def __init__(self, definitions: Definitions, msgtype: str, message: bytes) -> None:
        self._definitions = definitions
        self._message = message
        self._lengths: List[int] = []  # places [bytes] of all lengths
        self._elements = 0
        self.fields, end = self._walk(msgtype, 0)
        if end != len(message):
            raise ValueError("longer than its definition")

    def fits(self, table: np.ndarray) -> np.ndarray:
        """Return which rows (n, bytes) have the same lengths at the same places."""
        places = np.array(self._lengths, dtype=int)[:, None] + np.arange(4)
        part = table[:, places.ravel()]
        fitting = (part == part[0]).all(axis=1)
        fitting[0] = True
        return fitting

    def _walk(self, msgtype: str, at: int) -> "Tuple[Dict[str, Field], int]":
        fields: "Dict[str, Field]" = {}
        for name, (kind, detail) in self._definitions(msgtype):
            if kind == Nodetype.NAME:
                fields[name], at = self._walk(detail, at)
            elif kind == Nodetype.BASE:
                if detail[0] == "string":
                    at = self._length(at)[1]
                else:
                    fields[name] = _Numbers(at, _dtype(detail[0]), 0)
                    at = self._skip(at, fields[name].dtype.itemsize)
            else:
                count = detail[1]
                if kind == Nodetype.SEQUENCE:
                    count = self._count(at)
                    at += 4
                at = self._array(fields, name, detail[0], count, at)
        return fields, at

    def _array(
        self, fields: "Dict[str, Field]", name: str, element: Any, count: int, at: int
    ) -> int:
        kind, detail = element
        is_number = kind == Nodetype.BASE and detail[0] != "string"
        if is_number:
            numbers = _Numbers(at, _dtype(detail[0]), count)
            if count:
                fields[name] = numbers
            return self._skip(at, numbers.dtype.itemsize * count)
        for _ in range(count):
            self._elements += 1
            if self._elements > _MOST_ELEMENTS:
                raise ValueError("too many elements")
            at = self._walk(detail, at)[1] if kind == Nodetype.NAME else self._length(at)[1]
        return at

    def _count(self, at: int) -> int:
        end = self._skip(at, 4)
        self._lengths.append(at)
        return int.from_bytes(self._message[at:end], "little")

    def _length(self, at: int) -> Tuple[int, int]:
        """Return the length of a string and where it ends."""
        length = self._count(at)
        return length, self._skip(at + 4, length)

    def _skip(self, at: int, size: int) -> int:
        if at + size > len(self._message):
            raise ValueError("shorter than its definition")
        return at + size


def _dtype(name: str) -> np.dtype:
    names = {"bool": "uint8", "byte": "uint8", "octet": "uint8", "char": "uint8"}
    return np.dtype(names.get(name, name)).newbyteorder("<")
