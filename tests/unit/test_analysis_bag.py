# SPDX-License-Identifier: MIT
"""From small bags with known answers to records and figures, without ROS."""

import numpy as np
import pytest
from analysis_bags import FLYING, LANDING, READY, BagBuilder, Flight, xyz

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.errors import BagError

TOPICS = (
    "nmpc/odometry",
    "nmpc/reference",
    "nmpc/trajectory",
    "nmpc/status",
    "nmpc/plan",
    "nmpc/obstacles",
    "dji_sdk/flight_control_setpoint_generic",
    "dji_sdk/flight_status",
    "uav_sim/ground_truth",
)


class LaterFlight(Flight):
    """100 s later, 0.1 m beside its reference, with another obstacle."""

    start, take_off, land, end = 210.0, 204.0, 224.0, 228.0
    offset = np.array([0.0, 0.1, 0.0])
    spheres = (("post", (5.0, 3.0, 2.0), 1.0),)


@pytest.fixture(scope="module")
def flight():
    return Flight().build()


@pytest.fixture(scope="module")
def bag(flight, tmp_path_factory):
    return flight.write(tmp_path_factory.mktemp("bags") / "line.bag")


@pytest.fixture(scope="module")
def metrics(bag):
    return flight_metrics(read_flight(bag))


def test_whole_flight(metrics):
    assert metrics["bag"] == "line.bag"
    assert metrics["scenario"] == "line"
    assert metrics["source"] == "simulation"
    assert metrics["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert metrics["average_deviation_truth_m"] == pytest.approx(0.3, abs=1e-9)
    assert metrics["average_deviation_retimed_m"] == pytest.approx(0.25, abs=1e-9)
    assert metrics["average_path_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert metrics["scenario_time_s"] == pytest.approx(10.0)
    assert metrics["arrived"] is True
    assert metrics["navigation_time_s"] == pytest.approx(10.0, abs=0.021)
    assert metrics["total_time_s"] == pytest.approx(24.0)
    assert metrics["airborne_time_s"] == pytest.approx(22.0)
    assert metrics["thrust_percent"] == pytest.approx([38.0, 38.6], abs=1e-5)
    assert metrics["command_gap_ms_max"] == pytest.approx(20.0, abs=1e-3)
    assert metrics["collisions"] == 0
    assert metrics["missing"] == []


def test_clearance_is_that_of_the_true_path(metrics):
    # Truth passes at y = 0.3: the ball's centre is 1.7 m away, the far one's 4.3 m.
    assert metrics["clearance_m"] == pytest.approx({"ball": 0.7, "far": 2.8}, abs=1e-9)


def test_header_stamps_count_not_the_time_of_recording(flight, tmp_path):
    late = flight.without("nothing")
    for index, (topic, msgtype, t, raw) in enumerate(late.messages):
        if topic.endswith("odometry"):
            late.messages[index] = (topic, msgtype, t + 0.4, raw)
    figures = flight_metrics(read_flight(late.write(tmp_path / "late.bag")))
    assert figures["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)


def test_body_velocities_are_turned_into_the_world(bag):
    record = read_flight(bag)
    flying = record.velocity.between(record.reference.start, record.reference.start + 9.0)
    assert flying.values == pytest.approx(np.tile([1.0, 0.0, 0.0], (len(flying), 1)), abs=1e-9)
    assert record.attitude.values[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("topic", TOPICS)
def test_without_one_topic(flight, metrics, topic, tmp_path):
    figures = flight_metrics(read_flight(flight.without(topic).write(tmp_path / "less.bag")))
    assert list(figures) == list(metrics)
    lost = {key for key in figures if figures[key] is None and metrics[key] is not None}
    expected = {
        "nmpc/odometry": {"average_deviation_m", "arrived", "navigation_time_s"},
        "nmpc/reference": {"average_deviation_retimed_m"},
        "nmpc/trajectory": {"average_deviation_m", "navigation_time_s", "scenario_time_s"},
        "nmpc/status": {"plans_rejected"},
        "nmpc/plan": {"solver_iterations_mean", "solve_time_ms"},
        "nmpc/obstacles": {"clearance_m"},
        "dji_sdk/flight_control_setpoint_generic": {"thrust_percent", "command_gap_ms_max"},
        "dji_sdk/flight_status": set(),
        "uav_sim/ground_truth": {"average_deviation_truth_m"},
    }[topic]
    assert lost >= expected
    assert figures["missing"]
    kept = {"average_deviation_truth_m", "solver_iterations_mean", "thrust_percent"} - lost
    for key in kept if topic not in ("nmpc/trajectory", "nmpc/status") else ():
        assert figures[key] == pytest.approx(metrics[key], rel=1e-6)


def test_namespace(tmp_path):
    builder = Flight().build(prefix="/dji1")
    figures = flight_metrics(read_flight(builder.write(tmp_path / "first.bag")))
    assert figures["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert figures["missing"] == []


def test_two_vehicles(flight, tmp_path):
    other = BagBuilder(prefix="/dji2")
    other.odometry("nmpc/odometry", 100.0, (0.0, 0.0, 9.0), (0.0, 0.0, 0.0))
    both = BagBuilder()
    both.messages = flight.messages + other.messages
    path = both.write(tmp_path / "both.bag")
    figures = flight_metrics(read_flight(path))
    assert figures["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert "topics of several vehicles (/, /dji2): evaluated /" in figures["missing"]
    assert len(read_flight(path, namespace="/dji2").position) == 1


def test_two_trajectories_in_one_bag(tmp_path):
    first, second = Flight().build(name="first"), LaterFlight().build(name="second")
    first.messages += second.messages
    path = first.write(tmp_path / "two.bag")
    last = flight_metrics(read_flight(path))
    assert (last["flight"], last["flights"], last["scenario"]) == (2, 2, "second")
    assert last["average_deviation_m"] == pytest.approx(0.1, abs=1e-9)
    assert list(last["clearance_m"]) == ["post"]
    assert last["total_time_s"] == pytest.approx(24.0)
    assert "the bag holds 2 flights: this is the last of them" in last["missing"]
    one = flight_metrics(read_flight(path, flight=1))
    assert (one["flight"], one["scenario"]) == (1, "first")
    assert one["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)
    assert list(one["clearance_m"]) == ["ball", "far"]
    for figures in (one, last):
        assert sum(figures["mode_time_s"].values()) == pytest.approx(24.0, abs=0.1)
        assert figures["automatic_time_s"] == pytest.approx(figures["total_time_s"], abs=0.05)
    assert one["timeline"][-1]["end"] < last["timeline"][0]["start"]
    by_mode = flight_metrics(read_flight(path), segments="mode")["segments"]
    assert by_mode[0]["start_s"] >= last["timeline"][0]["start"]
    with pytest.raises(BagError, match="has 2 flights, expected at least 3"):
        read_flight(path, flight=3)


def test_next_trajectory_without_landing_ends_the_phase(flight, tmp_path):
    builder = flight.without("nothing")
    builder.trajectory(122.0, 0.0, "next", [0.0, 1.0], [[0, 0, 2], [1, 0, 2]])
    record = read_flight(builder.write(tmp_path / "next.bag"))
    assert record.phase_end - record.reference.start == pytest.approx(12.0, abs=0.01)


def test_latched_trajectory_that_is_recorded_again_is_one_flight(flight, tmp_path):
    builder = flight.without("nothing")
    again = [m for m in flight.messages if m[0].endswith("nmpc/trajectory")][1]
    builder.messages.append((again[0], again[1], 118.0, again[3]))
    record = read_flight(builder.write(tmp_path / "again.bag"))
    assert record.flight == (1, 1)
    assert record.phase_end is None


def test_obstacle_that_moves_appears_and_goes(flight, tmp_path):
    builder, path = flight.without("nothing"), Flight()
    for k in range(400):  # seen at 10 Hz: it keeps pace with the aircraft, 1.5 m beside the truth
        t = 98.1 + 0.1 * k
        spheres = [("ball", (5.0, 2.0, 2.0), 0.5)]
        if 112.0 <= t < 118.0:
            beside = path.reference(t) + path.offset + path.drift + [0.0, 1.5, 0.0]
            spheres.append(("bird", beside, 0.2))
        builder.obstacles(t, spheres)
    figures = flight_metrics(read_flight(builder.write(tmp_path / "moving.bag")))
    assert figures["clearance_m"] == pytest.approx({"ball": 0.7, "bird": 0.8}, abs=1e-6)


def test_obstacles_of_the_world_where_the_controller_lists_none(flight, tmp_path):
    builder = flight.without("nmpc/obstacles")
    builder.obstacles(100.0, [("ball", (5.0, 2.0, 2.0), 0.5)], topic="obstacles")
    figures = flight_metrics(read_flight(builder.write(tmp_path / "world.bag")))
    assert figures["clearance_m"] == pytest.approx({"ball": 0.7}, abs=1e-6)


def test_collision_is_counted_from_truth_and_from_the_simulator(flight, tmp_path):
    builder = flight.without("nmpc/obstacles")
    builder.obstacles(98.0, [("pole", (5.0, 0.9, 2.0), 0.2)])  # 0.6 m from the true path
    path = builder.write(tmp_path / "hit.bag")
    figures = flight_metrics(read_flight(path))
    assert figures["clearance_m"] == pytest.approx({"pole": -0.1}, abs=1e-6)
    assert figures["collisions"] == 1
    for k, text in enumerate(("id=pole clearance=-0.1 t=120.0", "id=roof clearance=-0.2 t=121.0")):
        builder.add("uav_sim/collision", "std_msgs/msg/String", 120.0 + k, {"data": text})
    builder.add("uav_sim/collision", "std_msgs/msg/String", 122.0, {"data": text})  # latched, again
    assert flight_metrics(read_flight(builder.write(tmp_path / "two.bag")))["collisions"] == 2


def test_bag_that_ends_in_the_air_says_so(flight, tmp_path):
    builder = BagBuilder()
    builder.messages = [m for m in flight.messages if m[2] < 118.0]
    figures = flight_metrics(read_flight(builder.write(tmp_path / "cut.bag")))
    assert figures["arrived"] is False
    assert "the bag ends before the landing did: total time is up to its end" in figures["missing"]
    assert any("ended 2.0 s before its reference" in s for s in figures["missing"])
    assert figures["average_deviation_m"] == pytest.approx(0.25, abs=1e-9)


def test_landing_is_not_streaming(tmp_path):
    builder = BagBuilder()
    for k in range(500):
        t = 100.0 + 0.02 * k
        builder.status(t, FLYING if t < 104.0 else LANDING if t < 108.0 else READY)
        if t < 104.0 or t > 107.0:
            builder.setpoint(t, 0.0, 0.0, 38.0, 0.0)
    figures = flight_metrics(read_flight(builder.write(tmp_path / "land.bag")))
    assert figures["command_gap_ms_max"] == pytest.approx(20.0, abs=1e-3)
    assert figures["total_time_s"] == pytest.approx(8.0)


def test_measured_position_where_there_is_no_estimate(tmp_path):
    builder = BagBuilder()
    for k in range(300):
        t = 100.0 + 0.02 * k
        header = {"stamp": {"sec": int(t), "nanosec": round((t % 1.0) * 1e9)}}
        values = {"header": header, "point": xyz((0.02 * k, 0.0, 3.0))}
        builder.add("dji_sdk/local_position", "geometry_msgs/msg/PointStamped", t, values)
    figures = flight_metrics(read_flight(builder.write(tmp_path / "gps.bag")))
    assert figures["path_length_m"] == pytest.approx(0.02 * 299)
    assert any("dji_sdk/local_position" in sentence for sentence in figures["missing"])
