# SPDX-License-Identifier: MIT
"""Recorded flights of an M100 with other commands and no controller; figures recomputed here."""

import numpy as np
import pytest
from analysis_bags import REPOSITORY
from rosbags.highlevel import AnyReader

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.metrics import flight_metrics

DATA = REPOSITORY.parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded flights in {DATA}")


def raw(name, topic):
    """Return header stamps [s] and messages, read by the library alone."""
    with AnyReader([DATA / name]) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        found = [reader.deserialize(r, c.msgtype) for c, _, r in reader.messages(connections)]
    return np.array([m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in found]), found


@pytest.fixture(scope="module")
def metrics():
    return flight_metrics(read_flight(DATA / "m100exp03.bag"))


def test_airborne_as_the_facts_say(metrics):
    start, end = metrics["window_s"]
    assert start == pytest.approx(5.0, abs=1.0)
    assert end == pytest.approx(75.0, abs=2.5)
    assert metrics["airborne_time_s"] == pytest.approx(end - start)


def test_commands_equal_recomputation(metrics):
    topic = "/raven/command/roll_pitch_yawrate_thrust"
    stamps, messages = raw("m100exp03.bag", topic)
    first = raw("m100exp03.bag", "/dji_sdk/imu")[0][0]
    start, end = metrics["window_s"]
    # The bag's clock starts with its first recording, within a millisecond of that imu's stamp.
    inside = (stamps - first >= start - 0.001) & (stamps - first <= end + 0.001)
    thrust = np.array([m.thrust.z for m in messages])[inside]
    assert metrics["thrust_percent"] == pytest.approx([thrust.min(), thrust.max()])
    assert metrics["command_gap_ms_max"] == pytest.approx(1e3 * np.diff(stamps[inside]).max())
    assert metrics["command_rate_hz"] == pytest.approx(50.0, abs=0.1)


def test_speed_and_tilt_equal_recomputation(metrics):
    _, velocities = raw("m100exp03.bag", "/dji_sdk/velocity")
    speed = max(np.linalg.norm([m.vector.x, m.vector.y, m.vector.z]) for m in velocities)
    assert metrics["speed_m_s"]["max"] == pytest.approx(speed)
    _, imu = raw("m100exp03.bag", "/dji_sdk/imu")
    up = [1.0 - 2.0 * (m.orientation.x**2 + m.orientation.y**2) for m in imu]
    assert metrics["tilt_rad"]["max"] == pytest.approx(np.arccos(min(up)), abs=1e-6)


def test_says_what_it_is_and_what_is_missing(metrics):
    assert metrics["source"] == "hil"
    for key in ("average_deviation_m", "navigation_time_s", "solve_time_ms", "clearance_m"):
        assert metrics[key] is None
    missing = " ".join(metrics["missing"])
    for word in ("reference", "solver", "obstacles", "positions", "mav_msgs", "flight_status"):
        assert word in missing


def test_other_recording_is_hil_too():
    metrics = flight_metrics(read_flight(DATA / "m100exp01.bag"))
    assert metrics["source"] == "hil"
    assert metrics["tilt_rad"]["max"] < 0.2  # the regime with limited attitude
