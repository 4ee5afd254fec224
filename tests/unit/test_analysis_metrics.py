# SPDX-License-Identifier: MIT
"""Figures of records made by hand: what is there is exact, what is not is None and explained."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Reference, Series
from nmpc_control.mode_inputs import Mode
from nmpc_control.obstacle import Obstacle

START, DURATION = 50.0, 20.0
TIMES = np.arange(4000, 9000) / 100.0


def reference():
    times = np.linspace(0.0, DURATION, 201)
    return Reference(START, Series(times, np.outer(times, [0.5, 0.0, 0.0])))


def status(*changes):
    """Status at 50 Hz with (time, mode) changes; one plan is rejected each second."""
    times = np.arange(40.0, 90.0, 0.02)
    mode = np.zeros(len(times))
    for t, value in changes:
        mode[times >= t - 1e-9] = value
    return Series(times, np.stack([mode, np.floor(times), 2.0 * np.floor(times)], axis=1))


def record(**parts):
    reference_positions = reference().position_at(TIMES)
    moving = (TIMES >= START) & (TIMES <= START + DURATION)
    commands = np.arange(44.0, 80.0, 0.02)
    thrust = np.where(commands < START, 60.0, 38.0 + np.sin(commands))
    plans = np.arange(40.0, 90.0, 0.1)
    number = np.arange(len(plans))
    complete = FlightRecord(
        scenario="line",
        source="simulation",
        position=Series(TIMES, reference_positions + [0.0, 0.18, 0.24]),
        velocity=Series(TIMES, np.outer(moving, [0.5, 0.0, 0.0])),
        attitude=Series(TIMES, np.tile([0.3, 0.4, 1.0], (len(TIMES), 1))),
        true_position=Series(TIMES, reference_positions + [0.0, 0.0, 0.1]),
        reference=reference(),
        tracked_reference=Series(TIMES, reference_positions + [0.0, 0.18, 0.0]),
        obstacles=(ObstacleTrack(Obstacle("ball", np.array([5.0, 2.0, 0.1]), np.array([0.5]))),),
        commands=Series(commands, np.stack([thrust, *np.zeros((3, len(commands)))], axis=1)),
        solver=Series(plans, np.stack([number % 4, 1e-3 * (number % 7), number % 10 > 0], axis=1)),
        battery=Series([40.0, 50.0, 90.0], [[90.0], [80.0], [40.0]]),
        status=status((42.0, 2), (44.0, 4), (46.0, 3), (72.0, 4), (80.0, 6), (85.0, 1)),
        airborne=(43.0, 84.0),
        automatic=(42.0, 85.0),
        reported_collisions=0,
    )
    return replace(complete, **parts)


def test_deviation_to_the_reference_at_the_same_time():
    metrics = flight_metrics(record())
    assert metrics["average_deviation_m"] == pytest.approx(0.3, abs=1e-12)
    assert metrics["maximum_deviation_m"] == pytest.approx(0.3, abs=1e-12)
    assert metrics["average_deviation_after_6s_m"] == pytest.approx(0.3, abs=1e-12)
    assert metrics["average_path_deviation_m"] == pytest.approx(0.3, abs=1e-12)
    assert metrics["average_deviation_truth_m"] == pytest.approx(0.1, abs=1e-12)
    assert metrics["average_deviation_retimed_m"] == pytest.approx(0.24, abs=1e-12)
    assert metrics["rmse_m"] == pytest.approx({"x": 0.0, "y": 0.18, "z": 0.24, "total": 0.3})
    assert metrics["scenario_time_s"] == pytest.approx(DURATION)
    assert metrics["reference_length_m"] == pytest.approx(10.0)
    assert metrics["missing"] == [
        "the aircraft did not arrive: no navigation time",
        "the aircraft hardly hovered on thrust commands: no hover thrust",
    ]


def test_deviation_counts_only_while_the_reference_ran():
    far = np.where((TIMES < START) | (TIMES > START + DURATION), 100.0, 0.2)
    position = Series(TIMES, reference().position_at(TIMES) + np.outer(far, [0.0, 1.0, 0.0]))
    metrics = flight_metrics(record(position=position))
    assert metrics["maximum_deviation_m"] == pytest.approx(0.2, abs=1e-12)


def test_start_away_from_the_reference_counts_but_not_after_6_s():
    transient = 2.0 * np.maximum(0.0, 1.0 - np.maximum(TIMES - START, 0.0) / 4.0)
    position = Series(TIMES, reference().position_at(TIMES) + np.outer(transient, [0.0, 0.0, 1.0]))
    metrics = flight_metrics(record(position=position))
    assert metrics["maximum_deviation_m"] == pytest.approx(2.0)
    assert metrics["average_deviation_m"] == pytest.approx(2.0 * 4.0 / 2.0 / DURATION, rel=2e-3)
    assert metrics["average_deviation_after_6s_m"] == pytest.approx(0.0, abs=1e-12)


def test_navigation_and_total_time():
    times = np.array([START, START + DURATION, START + DURATION + 2.0, 90.0])
    near = Series(times, [[0, 0, 0], [9.6, 0, 0], [10, 0, 0], [10, 0, 0]])
    metrics = flight_metrics(record(position=Series(TIMES, near.at(TIMES))))
    # 0.4 m short when the reference ends, closing at 0.2 m/s: 0.3 m short half a second later.
    assert metrics["arrived"] is True
    assert metrics["navigation_time_s"] == pytest.approx(DURATION + 0.5, abs=0.011)
    assert metrics["total_time_s"] == pytest.approx(43.0)
    assert metrics["end_distance_m"] == pytest.approx(0.0, abs=1e-9)


def test_not_arriving_is_said():
    position = Series(TIMES, np.tile([0.0, 0.0, 5.0], (len(TIMES), 1)))
    metrics = flight_metrics(record(position=position))
    assert metrics["arrived"] is False
    assert metrics["navigation_time_s"] is None
    assert any("did not arrive" in sentence for sentence in metrics["missing"])


def test_landing_ends_the_phase_and_cuts_the_deviation():
    early = status((42.0, 2), (44.0, 3), (60.0, 6))
    metrics = flight_metrics(record(status=early, automatic=(42.0, 70.0)))
    assert metrics["window_s"] == pytest.approx([START, 60.0], abs=0.021)
    assert any("ended 10.0 s before its reference" in sentence for sentence in metrics["missing"])


def test_solver_figures_are_those_of_the_scenario():
    metrics = flight_metrics(record())
    number = np.arange(100, 401)  # plans from 50.0 to 80.0 s
    solve_time = number % 7 * 1.0
    assert metrics["solver_iterations_mean"] == pytest.approx(np.mean(number % 4))
    assert metrics["solve_time_ms"] == pytest.approx(
        {
            "mean": solve_time.mean(),
            "p50": np.percentile(solve_time, 50),
            "p99": np.percentile(solve_time, 99),
            "max": 6.0,
        }
    )
    assert metrics["plans_found_ratio"] == pytest.approx(np.mean(number % 10 > 0))
    assert (metrics["plans_rejected"], metrics["deadline_misses"]) == (30, 60)


def test_counters_of_a_guard_that_restarted_are_summed():
    changes = status((42.0, 2), (46.0, 3), (80.0, 6))
    values = changes.values.copy()
    values[changes.times >= 60.0, 1:] -= [58.0, 120.0]  # one is 2 again, the other 0
    restarted = flight_metrics(record(status=Series(changes.times, values)))
    assert (restarted["plans_rejected"], restarted["deadline_misses"]) == (9 + 2 + 20, 18 + 40)
    assert any("guard restarted" in sentence for sentence in restarted["missing"])


def test_what_is_held_before_the_reference_runs_is_no_deviation():
    by_time = flight_metrics(record(automatic=(42.0, 85.0)), segments="mode")["segments"]
    takeoff = next(part for part in by_time if part["end_s"] <= START)
    assert takeoff["average_deviation_retimed_m"] is None
    assert takeoff["maximum_deviation_retimed_m"] is None
    assert any(part["average_deviation_retimed_m"] for part in by_time)


def test_thrust_range_leaves_out_what_no_command_gave():
    times = np.arange(START, 80.0, 0.02)
    values = np.full((len(times), 4), np.nan)
    values[100:200, 0] = np.linspace(31.5, 44.25, 100)
    metrics = flight_metrics(record(commands=Series(times, values)))
    assert metrics["thrust_percent"] == [31.5, 44.25]
    assert flight_metrics(record())["thrust_percent"][1] < 40.0  # the 60 % came before the scenario


def test_largest_gap_counts_only_while_the_guard_streams():
    times = np.concatenate(
        [
            np.arange(44.0, 55.0, 0.02),
            np.arange(55.1, 60.0, 0.02),  # 0.12 s missing while flying
            np.arange(70.0, 80.0, 0.02),  # 10 s without a stream, on purpose
        ]
    )
    modes = status((42.0, 2), (44.0, 3), (60.0, 7), (70.0, 4), (80.0, 6), (85.0, 1))
    metrics = flight_metrics(
        record(commands=Series(times, np.zeros((len(times), 4))), status=modes)
    )
    assert metrics["command_gap_ms_max"] == pytest.approx(120.0, abs=1e-6)
    assert metrics["command_gap_ms_p99"] == pytest.approx(20.0, abs=1e-6)
    assert metrics["command_rate_hz"] == pytest.approx(50.0, rel=0.01)


def test_gap_with_a_status_that_hangs_too_counts():
    keep = (TIMES < 55.0) | (TIMES > 56.0)
    times = TIMES[keep & (TIMES >= 44.0) & (TIMES < 80.0)]
    full = status((42.0, 2), (44.0, 3), (80.0, 6))
    silent = (full.times < 55.0) | (full.times > 56.0)
    metrics = flight_metrics(
        record(
            commands=Series(times, np.zeros((len(times), 4))),
            status=Series(full.times[silent], full.values[silent]),
        )
    )
    assert metrics["command_gap_ms_max"] == pytest.approx(1000.0, abs=20.1)


def test_clearance_is_on_truth_and_from_the_hull():
    # Truth flies along y = 0, z = 0.1 past the centre at 2 m; the estimate passes nearer.
    metrics = flight_metrics(record())
    assert metrics["clearance_m"] == pytest.approx({"ball": 2.0 - 0.5 - 0.5}, abs=1e-6)
    assert metrics["clearance_by"] == "truth"
    assert metrics["collisions"] == 0
    paper = flight_metrics(record(), vehicle_radius=0.0)
    assert paper["clearance_m"] == pytest.approx({"ball": 1.5}, abs=1e-6)
    assert paper["vehicle_radius_m"] == 0.0


def test_clearance_on_the_estimate_judges_no_collision():
    metrics = flight_metrics(record(true_position=None))
    nearest = np.hypot(2.0 - 0.18, 0.1 - 0.24) - 1.0
    assert metrics["clearance_m"] == pytest.approx({"ball": nearest}, abs=1e-6)
    assert metrics["clearance_by"] == "estimate"
    assert metrics["collisions"] == 0  # what the simulator reported
    assert (
        flight_metrics(record(true_position=None, reported_collisions=None))["collisions"] is None
    )


def test_collision_is_counted_before_the_scenario_too():
    wall = Obstacle("wall", np.array([0.0, 0.4, 0.1]), np.array([0.2]))
    track = ObstacleTrack(wall, end=START - 1.0)  # taken away before the clock starts
    metrics = flight_metrics(record(obstacles=(track,)))
    assert metrics["clearance_m"] == {"wall": None}
    assert metrics["collisions"] == 1
    assert flight_metrics(record(reported_collisions=3))["collisions"] == 3


def test_no_obstacles_is_not_the_same_as_unknown_obstacles():
    assert flight_metrics(record(obstacles=()))["clearance_m"] == {}
    assert flight_metrics(record(obstacles=()))["collisions"] == 0
    unknown = flight_metrics(record(obstacles=None))
    assert unknown["clearance_m"] is None
    assert "no list of obstacles: no clearance" in unknown["missing"]


def test_hole_in_the_positions_is_said():
    keep = (TIMES < 55.0) | (TIMES > 57.0)
    truth = record().true_position
    metrics = flight_metrics(record(true_position=Series(TIMES[keep], truth.values[keep])))
    assert any("missing for up to 2.0 s" in sentence for sentence in metrics["missing"])


def test_motion():
    metrics = flight_metrics(record())
    assert metrics["path_length_m"] == pytest.approx(10.0)
    assert metrics["speed_m_s"]["max"] == pytest.approx(0.5)
    tilt = np.arccos(np.cos(0.3) * np.cos(0.4))
    assert metrics["tilt_rad"] == pytest.approx({"mean": tilt, "max": tilt})
    assert metrics["airborne_time_s"] == pytest.approx(41.0)


PARTS = [f.name for f in fields(FlightRecord) if f.default is None]
OPTIONAL = {  # nothing to explain
    "bag",
    "scenario",
    "source",
    "phase_end",
    "reported_collisions",
    "rc",
    "parameters",
    "between",
}


@pytest.mark.parametrize("part", PARTS)
def test_without_one_part_the_rest_stands_and_json_is_strict(part):
    complete, metrics = flight_metrics(record()), flight_metrics(record(**{part: None}))
    assert list(metrics) == list(complete)
    json.dumps(metrics, allow_nan=False)
    lost = {key for key in metrics if metrics[key] is None and complete[key] is not None}
    if part not in OPTIONAL:
        assert lost
        assert set(metrics["missing"]) - set(complete["missing"])


def test_empty_record_has_only_nulls():
    metrics = flight_metrics(FlightRecord())
    given = (
        "schema_version",
        "flight",
        "flights",
        "vehicle_radius_m",
        "input_limits",
        "missing",
        "units",
    )
    assert [key for key, value in metrics.items() if value is not None] == list(given)
    assert len(metrics["missing"]) >= 5


def test_nothing_but_json_types_and_no_nan():
    commands = Series([51.0, 52.0], [[np.nan] * 4] * 2)
    metrics = flight_metrics(record(commands=commands))
    assert metrics["thrust_percent"] is None
    assert json.loads(json.dumps(metrics, allow_nan=False)) == metrics


def test_modes_are_those_of_the_guard():
    assert (Mode.TAKING_OFF, Mode.FLYING, Mode.HOVERING, Mode.LANDING) == (2, 3, 4, 6)
