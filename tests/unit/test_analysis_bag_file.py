# SPDX-License-Identifier: MIT
"""Whole, unindexed, cut off and damaged bags: what is read is what the file still holds."""

import bz2
import struct

import lz4.frame
import numpy as np
import pytest
from analysis_bags import BagBuilder, Flight
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Reader, Writer

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.bag_file import BagFile
from nmpc_control.analysis.chunks import decompress
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.errors import BagError

MAGIC = 13  # bytes before the bag's header


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("bags")


@pytest.fixture(scope="module")
def bag(folder):
    return Flight().build().write(folder / "line.bag")


@pytest.fixture(scope="module")
def content(bag):
    return bag.read_bytes()


def stored(path, content):
    path.write_bytes(content)
    return path


def read(path):
    with BagFile(path) as bag:
        return list(bag.messages({c.id for c in bag.connections})), bag.connections, bag.remarks


def without_index(content):
    at = content.index(b"index_pos=") + len(b"index_pos=")
    return content[:at] + bytes(8) + content[at + 8 :]


@pytest.mark.parametrize("compression", [None, *Writer.CompressionFormat])
def test_whole_bag_as_the_library_reads_it(compression, folder):
    path = folder / f"{compression}.bag"
    builder = Flight().build()
    builder.messages = builder.messages[::4]
    builder.write(path, compression)
    with Reader(path) as reader:
        expected = [(c.id, t, bytes(raw)) for c, t, raw in reader.messages()]
        topics = {c.id: (c.topic, c.msgtype, c.msgcount) for c in reader.connections}
        start = reader.start_time
    messages, connections, remarks = read(path)
    assert sorted(messages) == sorted(expected)
    assert {c.id: (c.topic, c.msgtype, c.msgcount) for c in connections} == topics
    assert remarks == []
    with BagFile(path) as bag:
        assert bag.start_time == start


def test_without_an_index_nothing_is_lost(bag, content, folder):
    path = stored(folder / "active.bag", without_index(content))
    with pytest.raises(Exception, match="index"):
        Reader(path).open()
    messages, connections, remarks = read(path)
    assert (messages, connections) == read(bag)[:2]
    assert remarks == ["the bag has no index (its recorder did not end): read as it lies"]
    figures, whole = flight_metrics(read_flight(path)), flight_metrics(read_flight(bag))
    assert figures.pop("missing") == remarks
    assert {**figures, "bag": None, "missing": []} == {**whole, "bag": None}


@pytest.mark.parametrize("is_indexed", [True, False])
def test_clock_that_starts_at_zero(is_indexed, folder):
    builder = BagBuilder(delay=0.0)
    for k in range(100):
        builder.odometry("nmpc/odometry", k / 50.0, (k / 50.0, 0.0, 2.0), (1.0, 0.0, 0.0))
    path = builder.write(folder / f"zero{is_indexed}.bag")
    if not is_indexed:
        stored(path, without_index(path.read_bytes()))
    record = read_flight(path)
    assert record.start_time == 0.0
    assert record.position.times == pytest.approx(np.arange(100) / 50.0, abs=1e-9)
    assert flight_metrics(record)["path_length_m"] == pytest.approx(1.98)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_cut_off_bag_gives_what_came_before(bag, content, share, folder):
    path = stored(folder / "cut.bag", content[: int(share * len(content))])
    messages, _, remarks = read(path)
    whole = read(bag)[0]
    assert messages == whole[: len(messages)]
    assert len(messages) > (share - 0.15) * len(whole)
    assert "index" in remarks[0]
    record = read_flight(path)
    assert len(record.position) > 100
    assert any("index" in sentence for sentence in record.missing)


def test_damaged_chunk_is_left_out_and_said(bag, content, folder):
    chunks = [i for i in range(len(content)) if content.startswith(b"op=\x05", i)]
    at = chunks[0] - 40
    broken = content[:at] + b"\xff" * 60 + content[at + 60 :]
    messages, _, remarks = read(stored(folder / "broken.bag", broken))
    whole = read(bag)[0]
    assert 0 < len(messages) < len(whole)
    assert set(messages) < set(whole)
    assert any("damaged in" in sentence for sentence in remarks)


def test_damaged_index_is_not_needed(bag, content, folder):
    (position,) = struct.unpack_from("<Q", content, content.index(b"index_pos=") + 10)
    broken = content[: position + 4] + b"\xff" * 30 + content[position + 34 :]
    messages, _, remarks = read(stored(folder / "index.bag", broken))
    assert messages == read(bag)[0]
    assert "the bag's index is damaged: read as it lies" in remarks


@pytest.mark.parametrize(("name", "pack"), [("bz2", bz2.compress), ("lz4", lz4.frame.compress)])
def test_chunk_that_unpacks_to_more_than_it_says_is_bounded(name, pack):
    fields = {b"compression": name.encode(), b"size": struct.pack("<I", 1000)}
    unpacked, _ = decompress(fields, pack(bytes(50_000_000)))
    assert len(unpacked) == 1000
    half, is_whole = decompress(fields, pack(bytes(range(250)) * 4)[:-20])
    assert not is_whole
    assert (bytes(range(250)) * 4).startswith(half)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_damage_gives_figures_or_one_clear_error(small, folder, data):
    content = bytearray(small)
    for _ in range(data.draw(st.integers(0, 8))):
        at = data.draw(st.integers(0, len(content) - 1))
        width = data.draw(st.integers(1, 30))
        content[at : at + width] = data.draw(st.binary(max_size=40))
    cut = content[: data.draw(st.integers(0, len(content)))]
    try:
        figures = flight_metrics(read_flight(stored(folder / "any.bag", bytes(cut))))
    except BagError as error:
        assert str(error)
        assert "\n" not in str(error)
    else:
        assert figures["average_deviation_m"] is None or figures["average_deviation_m"] >= 0.0


@pytest.fixture(scope="module")
def small(folder):
    """Return a bag of 20 kB with a message of every kind."""
    builder = Flight().build()
    kept = {}
    for message in builder.messages:
        group = kept.setdefault(message[0], [])
        if len(group) < 8 and message[2] > Flight.start:
            group.append(message)
    other = BagBuilder()
    other.messages = [m for group in kept.values() for m in group] + [
        m for m in builder.messages if m[0].endswith(("trajectory", "obstacles"))
    ]
    return other.write(folder / "small.bag").read_bytes()
