# SPDX-License-Identifier: MIT
"""A stream that stops before the flight ends is no healthy one: its silence is a gap."""

import numpy as np
import pytest
from analysis_bags import BagBuilder, Flight

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.gaps import stream_gaps, uncovered
from nmpc_control.analysis.metrics import flight_metrics

COMMANDS = "dji_sdk/flight_control_setpoint_generic"


@pytest.fixture(scope="module")
def flight():
    return Flight().build()


def without(flight, suffix, first, last, path):
    """Return the figures of the flight without a topic from first to last [s]."""
    builder = BagBuilder()
    builder.messages = [
        m for m in flight.messages if not (m[0].endswith(suffix) and first < m[2] < last)
    ]
    return flight_metrics(read_flight(builder.write(path / "less.bag")))


def test_commands_that_stop_while_the_guard_streams(flight, tmp_path):
    figures = without(flight, COMMANDS, 112.0, 200.0, tmp_path)
    assert figures["command_gap_ms_max"] == pytest.approx(12_000.0, abs=41.0)  # landing: 124 s
    assert figures["command_rate_hz"] == pytest.approx(50.0 * 4.0 / 16.0, rel=0.01)
    stream = figures["streams"][COMMANDS]
    assert stream["gap_ms_max"] == pytest.approx(12_000.0, abs=41.0)
    assert stream["rate_hz"] == pytest.approx(50.0 * 2.0 / 14.0, rel=0.02)


def test_estimate_that_stops_has_no_end(flight, tmp_path):
    figures = without(flight, "nmpc/odometry", 112.0, 200.0, tmp_path)
    assert (figures["end_distance_m"], figures["arrived"]) == (None, None)
    missing = "\n".join(figures["missing"])
    assert "position estimates are missing for 8.0 s of 10.0 s while the reference ran" in missing
    assert "whether the aircraft arrived is not known" in missing
    assert "did not arrive" not in missing
    assert figures["streams"]["nmpc/odometry"]["gap_ms_max"] == pytest.approx(12_000.0, abs=41.0)


def test_hole_and_late_truth_are_named(flight, tmp_path):
    figures = without(flight, "nmpc/odometry", 112.0, 118.0, tmp_path)
    assert figures["end_distance_m"] == pytest.approx(0.25)
    assert any("estimates are missing for 6.0 s of 10.0 s" in s for s in figures["missing"])
    figures = without(flight, "uav_sim/ground_truth", 0.0, 113.0, tmp_path / "..")
    missing = "\n".join(figures["missing"])
    assert "true positions are missing for 3.0 s of 10.0 s" in missing
    assert "positions are missing for 3.0 s before the first or after the last" in missing


def test_edges_count_only_where_they_are_gaps():
    times = np.arange(0.5, 10.0, 1.0)
    assert stream_gaps(times, 0.0, 10.0) == pytest.approx(np.ones(9))
    assert stream_gaps(times, -3.0, 10.0) == pytest.approx([*np.ones(9), 3.5])
    assert stream_gaps(times, 20.0, 24.0) == pytest.approx([4.0])
    assert stream_gaps(times, 0.2, 1.4) == pytest.approx([0.3, 0.9])
    assert uncovered(times, 0.4, 9.5) == pytest.approx(9.0)
    assert uncovered(times, 20.0, 24.0) == pytest.approx(4.0)
