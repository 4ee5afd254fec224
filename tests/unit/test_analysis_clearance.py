# SPDX-License-Identifier: MIT
"""Clearance between samples, against geometry done by hand and against dense sampling."""

import numpy as np
import pytest

from nmpc_control.analysis.clearance import clearance, clearance_figures
from nmpc_control.analysis.obstacle_tracks import obstacle_tracks
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Series
from nmpc_control.analysis.recording import Event
from nmpc_control.analysis.windows import Window
from nmpc_control.obstacle import Obstacle

HULL = 0.5
SPHERE = Obstacle("ball", np.array([5.0, 2.0, 3.0]), np.array([0.6]))
CYLINDER = Obstacle("mast", np.array([5.0, 2.0, 3.0]), np.array([0.4, 2.0]), "cylinder")
BOX = Obstacle("crate", np.array([5.0, 2.0, 3.0]), np.array([1.0, 2.0, 0.5]), "box")


def path(points, times=None):
    times = np.arange(float(len(points))) if times is None else times
    return Series(times, np.array(points, dtype=float))


def test_pass_between_two_samples_counts():
    # A line along x through y = 0, z = 3 passes the centre at 2 m; both samples are 5.4 m away.
    flown = path([[0, 0, 3], [10, 0, 3]])
    assert clearance(flown, ObstacleTrack(SPHERE), HULL) == pytest.approx(2.0 - 0.6 - 0.5, abs=1e-9)
    at_samples = SPHERE.distance(flown.values).min() - HULL
    assert at_samples > 4.0


def test_flight_through_an_obstacle_between_two_samples_is_negative():
    flown = path([[0, 2, 3], [10, 2, 3]])
    assert clearance(flown, ObstacleTrack(SPHERE), HULL) == pytest.approx(-0.6 - 0.5, abs=1e-9)


def test_radius_zero_counts_from_the_centre():
    flown = path([[0, 0, 3], [10, 0, 3]])
    assert clearance(flown, ObstacleTrack(SPHERE), 0.0) == pytest.approx(1.4, abs=1e-9)


def test_single_sample():
    flown = path([[5, 0, 3]])
    assert clearance(flown, ObstacleTrack(SPHERE), HULL) == pytest.approx(0.9, abs=1e-12)


@pytest.mark.parametrize("obstacle", [SPHERE, CYLINDER, BOX], ids=lambda o: o.shape)
@pytest.mark.parametrize("seed", range(5))
def test_equals_dense_sampling(obstacle, seed):
    corners = np.random.default_rng(seed).uniform([3, 0, 1], [7, 4, 5], (12, 3))
    flown = path(corners)
    dense = flown.at(np.linspace(0.0, 11.0, 200_001))
    expected = obstacle.distance(dense).min() - HULL
    # The dense samples are at most 6 m / 18182 apart, and distance changes no faster.
    assert clearance(flown, ObstacleTrack(obstacle), HULL) == pytest.approx(expected, abs=2e-4)


def test_moving_obstacle_meets_between_samples():
    # Aircraft and obstacle change places along x, 1 m apart in y: they pass each other half way.
    moving = Obstacle("car", np.array([10.0, 1.0, 0.0]), np.array([0.3]))
    seen = Series([0.0, 1.0], [[10.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    flown = path([[0, 0, 0], [10, 0, 0]])
    track = ObstacleTrack(moving, seen)
    assert clearance(flown, track, HULL) == pytest.approx(1.0 - 0.3 - 0.5, abs=1e-9)


def test_constant_velocity_from_the_stamp():
    car = Obstacle(
        "car",
        np.array([0.0, 4.0, 0.0]),
        np.array([0.3]),
        velocity=np.array([0.0, -1.0, 0.0]),
        stamp=0.0,
    )
    flown = path([[0, 0, 0], [0, 0, 0], [0, 0, 0]])  # waits 2 s at the origin
    assert clearance(flown, ObstacleTrack(car), HULL) == pytest.approx(2.0 - 0.3 - 0.5, abs=1e-9)


def test_obstacle_counts_only_while_it_is_there():
    flown = path([[5, 2, 3], [5, 5, 3], [5, 8, 3], [5, 2, 3]])
    track = ObstacleTrack(SPHERE, begin=1.0, end=2.0)
    assert clearance(flown, track, HULL) == pytest.approx(3.0 - 0.6 - 0.5, abs=1e-9)
    assert clearance(flown, ObstacleTrack(SPHERE, begin=7.0), HULL) is None


def seen(*observations):
    """Return messages of a car of 0.3 m, each of (time, y, velocity along y), 5 m ahead."""
    messages = []
    for t, y, speed in observations:
        velocity = np.array([0.0, speed, 0.0])
        car = Obstacle("car", np.array([5.0, y, 0.0]), np.array([0.3]), "sphere", velocity)
        messages.append(Event(t, t, [car]))
    return messages


@pytest.mark.parametrize(
    "observations",
    [
        [(0.0, -10.0, 1.0), (1.0, -9.0, 1.0)],  # then silence: it is at y = 0 after 10 s
        [(19.0, 9.0, 1.0), (20.0, 10.0, 1.0)],  # found late: it was there after 10 s
        [(0.0, -10.0, 1.0)],
        [(8.0, -3.0, 1.0), (9.0, -1.0, 1.0)],  # went at 2 m/s in between, then slows to 1 m/s
    ],
)
def test_moving_obstacle_goes_on_where_nobody_observes_it(observations):
    flown = path([[0, 0, 0], [10, 0, 0]], np.array([0.0, 20.0]))
    flown = Series(np.arange(0.0, 20.01, 0.1), flown.at(np.arange(0.0, 20.01, 0.1)))
    tracks = obstacle_tracks(seen(*observations), 0.0, 20.0)
    missing = []
    record = FlightRecord(true_position=flown, obstacles=tracks, automatic=(0.0, 20.0))
    figures = clearance_figures(record, Window(0.0, 20.0, 20.0), HULL, missing)
    assert figures["clearance_m"]["car"] == pytest.approx(-0.8, abs=1e-6)
    assert figures["collisions"] == 1
    assert any("moving obstacles (car) were not observed for up to" in s for s in missing)


def test_velocity_before_the_first_observation_is_the_first_one():
    (track,) = obstacle_tracks(seen((2.0, 4.0, 1.0), (3.0, 5.0, -2.0)), 0.0, 9.0)
    assert track.centre_at(np.array([0.0, 2.5, 5.0]))[:, 1] == pytest.approx([2.0, 4.5, 1.0])


def test_obstacle_that_is_observed_all_the_time_has_no_remark():
    times = np.arange(0.0, 20.01, 0.1)
    flown = Series(times, np.zeros((len(times), 3)))
    tracks = obstacle_tracks(seen(*((t, t - 10.0, 1.0) for t in times)), 0.0, 20.0)
    record = FlightRecord(true_position=flown, obstacles=tracks, automatic=(0.0, 20.0))
    missing = []
    clearance_figures(record, Window(0.0, 20.0, 20.0), HULL, missing)
    assert missing == []
