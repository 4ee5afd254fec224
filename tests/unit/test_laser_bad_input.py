# SPDX-License-Identifier: MIT
"""Scans that make no sense, parameters that contradict: refused, counted, and sight goes on."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laser_flights import PARAMETERS, START, Flight, cylinder

from nmpc_control.config import config_directory
from nmpc_control.errors import ConfigError
from nmpc_control.laser_tracking.circle_fit import fit_circle
from nmpc_control.laser_tracking.parameters import load_laser_parameters
from nmpc_control.laser_tracking.poses import PoseHistory
from nmpc_control.laser_tracking.scan import ScanError
from nmpc_control.laser_tracking.tracker import LaserTracker

NAN = math.nan


@pytest.fixture(scope="module")
def flight():
    """One with a track, whose newest scan can be spoiled."""
    flight = Flight([cylinder("a", (6.0, 0.0))])
    list(flight.run(0.7))
    assert len(flight.tracker.obstacles()) == 1
    return flight


def spoiled(flight, **changes):
    """Return the newest scan, a little later and with something wrong."""
    scan = flight.scan(flight.tracker.t - START + 0.025)
    return dataclasses.replace(scan, **changes)


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("beams", {"ranges": np.array([])}),
        ("beams", {"ranges": np.ones(2)}),
        ("beams", {"ranges": np.ones(100_000), "angle_increment": 6e-5}),
        ("angles", {"angle_increment": 0.0}),
        ("angles", {"angle_increment": NAN}),
        ("angles", {"angle_min": math.inf}),
        ("angles", {"angle_increment": 0.0087}),
        ("angles", {"angle_increment": 0.002}),
        ("angles", {"angle_increment": -0.00436332}),
        ("times", {"time_increment": -1e-5}),
        ("times", {"time_increment": NAN}),
        ("times", {"time_increment": 1.0}),
        ("limits", {"range_min": NAN}),
        ("limits", {"range_max": math.inf}),
        ("limits", {"range_min": 5.0, "range_max": 4.0}),
        ("stamp", {"t": 0.0}),
        ("stamp", {"t": START + 0.3}),
    ],
)
def test_a_wrong_scan_is_refused_and_counted(flight, kind, changes):
    before, tracks = flight.tracker.counts[kind], flight.tracker.obstacles()
    with pytest.raises(ScanError) as error:
        flight.tracker.update(spoiled(flight, **changes), flight.poses)
    assert error.value.kind == kind and "\n" not in str(error.value)
    assert flight.tracker.counts[kind] == before + 1
    after = flight.tracker.obstacles()
    assert [o.id for o in after] == [o.id for o in tracks]
    assert np.array_equal(after[0].position, tracks[0].position)


def test_a_scan_from_the_future_and_one_again_are_refused(flight):
    scan = spoiled(flight)
    with pytest.raises(ScanError, match="future"):
        flight.tracker.update(scan, flight.poses, now=scan.t - 0.2)
    again = dataclasses.replace(scan, t=flight.tracker.t)
    with pytest.raises(ScanError, match="older"):
        flight.tracker.update(again, flight.poses, now=scan.t)


def test_without_a_pose_nothing_is_made_up(flight):
    scan = spoiled(flight)
    for poses in (PoseHistory(PARAMETERS.pose), flight.poses):
        tracker = LaserTracker(PARAMETERS)
        late = dataclasses.replace(scan, t=scan.t + (0.0 if poses is not flight.poses else 5.0))
        with pytest.raises(ScanError, match="not known"):
            tracker.update(late, poses)
        assert tracker.counts == {"pose": 1} and not tracker.obstacles()


@pytest.mark.parametrize("value", [NAN, math.inf, -math.inf, 0.0, -1.0, 1e30])
def test_ranges_that_say_nothing_are_taken_and_nothing_comes_of_them(value):
    flight = Flight([cylinder("a", (6.0, 0.0))])
    flight.alter = lambda scan: dataclasses.replace(scan, ranges=np.full(1081, value))
    assert not any(tracks for _, tracks in flight.run(0.4))
    assert set(flight.tracker.counts) == {"scans"}


def test_after_a_jump_back_of_the_clock_all_begins_anew():
    flight = Flight([cylinder("a", (6.0, 0.0))])
    list(flight.run(0.7))
    tracker, name = flight.tracker, flight.tracker.obstacles()[0].id
    fresh = Flight([cylinder("a", (6.0, 0.0))])
    fresh.tracker = tracker
    fresh.alter = lambda scan: dataclasses.replace(scan, t=scan.t - 50.0)
    fresh.poses.at = lambda times, at=fresh.poses.at: at(np.asarray(times) + 50.0)
    list(fresh.run(0.7))
    assert [o.id for o in tracker.obstacles()] != [name] and len(tracker.obstacles()) == 1


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.sampled_from([3, 100, 1081]),
    bad=st.floats(0.0, 1.0),
    scale=st.sampled_from([1.0, 5.0, 40.0]),
)
def test_any_ranges_give_bounded_finite_tracks(flight, seed, n, bad, scale):
    random = np.random.default_rng(seed)
    tracker = LaserTracker(PARAMETERS)
    limits = PARAMETERS.tracks
    for k in range(10):
        ranges = scale * random.random(n)
        ranges[random.random(n) < bad] = random.choice([NAN, math.inf, -math.inf])
        step = 1.5 * math.pi / n
        scan = spoiled(flight, ranges=ranges, angle_min=0.0, angle_increment=step)
        scan = dataclasses.replace(scan, t=START + 0.5 + 0.02 * k, angle_max=step * (n - 1))
        tracker.update(scan, flight.poses)
        found = tracker.obstacles()
        assert len(found) <= limits.max_tracks
        for obstacle in found:
            assert np.isfinite([*obstacle.position, *obstacle.size, *obstacle.velocity]).all()
            assert (obstacle.size > 0.0).all()
            assert 0.0 <= obstacle.growth <= limits.max_growth


@given(
    distance=st.floats(2.0, 12.0),
    bearing=st.floats(-3.1, 3.1),
    radius=st.floats(0.1, 1.2),
    seed=st.integers(0, 10_000),
)
def test_the_centre_is_where_it_is_and_not_nearer(distance, bearing, radius, seed):
    step, sigma = math.radians(0.25), 0.01
    distance += radius
    angles = np.arange(-720, 720) * step
    off = np.remainder(angles - bearing + np.pi, 2 * np.pi) - np.pi
    off = off[np.abs(off) < math.asin(radius / distance)]
    angles = np.sort(off) + bearing
    if len(angles) < 3:
        return
    ranges = distance * np.cos(off) - np.sqrt(radius**2 - (distance * np.sin(off)) ** 2)
    ranges = ranges[np.argsort(off)] + np.random.default_rng(seed).normal(0.0, sigma, len(off))
    points = ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    edges = (angles[0] - 0.5 * step, angles[-1] + 0.5 * step)
    circle = fit_circle(np.zeros(2), points, edges, step, 0.015, (0.4, 0.4), (0.05, 2.4))
    truth = distance * np.array([math.cos(bearing), math.sin(bearing)])
    assert np.hypot(*(circle.centre - truth)) < 0.08
    assert circle.radius == pytest.approx(radius, abs=0.08)
    naive = points.mean(axis=0)
    if radius > 0.3:
        assert np.hypot(*(naive - truth)) > np.hypot(*(circle.centre - truth))


@pytest.mark.parametrize(
    ("line", "changed_line", "named"),
    [
        ("max_age: 0.3", "max_age: -1.0", "pose.max_age"),
        ("radius_min: 0.05", "radius_min: 0.5", "shapes.radius"),
        ("confirm_scans: 8", "confirm_scans: 4", "tracks.confirm_scans"),
        ("  gate: 13.8", "  gat: 13.8", "tracks.gat"),
    ],
)
def test_wrong_parameters_are_named(tmp_path, line, changed_line, named):
    text = (config_directory() / "laser_tracker.yaml").read_text(encoding="utf-8")
    assert line in text
    (tmp_path / "laser_tracker.yaml").write_text(text.replace(line, changed_line))
    with pytest.raises(ConfigError, match=f"laser_tracker.yaml: {named}"):
        load_laser_parameters(tmp_path)
