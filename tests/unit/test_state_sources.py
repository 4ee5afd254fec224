# SPDX-License-Identifier: MIT
"""What of a source is believed, on which clock, and how one source follows another."""

import dataclasses
import math

import numpy as np
import pytest

from nmpc_control.errors import ConfigError
from nmpc_control.estimator import Estimator
from nmpc_control.rotations import quaternion_from_rpy
from nmpc_control.source_params import GPS, VICON, WORLD_POSITION, load_source_parameters
from nmpc_control.state import POSITION, VELOCITY
from nmpc_control.state_sources import StateSources

ALL = load_source_parameters(position_source=VICON, standby="gps,world_position")
SPEED = np.array([1.0, -0.5, 0.2])
LATENCY = ALL.telemetry_latency


def place(t):
    return np.array([3.0, 4.0, 5.0]) + SPEED * t


class Flight:
    """A straight flight seen by telemetry (late), by Vicon (at once) and by others beside it."""

    def __init__(self, parameters=ALL, yaw=0.0, beside=(0.0, 0.0, 0.0)):
        self.sources = StateSources(parameters, Estimator())
        self.yaw = yaw  # [rad] of Vicon; the telemetry says 0
        self.beside = np.array(beside)  # [m] of GPS
        self.t = 0.0
        self.silent = set()
        self.told = []  # positions (3,) less the truth, velocities less the truth

    def run(self, seconds):
        for _ in range(round(seconds / 0.01)):
            self.t += 0.01
            self.hear(self.t)
            estimate = self.sources.estimator.estimate(self.t)
            if estimate is not None:
                truth = place(self.t - LATENCY)
                x = estimate.vector
                self.told.append((x[POSITION] - truth, x[VELOCITY] - SPEED))
        return self

    def hear(self, t):
        sources, estimator = self.sources, self.sources.estimator
        if "telemetry" not in self.silent:
            estimator.add_attitude(t, (0.0, 0.0, 0.0, 1.0))
            estimator.add_imu(t, (0.0, 0.0, 0.0))
            sources.add_velocity(t, SPEED)
        if VICON not in self.silent:
            sources.add_pose(t, place(t), quaternion_from_rpy(0.0, 0.0, self.yaw))
        if GPS not in self.silent:
            sources.add_position(GPS, t, place(t - LATENCY) + self.beside)

    @property
    def offset(self):
        return self.told[-1][0]


def test_all_sources_are_brought_to_the_time_of_the_telemetry():
    flight = Flight().run(1.0)
    assert np.abs(flight.offset).max() < 1e-3
    flight.sources.select(GPS, flight.t, in_flight=False)
    flight.run(0.1)
    assert np.abs(flight.offset).max() < 1e-9


def test_twin_without_the_latency_the_position_is_ahead():
    unknown = dataclasses.replace(ALL, telemetry_latency=0.0)
    flight = Flight(unknown).run(1.0)
    assert np.linalg.norm(flight.offset) == pytest.approx(LATENCY * np.linalg.norm(SPEED), rel=0.1)


def test_a_change_of_source_lets_the_difference_go_slowly_and_to_the_end():
    beside = np.array([0.6, -0.3, 0.2])  # 0.7 m: 3.5 s at 0.2 m/s
    flight = Flight(beside=beside).run(1.0)
    done, sentence = flight.sources.select(GPS, flight.t)
    assert done
    assert sentence == "position comes from gps; 0.70 m let go in 3.5 s"
    count = len(flight.told)
    flight.run(5.0)
    offsets = np.array([offset for offset, _ in flight.told[count - 1 :]])
    steps = np.linalg.norm(np.diff(offsets, axis=0), axis=1)
    assert steps.max() <= ALL.switching.blend_speed * 0.01 * 1.01
    assert np.linalg.norm(offsets[-1] - beside) < 1e-9
    velocities = np.array([velocity for _, velocity in flight.told[count - 1 :]])
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.02
    assert flight.sources.active == GPS


def test_back_in_the_middle_of_a_change_nothing_jumps_either():
    flight = Flight(beside=(0.6, 0.0, 0.0)).run(1.0)
    assert flight.sources.select(GPS, flight.t)[0]
    flight.run(1.0)
    assert flight.sources.select(VICON, flight.t)[0]
    flight.run(4.0)
    steps = np.diff([offset[0] for offset, _ in flight.told])
    assert np.abs(steps).max() < 0.004
    assert abs(flight.offset[0]) < 1e-3


def test_the_other_node_that_is_told_flies_on_the_same_state():
    a, b = Flight(beside=(0.5, 0.0, 0.0)).run(1.0), Flight(beside=(0.5, 0.0, 0.0)).run(1.0)
    a.sources.select(GPS, a.t)
    b.run(0.05)  # it hears later
    b.sources.follow(a.sources.last_switch)
    a.run(1.0), b.run(0.95)
    np.testing.assert_allclose(a.offset, b.offset, atol=1e-9)


@pytest.mark.parametrize(
    ("silent", "name", "words"),
    [
        (GPS, GPS, "gps is 0.30 s old: the two cannot be compared"),
        (VICON, GPS, "vicon is 0.28 s old: the two cannot be compared"),
        ("", WORLD_POSITION, "world_position is missing: the two cannot be compared"),
        ("", VICON, "vicon is the source already"),
        ("", "stars", "'stars' is not listened to, only vicon, gps, world_position"),
    ],
)
def test_a_change_that_cannot_be_is_refused_with_a_sentence(silent, name, words):
    flight = Flight().run(1.0)
    flight.silent = {silent}
    flight.run(0.3)
    assert flight.sources.select(name, flight.t) == (False, words)
    assert flight.sources.active == VICON


def test_sources_that_disagree_are_not_changed_in_flight_but_on_the_ground():
    flight = Flight(beside=(0.0, 1.2, 0.0)).run(1.0)
    done, words = flight.sources.select(GPS, flight.t)
    assert not done
    assert words == "gps is 1.20 m from vicon, at most 1 m are let go in flight"
    assert flight.sources.select(GPS, flight.t, in_flight=False)[0]


def test_velocities_that_disagree_are_not_changed_either():
    flight = Flight().run(1.0)
    flight.sources.add_velocity(flight.t + 0.001, SPEED + [0.0, 0.0, 0.8])
    flight.sources.add_position(GPS, flight.t + 0.001, place(flight.t - LATENCY))
    done, words = flight.sources.select(GPS, flight.t)
    assert not done
    assert "differ by 0.8" in words


def test_an_outlier_is_refused_and_counted_a_jump_that_stays_is_the_new_truth():
    flight = Flight().run(1.0)
    before = flight.sources.estimator.estimate(flight.t).vector
    assert not flight.sources.add_pose(flight.t + 0.005, place(flight.t) + 3.0, (0, 0, 0, 1))
    assert flight.sources.refused()["vicon outliers"] == 1
    np.testing.assert_array_equal(flight.sources.estimator.estimate(flight.t).vector, before)
    flight.run(0.1)
    assert np.abs(flight.offset).max() < 1e-3

    straight, hear = flight.told[-1][1], flight.sources.add_position
    begin = flight.t
    while not hear(VICON, flight.t + 0.01, place(flight.t + 0.01) + [3.0, 0.0, 0.0]):
        flight.t += 0.01
        assert flight.sources.estimator.age("position", flight.t) <= flight.t - begin
    assert flight.t - begin == pytest.approx(ALL.vicon.jump_time, abs=0.03)
    assert flight.sources.refused()["vicon jumps"] == 1
    x = flight.sources.estimator.estimate(flight.t).vector
    assert x[0] - place(flight.t - LATENCY)[0] == pytest.approx(3.0, abs=0.05)
    assert np.abs(x[VELOCITY] - SPEED - straight).max() < 0.05  # the motion is as it was


def test_outliers_here_and_there_are_never_taken_for_the_truth():
    flight, random = Flight().run(1.0), np.random.default_rng(3)
    flight.silent = {VICON}
    for _ in range(20):  # longer than jump_time, but nowhere twice
        flight.t += 0.01
        wild = place(flight.t) + 5.0 * random.normal(size=3)
        assert not flight.sources.add_pose(flight.t, wild, (0, 0, 0, 1))
    assert flight.sources.refused() == {"vicon outliers": 20}
    assert flight.sources.estimator.age("position", flight.t) > 0.15


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_and_what_comes_late_is_refused_and_counted(bad):
    flight = Flight().run(1.0)
    sources, t = flight.sources, flight.t
    before = sources.estimator.estimate(t).vector
    assert not sources.add_pose(t + 0.01, (bad, 0.0, 0.0), (0, 0, 0, 1))
    assert not sources.add_pose(t + 0.01, place(t), (0, 0, bad, 1))
    assert not sources.add_pose(t + 0.01, place(t), (0, 0, 0, 0.5))
    assert not sources.add_pose(bad, place(t), (0, 0, 0, 1))
    assert not sources.add_position(GPS, t, (bad, 0.0, 0.0))
    assert not sources.add_velocity(t, (bad, 0.0, 0.0))
    assert not sources.add_pose(t - 0.5, place(t - 0.5), (0, 0, 0, 1))
    assert not sources.add_position(WORLD_POSITION, t, (0.0, 0.0))
    assert sources.refused() == {
        "vicon bad": 4,
        "vicon late": 1,
        "gps bad": 1,
        "world_position bad": 1,
    }
    np.testing.assert_array_equal(sources.estimator.estimate(t).vector, before)
    assert flight.run(0.1).sources.is_alive(VICON, flight.t)


def test_a_drop_out_is_carried_on_while_the_age_grows():
    flight = Flight().run(1.0)
    flight.silent = {VICON}
    flight.run(0.2)
    assert np.abs(flight.offset).max() < 0.01
    assert flight.sources.estimator.age("position", flight.t) == pytest.approx(0.2 - LATENCY)
    assert not flight.run(0.1).sources.is_alive(VICON, flight.t)


def test_the_velocity_is_told_only_when_it_is_known():
    flight = Flight()
    flight.silent = {GPS}
    flight.run(0.02)
    assert flight.sources.estimator.estimate(flight.t) is None
    flight.run(0.2)
    assert np.abs(flight.told[0][1]).max() < 0.5
    assert np.abs(flight.told[-1][1]).max() < 0.05


@pytest.mark.parametrize("yaw", [0.0, 0.3, -0.4, math.pi])
def test_yaws_of_vicon_and_telemetry_are_compared(yaw):
    flight = Flight(yaw=yaw).run(1.0)
    off = flight.sources.yaw_disagreement(flight.t)
    assert math.cos(off - yaw) == pytest.approx(1.0)
    flight.silent = {VICON}
    flight.run(0.4)
    assert flight.sources.yaw_disagreement(flight.t) is None


def test_a_jump_of_the_clock_forgets_everything_but_the_source():
    flight = Flight().run(1.0)
    flight.sources.select(GPS, flight.t, in_flight=False)
    flight.sources.forget(Estimator())
    assert flight.sources.estimator.estimate(0.0) is None
    flight.t = 0.0
    flight.told.clear()
    flight.run(1.0)
    assert flight.sources.active == GPS
    assert np.abs(flight.offset).max() < 1e-9


def test_a_source_that_is_none_is_no_parameter():
    with pytest.raises(ConfigError, match="standby"):
        load_source_parameters(standby="gps, stars")
    with pytest.raises(ConfigError, match="position_source"):
        load_source_parameters(position_source="external")


@pytest.mark.parametrize("name", [GPS, VICON, WORLD_POSITION])
def test_a_position_that_repeats_itself_while_the_velocity_leads_away_grows_old(name):
    sources = StateSources(load_source_parameters(position_source=name), Estimator())
    believed = repeats(sources, name, 0.0, SPEED)
    assert 0.35 < max(believed) < 0.5  # 0.5 m at 1.14 m/s
    assert sources.refused()[f"{name} frozen"] > 100
    assert sources.estimator.age("position", 3.0) > 2.5
    assert not repeats(sources, name, 3.0, np.zeros(3), seconds=60.0)  # at rest: as wrong as before
    assert sources.add_position(name, 63.01, place(0.1))  # it goes on: it is one again


def test_a_height_that_goes_on_does_not_hide_a_place_that_stands():
    sources = StateSources(load_source_parameters(), Estimator())
    believed = []
    for t in 0.01 * np.arange(1, 300):
        sources.add_velocity(t, np.array([1.0, 0.0, 0.1]))
        believed.append(sources.add_position(GPS, t, (1.0, 2.0, 3.0 + 0.1 * t)))
    assert 45 < sum(believed) < 60


def test_twin_at_rest_it_is_believed_for_minutes_whatever_the_velocity_is_off_by():
    sources = StateSources(load_source_parameters(), Estimator())
    believed = repeats(sources, GPS, 0.0, np.array([0.08, 0.0, 0.0]), seconds=120.0)
    assert len(believed) == 12000


def repeats(sources, name, begin, speed, seconds=3.0):
    """Return the times [s] at which one and the same position was believed."""
    believed = []
    for t in begin + 0.01 * np.arange(1, round(seconds / 0.01) + 1):
        sources.add_velocity(t, speed)
        if sources.add_position(name, t, (1.0, 2.0, 3.0)):
            believed.append(t)
    return believed
