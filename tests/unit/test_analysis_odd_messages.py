# SPDX-License-Identifier: MIT
"""Bags whose messages are odd: not finite, out of order, of another type or another meaning."""

import numpy as np
import pytest
from analysis_bags import FLYING, BagBuilder, Flight

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.recording import read


@pytest.fixture(scope="module")
def flight():
    return Flight().build()


@pytest.fixture(scope="module")
def bag(flight, tmp_path_factory):
    return flight.write(tmp_path_factory.mktemp("bags") / "line.bag")


@pytest.fixture(scope="module")
def metrics(bag):
    return flight_metrics(read_flight(bag))


def test_samples_that_are_not_finite_are_left_out_and_counted(flight, metrics, tmp_path):
    builder = flight.without("nothing")
    for k in range(7):
        bad = (np.nan, 0.0, 0.0) if k % 2 else (0.0, np.inf, 0.0)
        builder.odometry("nmpc/odometry", 111.001 + k, bad, (0.0, 0.0, 0.0))
    builder.plan(115.0, 1000, np.nan)
    figures = flight_metrics(read_flight(builder.write(tmp_path / "nan.bag")))
    assert figures["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert figures["solver_iterations_mean"] == metrics["solver_iterations_mean"]
    assert figures["missing"] == [
        "nmpc/odometry: 7 samples are not finite: left out",
        "nmpc/plan: 1 samples are not finite: left out",
    ]


def test_stamps_out_of_order_are_sorted(flight, metrics, tmp_path):
    builder = BagBuilder()
    order = np.random.default_rng(0).permutation(len(flight.messages))
    recorded = sorted(m[2] for m in flight.messages)
    shuffled = [flight.messages[i] for i in order]
    stamped = [m for m in shuffled if not m[0].endswith(("flight_status", "nmpc/trajectory"))]
    rest = [m for m in shuffled if m[0].endswith(("flight_status", "nmpc/trajectory"))]
    builder.messages = [(a, b, t, v) for (a, b, _, v), t in zip(stamped, recorded)] + rest
    figures = flight_metrics(read_flight(builder.write(tmp_path / "shuffled.bag")))
    for key in ("average_deviation_m", "command_gap_ms_max", "navigation_time_s", "total_time_s"):
        assert figures[key] == pytest.approx(metrics[key], abs=1e-6), key


def test_meaning_of_a_setpoint_is_in_its_flag(tmp_path):
    builder = BagBuilder()
    for k in range(100):
        builder.status(100.0 + 0.02 * k, FLYING)
    builder.setpoint(100.0, 0.1, 0.2, 37.0, 0.3, flag=0x2B)
    builder.setpoint(100.5, 9.0, 9.0, 99.0, 9.0, flag=0x49)  # velocities
    builder.setpoint(101.0, 0.4, 0.5, 88.0, 0.6, flag=0x0B)  # attitude and vertical velocity
    record = read_flight(builder.write(tmp_path / "flags.bag"))
    expected = [[37.0, 0.1, 0.2, 0.3], [np.nan, np.nan, np.nan, 9.0], [np.nan, 0.4, 0.5, 0.6]]
    np.testing.assert_allclose(record.commands.values, expected, atol=1e-6)
    figures = flight_metrics(record)
    assert figures["thrust_percent"] == pytest.approx([37.0, 37.0])
    # 980 ms from the last of them to the last status
    assert figures["command_gap_ms_max"] == pytest.approx(980.0, abs=1e-3)


def test_setpoints_without_meaning_are_counted(flight, tmp_path):
    builder = flight.without("nothing")
    topic = "dji_sdk/flight_control_setpoint_generic"
    for axes in ([0.1, 0.2], [0.0, np.nan, 38.0, 0.0, 43.0]):
        builder.add(topic, "sensor_msgs/msg/Joy", 112.0, {"axes": axes})
    missing = read_flight(builder.write(tmp_path / "short.bag")).missing
    assert missing == (
        f"{topic}: 1 samples are not finite: left out",
        f"{topic}: 1 messages cannot be used: left out",
    )


def test_trajectory_whose_clock_never_started_is_named(flight, tmp_path):
    builder = flight.without("nmpc/trajectory")
    builder.trajectory(106.0, 0.0, "never", [0.0, 1.0], [[0, 0, 2], [1, 0, 2]])
    figures = flight_metrics(read_flight(builder.write(tmp_path / "never.bag")))
    assert figures["scenario"] == "never"
    assert figures["average_deviation_m"] is None


def test_unusable_trajectory_and_obstacles_are_counted(flight, tmp_path):
    builder = flight.without("nmpc/trajectory", "nmpc/obstacles")
    builder.trajectory(106.0, 110.0, "bad", [0.0, 1.0], [[0, 0, 2], [np.nan, 0, 2]])
    builder.obstacles(98.0, [("ball", (0.0, 0.0, np.inf), 0.5)])
    builder.obstacles(99.0, [("ball", (0.0, 0.0, 0.0), -0.5)])
    figures = flight_metrics(read_flight(builder.write(tmp_path / "bad.bag")))
    assert "nmpc/trajectory: 1 messages cannot be used: left out" in figures["missing"]
    assert "nmpc/obstacles: 2 messages cannot be used: left out" in figures["missing"]
    assert figures["clearance_m"] is None


def test_topic_of_another_type_is_named(flight, tmp_path):
    builder = flight.without("nmpc/plan")
    builder.add("nmpc/plan", "std_msgs/msg/String", 100.0, {"data": "plan"})
    figures = flight_metrics(read_flight(builder.write(tmp_path / "type.bag")))
    assert "/nmpc/plan has type std_msgs/msg/String: not read" in figures["missing"]
    assert figures["solver_iterations_mean"] is None


def test_stamps_of_another_clock_are_named(flight, tmp_path):
    builder = flight.without("dji_sdk/battery_state")
    for k in range(20):
        values = {"header": {"stamp": {"sec": 5 + k, "nanosec": 0}}, "percentage": 80.0}
        builder.add("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState", 105.0 + k, values)
    missing = " ".join(read_flight(builder.write(tmp_path / "clock.bag")).missing)
    assert "dji_sdk/battery_state: stamps are 100.0 s from the time of recording" in missing
    assert "odometry" not in missing


@pytest.mark.parametrize("wrong", [2.1e9, 1.0, 130.0])
def test_single_wrong_stamps_change_nothing_and_are_named(wrong, flight, metrics, tmp_path):
    builder = flight.without("nothing")
    odd = BagBuilder()
    odd.odometry("nmpc/odometry", wrong, (5.0, 0.25, 2.0), (1.0, 0.0, 0.0), yaw=1.0)
    odd.status(wrong, FLYING, plans_rejected=11, deadline_misses=115, reason="of another length")
    odd.setpoint(wrong, 0.1, -0.1, 38.0, 0.2)
    builder.messages += [(topic, kind, 115.0, raw) for topic, kind, _, raw in odd.messages]
    figures = flight_metrics(read_flight(builder.write(tmp_path / "stamp.bag")))
    names = ("nmpc/odometry", "nmpc/status", "dji_sdk/flight_control_setpoint_generic")
    said = [s for s in figures["missing"] if "the time of recording counts" in s]
    assert sorted(s.split(":")[0] for s in said) == sorted(names)
    assert all(": 1 stamps are over 5 s from all others'" in s for s in said)
    assert len(figures["missing"]) == 3
    for key in ("average_deviation_m", "navigation_time_s", "total_time_s", "window_s"):
        assert figures[key] == pytest.approx(metrics[key], rel=1e-3), key
    assert figures["command_gap_ms_max"] == pytest.approx(metrics["command_gap_ms_max"], abs=0.1)
    assert figures["streams"]["nmpc/odometry"]["gap_ms_max"] == pytest.approx(20.0, abs=0.1)


def test_obstacles_that_stand_still_are_held_once(tmp_path):
    builder = BagBuilder()
    for k in range(50):
        standing = [(f"tree{i}", (10.0 + i, 0.0, 3.0), 1.0) for i in range(20)]
        builder.obstacles(0.1 * k, [*standing, ("bird", (0.1 * k, 0.0, 3.0), 0.2)])
        builder.obstacles(0.1 * k, standing, topic="obstacles")
    recording = read(builder.write(tmp_path / "trees.bag"))
    assert "sensed_obstacles" not in recording.events
    contents = [event.content for event in recording.events["obstacles"]]
    assert [len(content) for content in contents] == [21] * 50
    assert len({id(obstacle) for content in contents for obstacle in content}) == 20 + 50
    birds = np.array([content[-1].position[0] for content in contents])
    np.testing.assert_allclose(birds, 0.1 * np.arange(50))
