# SPDX-License-Identifier: MIT
"""Decoders made from the message definitions that a bag carries.

The library builds its decoders by compiling source that it writes from a definition. A bag is
untrusted, so only plain fields reach it: a type, a name, a bounded length; no constants,
comments or defaults.
"""

import re
from typing import Any, NamedTuple, Sequence, Tuple

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from nmpc_control.errors import BagError

_LONGEST_ARRAY = 4096  # elements of a fixed-length array
_LONGEST_DEFINITION = 100_000  # characters
_LINE = re.compile(
    r"\s*(?P<type>(?:[A-Za-z]\w*/)?[A-Za-z]\w*)(?P<array>\[\d{0,5}\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>=|#|$)",
    re.ASCII,
)
_TYPE = re.compile(r"MSG:\s*([A-Za-z]\w*/[A-Za-z]\w*)\s*$", re.ASCII)
_SEPARATOR = "=" * 80


class Decoder(NamedTuple):
    """A message type as the bag itself defines it."""

    msgtype: str
    store: Any  # of the library, with this type and those it needs

    def __call__(self, raw: bytes) -> Any:
        """Return a raw ROS 1 message as an object with the definition's fields."""
        return self.store.deserialize_ros1(raw, self.msgtype)

    def fields(self, msgtype: str) -> Sequence[Tuple[str, Any]]:
        """Return names and descriptions of the fields of this type or of one that it needs."""
        known = getattr(self.store, "fielddefs", None) or self.store.FIELDDEFS  # rosbags 0.9
        return known[msgtype][1]


def decoder(msgtype: str, definition: str) -> Decoder:
    """Return what decodes messages of a type, from the definition that the bag carries.

    Raises:
        BagError: the definition cannot be understood.
    """
    text = plain_definition(definition)
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(text, msgtype))
        store.get_msgdef(msgtype)
    except Exception as error:  # the library's parser raises whatever it stumbles over
        raise BagError(
            f"the definition of {msgtype} cannot be used ({type(error).__name__})"
        ) from None
    return Decoder(msgtype, store)


def plain_definition(definition: str) -> str:
    """Return the definition with nothing but its fields; raises BagError."""
    if len(definition) > _LONGEST_DEFINITION:
        raise BagError(f"a message definition of {len(definition)} characters")
    lines = []
    for line in definition.splitlines():
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if set(text) == {"="}:
            lines.append(_SEPARATOR)
            continue
        name = _TYPE.match(text)
        field = _LINE.match(text)
        if name:
            lines.append(f"MSG: {name.group(1)}")
        elif field is None:
            raise BagError(f"a message definition with the line {text[:60]!r}")
        elif field.group("rest") != "=":
            lines.append(_field(field))
    return "\n".join(lines) + "\n"


def _field(match: "re.Match[str]") -> str:
    array = match.group("array") or ""
    if array not in ("", "[]") and not 0 < int(array[1:-1]) <= _LONGEST_ARRAY:
        raise BagError(f"a message definition with an array of {array[1:-1]} elements")
    return f"{match.group('type')}{array} {match.group('name')}"
