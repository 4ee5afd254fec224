# SPDX-License-Identifier: MIT
"""Deviation, path deviation and arrival against flights whose answers are known."""

import numpy as np
import pytest

from nmpc_control.analysis.deviation import arrival_time, errors, path_deviation
from nmpc_control.analysis.record import Reference, Series

START = 100.0


def line(duration=10.0, speed=1.0):
    """Along x, sampled every 0.1 s, clock started at START."""
    times = np.arange(0.0, duration + 0.05, 0.1)
    return Reference(START, Series(times, np.outer(speed * times, [1.0, 0.0, 0.0])))


def square():
    """Closed: 1 m sides in 1 s each."""
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]]
    return Reference(START, Series(np.arange(5.0), corners))


def still(times):
    return Series(times, np.zeros((len(times), 3)))


def test_constant_offset_from_a_moving_reference():
    times = np.arange(95.0, 115.0, 0.013)  # never on the reference's own samples
    flown = Series(times, line().position_at(times) + [0.0, 0.18, 0.24])
    error = errors(flown, line(), START, START + 10.0)
    assert np.linalg.norm(error.values, axis=1) == pytest.approx(0.3, abs=1e-12)
    assert error.times.min() >= START
    assert error.times.max() <= START + 10.0


def test_lag_is_deviation_but_not_path_deviation():
    times = np.arange(102.0, 110.0, 0.02)
    flown = Series(times, line().position_at(times - 0.5))
    error = errors(flown, line(), START, START + 10.0)
    assert np.linalg.norm(error.values, axis=1) == pytest.approx(0.5, abs=1e-9)
    assert path_deviation(flown.values, line().path.values) == pytest.approx(0.0, abs=1e-9)


def test_path_deviation_at_corners_ends_and_beside():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])
    points = np.array([[0.5, -0.2, 0.0], [1.3, -0.4, 0.0], [1.0, 2.0, 0.0], [0.9, 0.5, 0.2]])
    expected = [0.2, 0.5, 1.0, np.hypot(0.1, 0.2)]
    assert path_deviation(points, corner) == pytest.approx(expected, abs=1e-12)


def test_path_deviation_from_a_point_and_with_repeated_points():
    point = np.array([[1.0, 2.0, 3.0]])
    assert path_deviation(np.zeros((1, 3)), point) == pytest.approx(np.sqrt(14.0))
    assert path_deviation(np.zeros((1, 3)), np.repeat(point, 3, axis=0)) == pytest.approx(
        np.sqrt(14.0)
    )


def test_path_deviation_in_blocks_equals_one_by_one():
    generator = np.random.default_rng(1)
    points, curve = generator.normal(size=(300, 3)), generator.normal(size=(9001, 3))
    single = [path_deviation(point[None], curve)[0] for point in points[:20]]
    assert path_deviation(points, curve)[:20] == pytest.approx(single, abs=1e-12)


def test_arrival_needs_both_nearness_and_slowness():
    times = np.arange(START, START + 20.0, 0.01)
    flown = Series(times, line().position_at(times))
    speed = np.where(times < START + 12.0, 1.0, 0.1)  # slow 2 s after it came near
    velocity = Series(times, np.outer(speed, [1.0, 0.0, 0.0]))
    assert arrival_time(flown, velocity, line(), START + 20.0) == pytest.approx(START + 12.0)
    beside = Series(times, flown.values + [0.0, 0.31, 0.0])
    assert arrival_time(beside, velocity, line(), START + 20.0) is None
    assert arrival_time(flown, velocity, line(), START + 11.0) is None


def test_closed_path_does_not_arrive_at_its_start():
    times = np.arange(START - 5.0, START + 10.0, 0.01)
    flown = Series(times, square().position_at(times))
    arrival = arrival_time(flown, still(times), square(), START + 10.0)
    assert arrival == pytest.approx(START + 3.7, abs=0.02)  # 0.3 m before the end, at 1 m/s


def test_hover_arrives_when_its_time_is_over():
    hover = Reference(START, Series([0.0, 5.0], np.zeros((2, 3))))
    times = np.arange(START, START + 8.0, 0.01)
    arrival = arrival_time(still(times), still(times), hover, START + 8.0)
    assert arrival == pytest.approx(START + 5.0, abs=0.011)
