# SPDX-License-Identifier: MIT
"""Watchdogs over the state, the loop and what was heard, each with a twin that stays silent."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import LIMITS, PARAMS, VEHICLE

from nmpc_control import start_checks
from nmpc_control.distrust import Distrust
from nmpc_control.estimator import StateEstimate
from nmpc_control.liveness import Liveness
from nmpc_control.loop_watch import LoopWatch
from nmpc_control.params import load_vehicle
from nmpc_control.state import hover_state
from nmpc_control.watch import Watch

P = PARAMS.watch
TICK = 0.02  # [s]


def estimate(t, position, velocity=(0.0, 0.0, 0.0), roll=0.0, pitch=0.0):
    x = hover_state(np.array(position, dtype=float))
    x[6:9], x[3], x[4] = velocity, roll, pitch
    return StateEstimate(t, x, 0.0, 0.0, 0.0)


def watch_over(path, velocity, seconds=3.0):
    """Return the alarms of a watch that sees positions ``path(t)`` and a velocity."""
    watch, alarms = Watch(P, LIMITS), []
    for t in np.arange(0.0, seconds, TICK):
        watch.look(estimate(t, path(t), velocity))
        alarms.append(watch.alarm)
    return alarms, watch


def test_a_flight_that_goes_where_its_velocity_leads_is_let_be():
    rng = np.random.default_rng(1)
    noisy = lambda t: [5.0 * t, 0.0, 5.0] + rng.normal(0.0, 0.2, 3)  # noqa: E731
    assert set(watch_over(noisy, [5.0, 0.0, 0.0], 20.0)[0]) == {""}


def test_a_jump_of_the_position_is_seen_in_the_same_tick_counted_once_and_forgotten():
    alarms, watch = watch_over(lambda t: [3.0 * (t >= 1.0), 0.0, 5.0], [0.0, 0.0, 0.0])
    assert "3.0 m from where the velocity leads" in alarms[50]
    assert set(alarms[:50]) == {""}
    assert alarms[-1] == ""
    assert watch.jumps == 1
    assert watch.has_jumped(2.5)
    assert not watch.has_jumped(9.0)


def test_a_position_off_twice_is_not_believed_again_until_somebody_starts():
    step = lambda t: [3.0 * (t >= 1.0) + 3.0 * (t >= 8.0), 0.0, 5.0]  # noqa: E731
    alarms, watch = watch_over(step, [0.0, 0.0, 0.0], 20.0)
    assert alarms[int(7.0 / TICK)] == ""
    assert "" not in alarms[int(8.1 / TICK) :]
    assert "not believed any more" in alarms[-1]
    watch.begin_flight()
    watch.look(estimate(20.0, step(20.0)))
    assert watch.alarm == ""


def test_twin_off_once_more_much_later_it_is():
    step = lambda t: [3.0 * (t >= 1.0) + 3.0 * (t >= 40.0), 0.0, 5.0]  # noqa: E731
    assert watch_over(step, [0.0, 0.0, 0.0], 45.0)[0][-1] == ""


def test_a_position_that_stands_still_while_the_aircraft_flies_is_seen():
    alarms, _ = watch_over(lambda t: [0.0, 0.0, 5.0], [4.0, 0.0, 0.0])
    first = next(k for k, alarm in enumerate(alarms) if alarm) * TICK
    # sum of 4 m/s over exp(-t) reaches 2.5 m where 1 - exp(-t) = 2.5 / 4
    assert first == pytest.approx(-math.log(1.0 - P.position_jump / 4.0), abs=2 * TICK)


@pytest.mark.parametrize(
    ("position", "velocity", "alarm"),
    [
        ([0.0, 0.0, 125.0], [0.0, 0.0, 1.0], "outside of the fence"),
        ([0.0, 0.0, 125.0], [0.0, 0.0, -1.0], ""),  # on the way back
        ([0.0, 0.0, 121.0], [0.0, 0.0, 1.0], ""),  # a gust may do that
        ([0.0, 1005.0, 5.0], [0.0, 1.0, 0.0], "outside of the fence"),
        ([0.0, 0.0, 5.0], [15.0, 0.0, 0.0], "15.0 m/s"),
    ],
)
def test_fence_and_speed(position, velocity, alarm):
    watch = Watch(P, LIMITS)
    watch.look(estimate(0.0, position, velocity))
    assert (alarm in watch.alarm) if alarm else watch.alarm == ""


def test_tilt_is_timed_and_ends_when_upright():
    watch = Watch(P, LIMITS)
    for t in np.arange(0.0, 0.61, TICK):
        watch.look(estimate(t, [0.0, 0.0, 5.0], roll=0.8, pitch=0.6))
    assert watch.tilt_time == pytest.approx(0.6)
    assert watch.alarm.startswith("the tilt is 55 degrees")
    watch.look(estimate(0.62, [0.0, 0.0, 5.0], roll=0.5))
    assert (watch.tilt_time, watch.alarm) == (0.0, "")


# what was heard, on a steady clock


def ages(step, stamps_are_late=0.0, seconds=2.0, silent_from=math.inf):
    """Return ages of a 50 Hz source while the host's clock steps at 1 s."""
    liveness, stamp, result = Liveness(), -math.inf, []
    for k in range(round(seconds / TICK)):
        now = 100.0 + k * TICK
        t = now + 1e9 + (step if now >= 101.0 else 0.0)
        if (
            now < silent_from and not 101.0 <= now < 101.019
        ):  # nothing comes in the tick of the step
            stamp = t - stamps_are_late
        result.append(liveness.age("rc", stamp, t, now))
    return result


@pytest.mark.parametrize("step", [0.5, 40.0, -40.0])
def test_a_step_of_the_hosts_clock_makes_nothing_old(step):
    assert max(ages(step)) < 0.05


def test_silence_is_as_old_as_it_is_whatever_the_clock_does():
    assert ages(40.0, silent_from=100.5)[-1] == pytest.approx(1.48, abs=0.03)
    assert ages(-40.0, silent_from=100.5)[-1] == pytest.approx(1.48, abs=0.03)


def test_old_stamps_are_old_though_they_have_just_come():
    assert min(ages(0.0, stamps_are_late=1.0)) >= 0.99


def test_what_never_came_is_infinitely_old():
    assert Liveness().age("rc", -math.inf, 1.0, 1.0) == math.inf


def test_the_loop_knows_its_rate_and_jitter():
    loop = LoopWatch(50.0)
    assert math.isnan(loop.rate)
    t = 0.0
    for k in range(250):
        t += 0.06 if k % 50 == 0 else 0.02
        loop.tick(t)
    assert loop.rate == pytest.approx(249 / (249 * 0.02 + 4 * 0.04))
    assert loop.worst == pytest.approx(0.06)
    assert loop.jitter == pytest.approx(0.04)
    assert loop.late == pytest.approx(4 / 249)
    assert start_checks.loop(loop, P) == ""
    slow = LoopWatch(50.0)
    for k in range(100):
        slow.tick(0.04 * k)
    assert "25 of 50 Hz" in start_checks.loop(slow, P)


@pytest.mark.parametrize(
    ("wrong", "stands"),
    [([0.0, 0.1, 0.2], False), ([0.0, 0.1, 0.6], True), ([0.0, 0.1, 40.0], False)],
)
def test_what_is_wrong_twice_soon_is_not_trusted_until_a_new_start(wrong, stands):
    distrust = Distrust()
    for t in np.arange(0.0, 50.0, 0.1):
        distrust.note(float(t), any(abs(t - w) < 0.05 for w in wrong))
    assert distrust.stands is stands
    distrust.forgive()
    assert not distrust.stands


# before a start


@pytest.mark.parametrize(
    ("position", "velocity", "on_ground", "finding"),
    [
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], True, ""),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], True, "not at rest"),
        ([0.0, 0.0, 40.0], [0.0, 0.0, 0.0], True, "height is 40.0 m"),
        ([2000.0, 0.0, 0.0], [0.0, 0.0, 0.0], True, "outside of the fence"),
        ([0.0, 0.0, 40.0], [3.0, 0.0, 0.0], False, ""),
        ([0.0, 0.0, 140.0], [0.0, 0.0, 0.0], False, "outside of the fence"),
    ],
)
def test_the_place_of_a_start(position, velocity, on_ground, finding):
    sentence = start_checks.place(estimate(0.0, position, velocity), on_ground, LIMITS, P)
    assert (finding in sentence) if finding else sentence == ""


def test_headings_that_differ_stand_against_a_start():
    assert start_checks.headings(math.nan, P) == ""
    assert start_checks.headings(0.1, P) == ""
    assert "differ by 90 degrees" in start_checks.headings(-math.pi / 2.0, P)


@pytest.mark.parametrize("name", ["dji_hil", "eth", "paper"])
def test_the_maps_that_ship_count_for_a_simulator_only(name):
    vehicle = load_vehicle(name)
    assert "a simulator's" in start_checks.thrust_map(vehicle, "thrust", False)
    assert start_checks.thrust_map(vehicle, "thrust", True) == ""
    assert start_checks.thrust_map(vehicle, "velocity", False) == ""


def test_a_map_measured_on_an_airframe_counts_and_an_empty_one_never():
    def measured(where):
        thrust_map = dataclasses.replace(VEHICLE.thrust_map, measured_on=where)
        return dataclasses.replace(VEHICLE, thrust_map=thrust_map)

    assert start_checks.thrust_map(measured("our M100, June"), "thrust", False) == ""
    assert "is empty" in start_checks.thrust_map(measured(" "), "thrust", True)
