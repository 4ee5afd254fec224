# SPDX-License-Identifier: MIT
"""Messages decoded many at a time equal those decoded one by one, also of a long synthetic bag."""

import long_bag
import numpy as np
import pytest
from analysis_bags import STORE, BagBuilder, Flight
from rosbags.rosbag1 import Reader

from nmpc_control.analysis import deviation
from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.columns import batches
from nmpc_control.analysis.definitions import decoder
from nmpc_control.analysis.messages import ROWS
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.recording import read
from nmpc_control.analysis.topics import select

SECONDS = 20.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return long_bag.write(tmp_path_factory.mktemp("bags") / "long.bag", SECONDS)


def test_figures_of_the_synthetic_flight(bag):
    metrics = flight_metrics(read_flight(bag))
    assert metrics["average_deviation_m"] == pytest.approx(long_bag.OFFSET, abs=1e-4)
    assert metrics["cross_track_m"]["max"] == pytest.approx(long_bag.OFFSET, abs=1e-4)
    assert metrics["along_track_m"]["max"] == pytest.approx(0.0, abs=1e-2)
    outside = long_bag.RADIUS + long_bag.OFFSET
    assert metrics["path_length_m"] == pytest.approx(SECONDS * outside / long_bag.RADIUS, abs=0.1)
    assert metrics["clearance_m"]["post"] == pytest.approx(outside - 1.0 - 0.5, abs=1e-3)
    rates = {name: stream["rate_hz"] for name, stream in metrics["streams"].items()}
    for name, rate in long_bag.RATES.items():
        assert rates.get(name, rate) == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize("which", ["flight", "long"])
def test_rows_equal_those_of_single_messages(which, bag, tmp_path):
    path = bag if which == "long" else Flight().build().write(tmp_path / "line.bag")
    rows = read(path).rows
    with Reader(path) as reader:
        chosen = select(reader.connections).connections
        for role in rows:
            messages = list(reader.messages(chosen[role]))[::7]
            single = [STORE.deserialize_ros1(raw, c.msgtype) for c, _, raw in messages]
            expected = np.array([[float(v) for v in ROWS[role][1](m)] for m in single])
            np.testing.assert_array_equal(rows[role].values[::7], expected, err_msg=role)
            if hasattr(single[0], "header"):
                stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in single]
                start = reader.start_time * 1e-9
                assert rows[role].times[::7] == pytest.approx(np.array(stamps) - start, abs=1e-6)


def test_messages_of_different_lengths_and_broken_ones(tmp_path):
    builder = BagBuilder()
    for k in range(60):
        builder.status(10.0 + k, 3, reason="because " * (k % 4), plans_rejected=k)
    raws = [raw for _, _, _, raw in builder.messages]
    raws[7], raws[20], raws[33] = raws[7][:-3], raws[20] + b"x", b""
    msgtype = "nmpc_msgs/msg/ControllerStatus"
    path = builder.write(tmp_path / "status.bag")
    with Reader(path) as reader:
        definition = reader.connections[0].msgdef
    used = decoder(msgtype, getattr(definition, "data", definition))
    found = {}
    for numbers, batch in batches(used.fields, msgtype, raws):
        found.update(zip(numbers.tolist(), batch.plans_rejected.tolist()))
    assert found == {k: k for k in range(60) if k not in (7, 20, 33)}


def test_deviation_from_a_very_long_path_is_nearly_the_exact_one(monkeypatch):
    random = np.random.default_rng(1)
    curve = np.cumsum(random.normal(0.0, 0.2, (400, 3)), axis=0)
    points = curve[::2] + random.normal(0.0, 0.5, (200, 3))
    exact = deviation.path_deviation(points, curve)
    monkeypatch.setattr(deviation, "_MOST_PAIRS", 10)
    nearly = deviation.path_deviation(points, curve)
    assert (nearly >= exact - 1e-12).all()
    assert (nearly - exact).max() < 0.0025


def test_topic_without_messages_is_named(tmp_path):
    builder = Flight().build()
    builder.empty = [("/dji_sdk/rc", "sensor_msgs/msg/Joy")]
    record = read_flight(builder.write(tmp_path / "empty.bag"))
    assert "topics without messages: /dji_sdk/rc" in record.missing
