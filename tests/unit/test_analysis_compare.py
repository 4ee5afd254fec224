# SPDX-License-Identifier: MIT
"""Differences between flights: their size, their sign, and intervals that hold what they say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from nmpc_control.analysis.compare import as_text, compare
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Reference, Series
from nmpc_control.obstacle import Obstacle

TIMES = np.arange(0.0, 100.0, 0.05)
PATH = Reference(0.0, Series([0.0, 100.0], [[0.0, 0.0, 2.0], [100.0, 0.0, 2.0]]))


def flight(offset, noise=0.0, seed=0):
    """Return a flight beside its path, with noise that is remembered for 0.5 s."""
    random = np.random.default_rng(seed)
    remembered = lfilter([noise], [1.0, -0.9], random.standard_normal(len(TIMES) + 200))[200:]
    position = PATH.position_at(TIMES)
    position[:, 1] = offset + remembered
    plans = np.stack([np.full(len(TIMES), 2.0), np.full(len(TIMES), 1e-3 * offset)], axis=1)
    return FlightRecord(
        position=Series(TIMES, position),
        reference=PATH,
        solver=Series(TIMES, np.column_stack([plans, np.ones(len(TIMES))])),
    )


def row(rows, figure):
    return next(row for row in rows if row.figure == figure)


def test_difference_is_others_minus_baseline():
    rows = compare([flight(0.5), flight(0.7)], [flight(0.2)])
    deviation = row(rows, "average deviation")
    assert deviation.baseline == pytest.approx(0.6)
    assert deviation.other == pytest.approx(0.2)
    assert deviation.difference == pytest.approx(-0.4)
    # one against two flights: Student's t with one degree of freedom, spread 0.1
    assert deviation.low == pytest.approx(-0.4 - 0.1 * 12.706, rel=0.02)
    assert deviation.high == pytest.approx(-0.4 + 0.1 * 12.706, rel=0.02)
    assert not deviation.is_clear
    error = row(rows, "root mean square error")
    assert error.difference == pytest.approx(-0.4)
    one = row(compare([flight(0.5)], [flight(0.2)]), "root mean square error")
    assert (one.low, one.high) == pytest.approx((-0.3, -0.3))
    assert one.is_clear
    assert row(rows, "average solve time").difference == pytest.approx(-0.4)
    assert not any(r.figure == "average speed" for r in rows)


def test_same_flight_is_not_clearly_different():
    rows = compare([flight(1.0, 0.05, seed=1)], [flight(1.0, 0.05, seed=2)])
    assert not row(rows, "average deviation").is_clear


def test_intervals_hold_the_true_difference_as_often_as_they_say():
    """With 95 % intervals 40 draws miss more than 7 times once in 1000."""
    held = 0
    for seed in range(40):
        before, after = flight(2.0, 0.05, 2 * seed), flight(1.9, 0.05, 2 * seed + 1)
        deviation = row(compare([before], [after]), "average deviation")
        held += deviation.low <= -0.1 <= deviation.high
    assert held >= 33


@pytest.mark.parametrize("count", [2, 3])
def test_flights_that_differ_by_chance_are_seldom_called_different(count):
    """Of 50 pairs of sides without a difference more than 8 are clear once in 1000."""
    random = np.random.default_rng(3)
    clear = 0
    for _ in range(50):
        sides = [[flight(0.5 + 0.05 * x) for x in random.standard_normal(count)] for _ in "ab"]
        clear += row(compare(*sides), "average deviation").is_clear
    assert clear <= 8


def test_clearance_and_navigation_time_are_one_number_of_a_flight():
    post = (ObstacleTrack(Obstacle("post", np.array([50.0, 3.0, 2.0]), np.array([0.5]))),)
    still = np.where(TIMES[:, None] < 99.0, [[1.0, 0.0, 0.0]], 0.0)

    def arriving(offset):
        velocity = Series(TIMES, still)
        return replace(flight(offset), obstacles=post, velocity=velocity)

    rows = compare([arriving(0.2)], [arriving(0.0)])
    clearance = row(rows, "least clearance")
    assert clearance.difference == pytest.approx(0.2, abs=1e-6)
    assert (clearance.low, clearance.is_clear) == (None, False)
    assert clearance.baseline == pytest.approx(3.0 - 0.2 - 0.5 - 0.5, abs=1e-6)
    assert row(rows, "navigation time").baseline == pytest.approx(99.8, abs=0.06)
    assert "one flight: no interval" in as_text(rows, "a", "b")
    several = compare([arriving(0.2), arriving(0.21)], [arriving(0.0), arriving(0.01)])
    assert row(several, "least clearance").low is not None


def test_same_input_gives_the_same_interval_and_words():
    before, after = flight(0.5, 0.1, 1), flight(0.2, 0.1, 2)
    text = as_text(compare([before], [after]), "after.bag", "before.bag")
    assert text == as_text(compare([before], [after]), "after.bag", "before.bag")
    assert "after.bag compared with before.bag" in text
    assert "clear" in text


def test_nothing_in_common_is_nothing():
    assert compare([FlightRecord()], [flight(0.1)]) == []
