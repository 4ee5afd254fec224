# SPDX-License-Identifier: MIT
"""Along and across the reference, inputs at their bounds, jerk, streams, timeline and parts."""

from dataclasses import replace

import numpy as np
import pytest
from analysis_bags import BagBuilder, Flight, header

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.following import following_figures, track_errors
from nmpc_control.analysis.inputs import InputLimits, input_figures
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.motion import jerk
from nmpc_control.analysis.record import FlightRecord, Reference, Series
from nmpc_control.analysis.segments import parts
from nmpc_control.analysis.timeline import periods, shown_window
from nmpc_control.analysis.windows import Window, scenario_window
from nmpc_control.mode_inputs import Mode

DIAGONAL = Reference(0.0, Series([0.0, 10.0, 20.0], [[0, 0, 0], [30, 40, 0], [30, 40, 0]]))
WHOLE = Window(0.0, 20.0, 20.0)


def test_error_is_split_along_and_across_the_motion():
    times = np.arange(1.0, 9.0, 0.1)
    ahead, aside = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
    error = Series(times, np.tile(0.5 * ahead + 0.2 * aside + [0, 0, 0.15], (len(times), 1)))
    along, across = track_errors(error, DIAGONAL)
    assert along == pytest.approx(np.full(len(times), 0.5))
    assert across == pytest.approx(np.full(len(times), 0.25))
    figures = following_figures(error, DIAGONAL)
    assert figures["along_track_m"]["bias"] == pytest.approx(0.5)
    assert figures["cross_track_m"]["rmse"] == pytest.approx(0.25)
    assert figures["axis_error_m"]["x"]["mean"] == pytest.approx(0.6 * 0.5 - 0.8 * 0.2)


def test_reference_that_stands_still_has_no_direction():
    error = Series([15.0, 16.0], [[1.0, 0.0, 0.0]] * 2)
    assert len(track_errors(error, DIAGONAL)[0]) == 0
    figures = following_figures(error, DIAGONAL)
    assert figures["along_track_m"] is None
    assert figures["ape_m"]["mean"] == pytest.approx(1.0)


def test_percentiles():
    error = Series(np.arange(101) * 0.01, np.outer(np.arange(101.0), [0, 0, 1]))
    figures = following_figures(error, DIAGONAL)
    assert figures["deviation_percentiles_m"] == pytest.approx(
        {"p50": 50.0, "p90": 90.0, "p95": 95.0, "p99": 99.0}
    )


def commands(*columns):
    values = np.stack(np.broadcast_arrays(*columns), axis=1)
    return FlightRecord(commands=Series(np.arange(len(values)) * 0.02, values))


def test_time_in_saturation_and_effort():
    roll = np.where(np.arange(500) < 100, 0.349, 0.1)
    thrust = np.where(np.arange(500) >= 450, 60.0, 40.0)
    figures = input_figures(commands(thrust, roll, 0.0, 0.0), WHOLE, InputLimits(), [])
    saturation = figures["saturation"]
    assert saturation["roll_rad_time_s"] == pytest.approx(2.0)
    assert saturation["thrust_percent_time_s"] == pytest.approx(0.98)
    assert saturation["pitch_rad_time_s"] == 0.0
    assert saturation["time_s"] == pytest.approx(2.98)
    assert saturation["share"] == pytest.approx(2.98 / 9.98)
    expected = np.sqrt((2.0 * 0.349**2 + 7.98 * 0.1**2) / 9.98)
    assert figures["input_effort"]["roll_rad"] == pytest.approx(expected)
    assert figures["input_variation_per_s"]["roll_rad_s"] == pytest.approx(0.249 / 9.98)


def test_inputs_that_are_not_commanded_count_nowhere():
    figures = input_figures(commands(np.full(50, np.nan), 0.1, 0.0, 0.0), WHOLE, InputLimits(), [])
    assert figures["input_effort"]["thrust_percent"] is None
    assert figures["saturation"]["thrust_percent_time_s"] == 0.0


def test_commands_beyond_the_assumed_bounds_disprove_them():
    missing = []
    thrust = np.where(np.arange(500) < 5, 71.0, 60.0)
    figures = input_figures(commands(thrust, 0.349, 0.0, 0.0), WHOLE, InputLimits(), missing)
    saturation = figures["saturation"]
    assert [saturation[key] for key in ("thrust_percent_time_s", "time_s", "share")] == [None] * 3
    assert saturation["roll_rad_time_s"] == pytest.approx(9.98)
    assert "commands from 60 to 71 exceed the assumed bounds 30 to 60" in missing[0]
    assert len(missing) == 1


def test_jerk_of_a_cubic_velocity_is_exact():
    times = np.arange(0.0, 5.0, 0.02)
    velocity = Series(times, np.outer(0.5 * 3.0 * times**2, [0.0, 0.6, 0.8]))
    figures = jerk(velocity, WHOLE)
    assert figures == pytest.approx({"rms": 3.0, "max": 3.0}, rel=1e-6)
    gap = (times < 2.0) | (times > 3.0)
    assert jerk(Series(times[gap], velocity.values[gap]), WHOLE)["max"] == pytest.approx(3.0)
    assert jerk(Series(times[:10], velocity.values[:10]), WHOLE) is None


def manual_status():
    times = np.arange(0.0, 40.0, 0.02)
    mode = np.select(
        [times < 5, times < 15, times < 25, times < 35],
        [Mode.READY, Mode.FLYING, Mode.MANUAL, Mode.FLYING],
        Mode.READY,
    )
    zero = np.zeros(len(times))
    rung = np.where((times >= 10) & (times < 11), 3, 1)
    return Series(times, np.stack([mode, zero, zero, rung, mode == Mode.FLYING], axis=1))


def test_automatic_and_manual_parts_are_apart():
    record = FlightRecord(status=manual_status(), automatic=(5.0, 35.0))
    names = [(p.mode, p.automatic, p.authority) for p in periods(record)]
    assert names == [
        ("ready", None, False),
        ("flying", True, True),
        ("manual", False, False),
        ("flying", True, True),
        ("ready", None, False),
    ]
    metrics = flight_metrics(record)
    assert metrics["automatic_time_s"] == pytest.approx(20.0)
    assert metrics["manual_time_s"] == pytest.approx(10.0)
    assert metrics["rung_time_s"]["brake"] == pytest.approx(1.0, abs=0.03)


def test_without_a_guard_the_transmitters_switch_tells():
    times = np.arange(0.0, 20.0, 0.02)
    rc = np.zeros((len(times), 6))
    rc[:, 4], rc[:, 5] = np.where(times < 12.0, 8000.0, -8000.0), -10000.0
    record = FlightRecord(rc=Series(times, rc), airborne=(2.0, 18.0))
    found = [(round(p.start), round(p.end), p.automatic) for p in periods(record)]
    assert found == [(0, 2, None), (2, 12, True), (12, 18, False), (18, 20, None)]
    metrics = flight_metrics(replace(record, automatic=record.airborne))
    assert metrics["automatic_time_s"] == pytest.approx(10.0, abs=0.03)
    assert metrics["total_time_s"] == metrics["automatic_time_s"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    bag = Flight().build()
    goal = {"goal_id": {"id": "first"}, "goal": {"scenario": "line"}}
    bag.add("fly_trajectory/goal", "nmpc_msgs/msg/FlyTrajectoryActionGoal", 108.0, goal)
    result = {"status": {"goal_id": {"id": "first"}}}
    bag.add("fly_trajectory/result", "nmpc_msgs/msg/FlyTrajectoryActionResult", 121.0, result)
    return read_flight(bag.write(tmp_path_factory.mktemp("bags") / "line.bag"))


@pytest.mark.parametrize("by", ["mode", "goal", "4"])
def test_parts_of_a_flight_have_the_figures_of_their_time(flight, by):
    found = flight_metrics(flight, segments=by)["segments"]
    names = {
        "mode": ["ready", "taking_off", "flying", "hovering", "landing", "ready"],
        "goal": ["line"],
        "4": ["0 to 4 s", "4 to 8 s", "8 to 12 s", "12 to 14 s"],
    }[by]
    assert [part["name"] for part in found] == names
    chosen = found[{"mode": 2, "goal": 0, "4": 0}[by]]
    assert chosen["average_deviation_m"] == pytest.approx(0.25, abs=1e-6)
    assert chosen["path_length_m"] == pytest.approx({"mode": 10, "goal": 10, "4": 4}[by], abs=0.1)
    if by == "mode":
        assert found[0]["average_deviation_m"] is None
        assert [part["automatic"] for part in found] == [None, True, True, True, True, None]


@pytest.mark.parametrize("by", ["", "modes", "-1", "nan", "0"])
def test_wrong_parts_are_refused(flight, by):
    with pytest.raises(ValueError, match="expected mode, goal or seconds"):
        parts(flight, by)


def test_part_of_the_time(flight):
    start = flight.reference.start
    metrics = flight_metrics(flight, between=(start + 2.0, start + 5.0))
    assert metrics["path_length_m"] == pytest.approx(3.0, abs=0.05)
    assert metrics["window_s"] == [start + 2.0, start + 5.0]


def test_streams_battery_and_units(flight):
    metrics = flight_metrics(flight)
    odometry = metrics["streams"]["nmpc/odometry"]
    assert odometry["rate_hz"] == pytest.approx(50.0)
    assert odometry["gap_ms_max"] == pytest.approx(20.0, abs=0.01)
    assert metrics["battery_percent"] == [90.0, 76.0]
    assert metrics["units"]["rate_hz"] == "Hz"
    assert metrics["units"]["jerk_m_s3"] == "m/s^3"
    assert metrics["units"]["average_deviation_m"] == "m"
    per_second = {key: metrics["units"][key] for key in metrics["input_variation_per_s"]}
    assert per_second == {
        "thrust_percent_s": "percent/s",
        "roll_rad_s": "rad/s",
        "pitch_rad_s": "rad/s",
        "yaw_rate_rad_s2": "rad/s^2",
    }
    assert "input_variation_per_s" not in metrics["units"]
    assert metrics["units"]["yaw_rate_rad_s"] == "rad/s"
    assert metrics["units"]["roll_rad_time_s"] == "s"


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_charge_as_a_share_of_1_is_shown_in_percent(scale, tmp_path):
    bag = BagBuilder()
    for t in (100.0, 101.0, 102.0):
        values = {"header": header(t), "percentage": scale * (150.0 - t)}
        bag.add("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState", t, values)
    record = read_flight(bag.write(tmp_path / "battery.bag"))
    assert record.battery.values[:, 0] == pytest.approx([50.0, 49.0, 48.0])
    assert ("battery_state is taken as a share of 1" in record.missing) == (scale < 1.0)


def test_hover_thrust_is_that_of_standing_still_not_of_passing_through():
    times = np.arange(0.0, 40.0, 0.02)
    speed = np.where(times < 20.0, 2.0 * np.sin(times), 0.0)
    thrust = np.where(times < 20.0, 50.0, 38.0)
    record = FlightRecord(
        velocity=Series(times, np.outer(speed, [1.0, 0.0, 0.0])),
        attitude=Series(times, np.zeros((len(times), 3))),
        commands=Series(times, np.stack([thrust, *np.zeros((3, len(times)))], axis=1)),
        airborne=(0.0, 40.0),
    )
    hover = flight_metrics(record)["hover_thrust_percent"]
    assert (hover["median"], hover["p5"]) == (38.0, 38.0)
    moving = flight_metrics(replace(record, airborne=(0.0, 19.0)))
    assert moving["hover_thrust_percent"] is None
    assert "hardly hovered" in " ".join(moving["missing"])


def test_topics_of_the_papers_code(tmp_path):
    bag = BagBuilder()
    for k in range(1000):
        t = 50.0 + 0.02 * k
        point = {"point": {"x": 0.02 * k, "y": 0.0, "z": 2.0}}
        bag.add(
            "world_position", "geometry_msgs/msg/PointStamped", t, {"header": stamp(t), **point}
        )
        aside = {"point": {"x": 0.02 * k, "y": 0.3, "z": 2.0}}
        bag.add(
            "tune/ref_position", "geometry_msgs/msg/PointStamped", t, {"header": stamp(t), **aside}
        )
        bag.add("dji_sdk/rc", "sensor_msgs/msg/Joy", t, {"axes": [0, 0, 0, 0, 8000, -10000]})
        bag.setpoint(t, 0.1, -0.1, 38.0, 0.2)
    record = read_flight(bag.write(tmp_path / "paper.bag"))
    metrics = flight_metrics(record)
    assert metrics["average_deviation_m"] == pytest.approx(0.3, abs=1e-9)
    assert metrics["cross_track_m"]["max"] == pytest.approx(0.3, abs=1e-9)
    assert metrics["input_limits"]["thrust_max"] == 60.0
    missing = " ".join(metrics["missing"])
    assert "the reference is what tune/ref_position published" in missing
    assert "position is world_position" in missing


def stamp(t):
    return {"stamp": {"sec": int(t), "nanosec": round((t - int(t)) * 1e9)}}


def test_position_of_the_motion_capture_frame(tmp_path):
    bag = BagBuilder()
    for k in range(100):
        t = 50.0 + 0.02 * k
        transforms = [
            {
                "header": {"frame_id": "world"},
                "child_frame_id": frame,
                "transform": {"translation": {"x": x, "y": 0.0, "z": 1.0}},
            }
            for frame, x in (("mat2", 0.01 * k), ("table", 9.0))
        ]
        bag.add("tf", "tf2_msgs/msg/TFMessage", t, {"transforms": transforms})
        bag.setpoint(t, 0.1, -0.1, 38.0, 0.2)
    record = read_flight(bag.write(tmp_path / "vicon.bag"))
    assert record.position.values[-1] == pytest.approx([0.99, 0.0, 1.0])
    assert "no nmpc/odometry: position is /tf of mat2" in record.missing[0]


def test_drawings_show_what_was_flown_by_hand_too():
    times = np.arange(0.0, 40.0, 0.02)
    record = FlightRecord(
        position=Series(times, np.zeros((len(times), 3))),
        reference=Reference(6.0, Series([0.0, 30.0], np.zeros((2, 3)))),
        status=manual_status(),
        airborne=(4.0, 34.0),
    )
    assert scenario_window(record).end == pytest.approx(15.0, abs=0.03)
    shown = shown_window(record)
    assert (shown.start, shown.end) == pytest.approx((6.0, 34.0), abs=0.03)
    assert shown.reference_end == pytest.approx(34.0, abs=0.03)
    never = replace(record, status=None)
    assert shown_window(never) == scenario_window(never)
