# SPDX-License-Identifier: MIT
"""Tracks against the truth of the simulator: accuracy, several at once, hidden, ground, walls."""

import dataclasses
import math

import numpy as np
import pytest
from laser_flights import START, Flight, changed, cylinder, errors, hovering, rocking

from nmpc_control.laser_tracking.scan import Scan
from uav_sim.laser import Laser

POSITION, SPEED = 0.15, 0.3  # [m], [m/s] what is asked for at 10 m and 1 m/s
SETTLE = 0.6  # [s] from the first echo on
EXACT = (0.0, 0.0, 0.0)
OUTDOOR = (0.05, 0.1, math.radians(0.5))  # noise of telemetry
CROSSING = cylinder("a", (10.0, -1.0), (0.0, 1.0, 0.0), radius=0.25)


def worst(flight, duration, settle=SETTLE):
    """Return the greatest errors (2,) [m], [m/s] over all obstacles, and the ids of each."""
    found, ids = errors(flight, duration, settle)
    return np.max([rows.max(axis=0) for rows in found.values()], axis=0), ids


@pytest.mark.parametrize(
    ("pose", "noise", "laser"),
    [
        (hovering, EXACT, "utm_30lx"),
        (hovering, EXACT, "ust_10lx"),
        (hovering, OUTDOOR, "ust_10lx"),
        (rocking, EXACT, "ust_10lx"),
        (rocking, OUTDOOR, "utm_30lx"),
    ],
)
def test_a_target_at_10_m_and_1_m_s(pose, noise, laser):
    start = CROSSING if pose is hovering else cylinder("a", (8.6, -1.0), (0.0, 1.0, 0.0))
    flight = Flight([start], pose, laser, seed=3)
    flight.noise = noise
    (position, speed), ids = worst(flight, 2.0, 1.0)
    assert position < POSITION and speed < SPEED
    assert ids == {"a": {"laser_1"}}


def test_coming_towards_and_what_stands_is_told_to_stand():
    flight = Flight([cylinder("a", (11.0, 1.0), (-1.0, 0.0, 0.0)), cylinder("b", (5.0, -3.0))])
    (position, speed), ids = worst(flight, 2.0)
    assert position < POSITION and speed < SPEED
    assert [len(names) for names in ids.values()] == [1, 1]
    standing = min(flight.tracker.obstacles(), key=lambda o: o.position[1])
    assert not standing.velocity.any() and standing.shape == "cylinder"
    assert standing.size[0] == pytest.approx(0.4, abs=0.05)
    assert standing.stamp == pytest.approx(START + flight.t, abs=0.03)
    assert 0.0 < standing.growth <= flight.tracker.parameters.tracks.max_growth


def test_without_own_motion_the_world_would_move():
    def stuck(t):
        return rocking(0.0)

    flight, blind = (Flight([cylinder("a", (8.0, 0.0))], rocking) for _ in range(2))
    told = blind.pose
    tell = blind._tell

    def tell_nothing(t):
        blind.pose = stuck
        tell(t)
        blind.pose = told

    blind._tell = tell_nothing
    assert worst(flight, 1.2)[0][0] < POSITION
    assert worst(blind, 1.2)[0][0] > 3 * POSITION


def test_ground_under_a_tilted_aircraft_is_no_obstacle():
    def diving(t):
        return np.array([0.0, 0.0, 1.5]), np.array([0.0, 0.15 + 0.05 * math.sin(t), 0.3 * t])

    guarded = Flight([], diving)
    assert not any(tracks for _, tracks in guarded.run(1.5))
    blind = Flight([], diving, parameters=changed(echoes={"ground_height": -100.0}))
    assert any(tracks for _, tracks in blind.run(1.5)), "the twin sees phantoms"


def test_a_post_is_seen_above_the_ground_that_the_same_scan_shows():
    def leaning(t):
        return np.array([0.0, 0.0, 1.5]), np.array([0.0, 0.12, 0.0])

    flight = Flight([cylinder("a", (5.0, 0.5))], leaning)
    (position, _), ids = worst(flight, 1.5)
    assert position < POSITION and len(flight.tracker.confirmed) == 1


def test_hidden_behind_another_it_goes_on_and_keeps_its_name():
    pillar = cylinder("pillar", (4.0, 0.0), radius=0.5)
    flight = Flight([cylinder("a", (9.0, -2.2), (0.0, 1.0, 0.0), radius=0.3), pillar])
    hidden = []
    for _, tracks in flight.run(4.2, SETTLE):
        truth = flight.truth()["a"][0]
        track = next(o for o in tracks if o.id == "laser_2")
        if abs(truth[1]) < 0.6:
            hidden.append(track.size[0])
        assert np.hypot(*(track.position[:2] - truth)) < POSITION
        assert np.hypot(*(track.velocity[:2] - (0.0, 1.0))) < SPEED
    assert len({o.id for o in flight.tracker.obstacles()}) == 2
    assert max(hidden) > 1.1 * min(hidden), "hidden, its radius has to grow"


def test_half_hidden_its_centre_stays():
    pillar = cylinder("pillar", (4.0, 0.0), radius=0.5)
    stops = {"type": "line", "distance": 1.0, "end": "stop"}
    flight = Flight([cylinder("a", (9.0, -2.2), (0.0, 1.0, 0.0), motion=stops), pillar])
    assert worst(flight, 2.2)[0][0] < POSITION
    assert min(o.size[0] for o in flight.tracker.obstacles()) == pytest.approx(0.4, abs=0.05)


def test_seen_through_it_is_gone_and_out_of_range_it_is_kept_for_a_while():
    flight = Flight([cylinder("a", (6.0, 0.0))])
    list(flight.run(0.8))
    assert len(flight.tracker.obstacles()) == 1
    empty = dataclasses.replace
    flight.alter = lambda scan: empty(scan, ranges=np.full(len(scan.ranges), np.inf))
    times = [t for t, tracks in flight.run(0.6) if tracks]
    assert times[-1] - 0.8 == pytest.approx(flight.tracker.parameters.tracks.missed_time, abs=0.1)

    flight = Flight([cylinder("a", (6.0, 0.0))], parameters=changed(tracks={"coast_time": 1.2}))
    list(flight.run(0.8))
    flight.alter = lambda scan: empty(scan, ranges=np.full(len(scan.ranges), np.nan))
    times = [t for t, tracks in flight.run(1.5) if tracks]
    assert times[-1] - 0.8 == pytest.approx(1.2, abs=0.1)


def test_five_that_cross_keep_their_names():
    flight = Flight(
        [
            cylinder("a", (9.0, -1.5), (0.0, 1.0, 0.0)),
            cylinder("b", (6.0, 1.5), (0.0, -1.0, 0.0), radius=0.3),
            cylinder("c", (10.0, 5.0), (-1.0, 0.0, 0.0)),
            cylinder("d", (-2.0, 5.0), (1.0, 0.0, 0.0)),
            cylinder("e", (5.0, -6.0), radius=0.1),
        ],
        rocking,
    )
    (position, speed), ids = worst(flight, 3.0)
    assert position < POSITION and speed < SPEED
    assert all(len(names) == 1 for names in ids.values())


def test_a_wall_is_a_row_of_bounded_cylinders_that_stand():
    wall = {"id": "w", "shape": "box", "size": [0.4, 10.0, 6.0], "position": [7.2, 1.0, 3.0]}
    flight = Flight([wall], rocking)
    names = [{o.id for o in tracks} for _, tracks in flight.run(2.5, SETTLE)]
    tracks = flight.tracker.obstacles()
    assert 9 <= len(tracks) <= 13
    assert all(o.size[0] <= 1.1 and not o.velocity.any() for o in tracks)
    assert len(set.union(*names)) <= len(tracks) + 4, "pieces do not come and go"
    inner = np.stack([np.full(80, 7.05), np.linspace(-3.5, 5.5, 80), np.full(80, 3.0)], axis=1)
    covered = np.min([o.distance(inner) for o in tracks], axis=0)
    assert covered.max() < 0.1, "no hole in it"
    before = np.stack([np.full(80, 6.75), np.linspace(-3.5, 5.5, 80), np.full(80, 3.0)], axis=1)
    assert np.min([o.distance(before) for o in tracks]) > 0.0, "and it stands out no farther"


def test_somebody_in_front_of_a_wall():
    wall = {"id": "w", "shape": "box", "size": [0.4, 10.0, 6.0], "position": [9.0, 1.0, 3.0]}
    flight = Flight([cylinder("a", (7.0, -1.5), (0.0, 1.0, 0.0), radius=0.3), wall])
    for _, tracks in flight.run(2.5, SETTLE):
        position, velocity = flight.truth()["a"]
        track = min(tracks, key=lambda o: np.hypot(*(o.position[:2] - position)))
        assert np.hypot(*(track.position[:2] - position)) < POSITION
        assert np.hypot(*(track.velocity[:2] - velocity)) < SPEED


def mixed(scan):
    """Return a scan in which every edge has a point on its way to what is behind."""
    r = np.minimum(scan.ranges, 30.0)
    edge = np.flatnonzero(np.abs(np.diff(r)) > 1.0)
    ranges = scan.ranges.copy()
    ranges[edge] = 0.5 * (r[edge] + r[edge + 1])
    return dataclasses.replace(scan, ranges=ranges)


def test_points_between_an_edge_and_what_is_behind_it_do_no_harm():
    wall = {"id": "w", "shape": "box", "size": [0.4, 10.0, 6.0], "position": [9.0, 1.0, 3.0]}
    flight = Flight([cylinder("a", (6.0, -1.0), (0.0, 1.0, 0.0), radius=0.3), wall])
    loose = Flight([cylinder("a", (6.0, -1.0), (0.0, 1.0, 0.0), radius=0.3), wall])
    loose.tracker.parameters = changed(shapes={"jump": 3.0})
    worst_offset = []
    for each in (flight, loose):
        each.alter, offsets = mixed, [0.0]
        for _, tracks in each.run(1.2, SETTLE):
            position, _ = each.truth()["a"]
            offsets.append(min(np.hypot(*(o.position[:2] - position)) for o in tracks))
        worst_offset.append(max(offsets))
    assert worst_offset[0] < POSITION < worst_offset[1]


def test_the_time_of_each_beam_counts():
    """Each beam is taken at its own time while the aircraft turns at 1 rad/s."""

    def turning(t):
        return np.array([1.0 * t, 0.0, 3.0]), np.array([0.0, 0.0, t - 1.0])

    def rolling(flight):
        n, parts = len(flight.laser.angles), 30
        lag = 0.9 / flight.laser.parameters.rate / n

        def at_own_time(scan):
            ranges, t = scan.ranges.copy(), scan.t - START
            for part in np.array_split(np.arange(n), parts):
                position, rpy = flight.pose(t + lag * part.mean())
                ranges[part] = flight.laser.scan(position, rpy, flight.world.states())[part]
            return dataclasses.replace(scan, ranges=ranges, time_increment=lag)

        return at_own_time

    def mean_offset(ignore):
        flight = Flight([cylinder("a", (8.0, 4.0))], turning)
        altered = rolling(flight)
        flight.alter = altered
        if ignore:
            flight.alter = lambda scan: dataclasses.replace(altered(scan), time_increment=0.0)
        offsets = [tracks[0].position[:2] - (8.0, 4.0) for _, tracks in flight.run(1.2, SETTLE)]
        return float(np.hypot(*np.mean(offsets, axis=0)))

    assert mean_offset(ignore=False) < 0.04
    assert mean_offset(ignore=True) > 0.08


@pytest.mark.parametrize("turns", [1, -1])
def test_a_whole_turn_and_a_scanner_that_turns_clockwise(turns):
    flight = Flight([cylinder("a", (-4.0, 0.0), radius=0.5)])
    p = flight.laser.parameters
    step = 2.0 * math.pi / 1440
    whole = dataclasses.replace(
        p, angle_min=-math.pi, angle_max=math.pi - step, angle_increment=step
    )
    flight.laser = Laser(whole, "1")

    def reversed_scan(scan: Scan) -> Scan:
        limits = {"angle_min": scan.angle_max, "angle_max": scan.angle_min}
        return dataclasses.replace(scan, angle_increment=-step, ranges=scan.ranges[::-1], **limits)

    if turns < 0:
        flight.alter = reversed_scan
    (position, _), ids = worst(flight, 1.0)
    assert position < 0.05 and len(flight.tracker.confirmed) == 1


def test_mount_turned_and_level():
    flight = Flight([cylinder("a", (6.0, 0.0))], rocking)
    p = flight.laser.parameters
    turned = dataclasses.replace(p, mount_rpy=(0.0, 0.0, 0.8), level=True)
    flight.laser = Laser(turned, "1")
    wrong = flight.tracker.parameters
    flight.tracker.parameters = dataclasses.replace(
        wrong, mount=dataclasses.replace(wrong.mount, rpy=(0.0, 0.0, 0.8), level=True)
    )
    assert worst(flight, 1.2)[0][0] < POSITION


def test_a_sphere_at_the_height_of_the_scan():
    ball = {"id": "s", "position": [9.5, -1.0, 3.0], "radius": 0.5, "velocity": [0.0, 1.0, 0.0]}
    (position, speed), _ = worst(Flight([ball]), 2.0)
    assert position < POSITION and speed < SPEED
