# SPDX-License-Identifier: MIT
"""The reference waits for an aircraft that is held up, and catches up afterwards."""

import numpy as np
import pytest

from nmpc_control.params import load_parameters
from nmpc_control.reference_clock import ReferenceClock
from nmpc_control.trajectory import Trajectory, hold, line, step

FLIGHT = load_parameters().flight
START, END = np.array([0.0, 0.0, 5.0]), np.array([60.0, 0.0, 5.0])
WAY = line(START, END, speed=1.5)  # 40 s
BEGIN, DT = 3.0, 0.05  # [s]


def run(clock: ReferenceClock, t: float, seconds: float, where) -> float:
    """Move the clock on with the aircraft at ``where(t)`` (3,); returns the time reached."""
    for _ in range(round(seconds / DT)):
        t += DT
        clock.advance(t, where(t))
    return t


def at(trajectory: Trajectory, s: float) -> np.ndarray:
    return trajectory.sample(np.array([s])).position[0]


def test_it_runs_with_time_while_the_aircraft_follows():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    late = 0.4  # [s]
    t = run(clock, BEGIN, 20.0, lambda t: at(WAY, max(0.0, t - BEGIN - late)))
    assert clock.time == pytest.approx(t - BEGIN)
    assert clock.rate == 1.0


def test_it_stands_at_twice_the_lag_and_not_before():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 5.0, lambda t: at(WAY, t - BEGIN))
    stuck = at(WAY, 5.0)
    t = run(clock, t, 0.9 * FLIGHT.wait_lag, lambda _: stuck)
    assert not clock.waits and clock.rate > 0.9
    t = run(clock, t, 30.0, lambda _: stuck)
    assert clock.waits
    assert clock.time - 5.0 == pytest.approx(2.0 * FLIGHT.wait_lag, abs=0.15)
    assert clock.over < 0.0, "its end does not pass either"


def test_it_catches_up_faster_than_its_own_pace_and_no_further():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 5.0, lambda t: at(WAY, t - BEGIN))
    t = run(clock, t, 6.0, lambda _: at(WAY, 5.0))
    behind = t - BEGIN - clock.time
    assert behind > 3.0
    rates = []

    def follows(_):
        rates.append(clock.rate)
        return at(WAY, clock.time)

    t = run(clock, t, 5.0, follows)
    assert rates[5:] == [1.0 + FLIGHT.catch_up] * len(rates[5:])
    t = run(clock, t, behind / FLIGHT.catch_up, follows)
    assert clock.rate == 1.0
    assert clock.time == pytest.approx(t - BEGIN, abs=0.05)


def test_after_a_hold_up_it_starts_beside_the_aircraft_and_stays_there_until_that_is_under_way():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 15.0, lambda _: at(WAY, 5.0))
    assert clock.time > 6.5
    clock.release(t)
    t = run(clock, t, 1.5, lambda _: at(WAY, 5.0))
    assert clock.time == pytest.approx(5.1, abs=0.1)
    t = run(clock, t, 2.0, lambda _: at(WAY, clock.time))
    assert clock.rate == 1.0 + FLIGHT.catch_up
    t = run(clock, t, 1.0 + FLIGHT.wait_lag, lambda _: at(WAY, 5.0))
    assert clock.time > 6.0, "later it waits as ever"


def test_what_lies_ahead_is_read_at_full_pace_also_while_it_waits():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 20.0, lambda _: START)
    assert clock.waits
    ahead = clock.read(t + np.array([0.0, 1.0, 6.0]))
    assert ahead - clock.time == pytest.approx([0.0, 1.0, 6.0])


def test_a_reference_that_jumps_never_waits():
    """Nobody is where it was a moment ago, and no lag can be told."""
    jump = step(START, START + [20.0, 0.0, 0.0], time=2.0, duration=30.0)
    clock = ReferenceClock(jump, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 25.0, lambda _: START)
    assert clock.time == pytest.approx(t - BEGIN)


def test_hovering_somewhat_off_is_no_lag():
    clock = ReferenceClock(hold(START, 30.0), BEGIN, FLIGHT)
    t = run(clock, BEGIN, 25.0, lambda _: START + [0.0, 2.0, 0.0])
    assert clock.time == pytest.approx(t - BEGIN)


def test_flying_beside_the_path_is_no_lag():
    """A way round an obstacle leads off the path, but goes on."""
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 20.0, lambda t: at(WAY, t - BEGIN) + [0.0, 3.0, 0.0])
    assert clock.time == pytest.approx(t - BEGIN)


def test_the_last_of_its_time_is_counted_whatever_the_aircraft_does():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, WAY.duration + 0.1, lambda t: at(WAY, t - BEGIN))
    assert clock.over > 0.0
    run(clock, t, 5.0, lambda _: START)
    assert clock.over == pytest.approx(5.1, abs=0.1)


def test_time_that_goes_back_moves_nothing():
    clock = ReferenceClock(WAY, BEGIN, FLIGHT)
    t = run(clock, BEGIN, 2.0, lambda t: at(WAY, t - BEGIN))
    clock.advance(t - 1.0, at(WAY, 2.0))
    assert clock.time == pytest.approx(2.0)
