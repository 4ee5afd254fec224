# SPDX-License-Identifier: MIT
"""Message definitions of a bag: what passes is plain fields, what is hostile is refused."""

import re

import pytest
from analysis_bags import FIELDS, STORE, Flight

from nmpc_control.analysis.definitions import decoder, plain_definition
from nmpc_control.errors import BagError

SAMPLES = {m[1]: m[3] for m in Flight().build().messages}  # a raw message of every type


@pytest.mark.parametrize("msgtype", SAMPLES)
def test_decodes_like_the_library(msgtype):
    definition, _ = STORE.generate_msgdef(msgtype)
    decoded = decoder(msgtype, definition)(SAMPLES[msgtype])
    expected = STORE.deserialize_ros1(SAMPLES[msgtype], msgtype)
    constant = re.compile(r", [A-Z_]+=\d+")  # in the library's texts only
    for name, _ in FIELDS[msgtype][1]:
        text = constant.sub("", repr(getattr(expected, name)))
        assert repr(getattr(decoded, name)) == text


def test_constants_comments_and_space_are_left_out():
    text = (
        "uint8 A=1 # one\nstring S=a # b = c\n\n  # note\n float64[3]  x  # [m] = metres\nbool b\n"
    )
    assert plain_definition(text) == "float64[3] x\nbool b\n"


def test_other_types_follow_their_separator():
    text = "Header header\n" + "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\n"
    assert plain_definition(text).splitlines()[1:3] == ["=" * 80, "MSG: std_msgs/Header"]


@pytest.mark.parametrize(
    "line",
    [
        "float64 x; import os",
        "float64 x\x0b__import__('os').system('true')",
        "float64 __class__()",
        "float64[99999] x",
        "float64[0] x",
        "float64[-1] x",
        "../../evil x",
        "MSG: std_msgs/msg/../Header",
        "float64 x 5",
        "@verbatim x",
        "float64 ünïcode",
    ],
)
def test_anything_else_is_refused(line):
    with pytest.raises(BagError, match="definition"):
        plain_definition("bool good\n" + line + "\n")


def test_endless_definition_is_refused():
    with pytest.raises(BagError, match="characters"):
        plain_definition("bool b\n" * 50_000)


def test_unknown_type_inside_is_refused():
    with pytest.raises(BagError, match="a_msgs/msg/A"):
        decoder("a_msgs/msg/A", "b_msgs/B field\n")
