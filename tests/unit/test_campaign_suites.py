# SPDX-License-Identifier: MIT
"""What campaigns draw: the properties that each suite promises, for hundreds of draws."""

import numpy as np
import pytest

from uav_sim.closed_loop.campaign import appearing, head_on, moving, no_way, static_fields
from uav_sim.closed_loop.campaign.draw import CLOCK_START, HEIGHT, HULL, MARGIN
from uav_sim.closed_loop.campaign.suites import SUITES, draw_flight

DRAWS = 200
SEED = 4711


@pytest.fixture(scope="module")
def drawn():
    return {name: [draw_flight(name, SEED, i).sketch for i in range(DRAWS)] for name in SUITES}


def offsets(sphere):
    """Return how far a centre is from the line: beside and above."""
    return sphere.center[1:]


def straight_gap(sketch):
    """Return the least gap [m] of a hull that is where the reference is, hull to surface."""
    clock = np.arange(0.0, sketch.length / sketch.speed, 0.01)
    here = np.outer(sketch.speed * clock, [1.0, 0.0, 0.0])
    gaps = []
    for sphere in sketch.spheres:
        velocity = np.zeros(3) if sphere.velocity is None else sphere.velocity
        there = sphere.center + np.outer(clock + CLOCK_START, velocity)
        gaps.append(np.linalg.norm(here - there, axis=1).min() - sphere.radius - HULL)
    return min(gaps)


@pytest.mark.parametrize("name", list(SUITES))
def test_the_straight_flight_hits(drawn, name):
    """What twins without avoidance show, by geometry."""
    hits = sum(straight_gap(sketch) < 0.0 for sketch in drawn[name])
    assert hits >= 0.95 * DRAWS


@pytest.mark.parametrize("name", list(SUITES))
def test_start_and_end_are_free_and_the_ground_is_far(drawn, name):
    for sketch in drawn[name]:
        for sphere in sketch.spheres:
            assert np.linalg.norm(sphere.center) - sphere.radius > HULL + MARGIN
            if sphere.velocity is None:
                assert HEIGHT + sphere.center[2] - sphere.radius > 2.0
            if sphere.velocity is None and not sketch.is_closed:
                end = np.linalg.norm(sphere.center - [sketch.length, 0.0, 0.0])
                assert end - sphere.radius > HULL + MARGIN


def test_static_fields_have_half_of_their_spheres_on_the_line(drawn):
    counts = []
    for sketch in drawn["static_fields"]:
        near = sum(np.linalg.norm(offsets(s)) <= 1.0 for s in sketch.spheres)
        assert near == (len(sketch.spheres) + 1) // 2
        assert sketch.length == 30.0
        assert 1.0 <= sketch.speed <= 2.5
        assert all(0.4 <= s.radius <= 1.5 for s in sketch.spheres)
        assert all(np.all(np.abs(offsets(s)) <= [8.0, 4.0]) for s in sketch.spheres)
        counts.append(len(sketch.spheres))
    assert (min(counts), max(counts)) == static_fields.COUNT


def test_moving_ones_conflict_one_by_one_and_are_seen_in_time(drawn):
    kinds = set()
    for sketch in drawn["moving"]:
        assert 1 <= len(sketch.spheres) <= 6
        assert 20.0 <= sketch.length <= 30.0
        for sphere in sketch.spheres:
            speed = np.linalg.norm(sphere.velocity)
            assert 0.5 - 1e-9 <= speed <= 3.0 + 1e-9
            alone = type(sketch)(sketch.length, sketch.speed, (sphere,))
            assert straight_gap(alone) < 0.0
            early = type(sketch)(2.5 * sketch.speed, sketch.speed, (sphere,))
            assert straight_gap(early) > 0.9, "at most 0.1 m nearer than on the 0.05 s grid"
            assert moving.gap_at_start(sphere, sketch.speed) >= moving.FREE_GAP
            kinds.add(round(np.degrees(np.arccos(sphere.velocity[0] / speed)) / 60.0))
    assert kinds == {0, 1, 2, 3}


def test_what_appears_is_three_metres_ahead_at_speed(drawn):
    centred = 0
    for sketch in drawn["appearing"]:
        (sphere,) = sketch.spheres
        assert sketch.speed == 2.0
        assert sphere.appears_within - HULL == 3.0
        assert sphere.center[0] - sphere.radius - sphere.appears_within > 7.0, "room to get going"
        assert np.linalg.norm(offsets(sphere)) <= appearing.ASIDE * sphere.radius
        centred += not offsets(sphere).any()
    assert 0.3 * DRAWS < centred < 0.7 * DRAWS


def test_head_on_is_exactly_symmetric(drawn):
    from_rest = 0
    for sketch in drawn["head_on"]:
        places = np.array([offsets(s) for s in sketch.spheres])
        for mirror in ([-1.0, 1.0], [1.0, -1.0]):
            image = places * mirror
            assert all((np.abs(places - p).sum(axis=1) == 0.0).any() for p in image)
        assert len({(s.center[0], s.radius) for s in sketch.spheres}) == 1
        assert 0.5 <= sketch.spheres[0].radius <= 2.0
        assert 1.0 <= sketch.speed <= 4.0
        from_rest += sketch.spheres[0].center[0] < 10.0
    assert 0.3 * DRAWS < from_rest < 0.7 * DRAWS
    assert {len(s.spheres) for s in drawn["head_on"]} == set(range(1, len(head_on.KINDS) + 1))


def test_no_way_leaves_no_gap_for_the_hull(drawn):
    """Seen from the end of the leg, in every direction: the shell is closed to the hull."""
    look = no_way.directions(3000)
    kinds = set()
    for sketch in drawn["no_way"][:50]:
        end = np.array([sketch.length, 0.0, 0.0])
        assert sketch.is_closed
        if len(sketch.spheres) == 1:
            (sphere,) = sketch.spheres
            assert np.linalg.norm(end - sphere.center) < sphere.radius
            kinds.add("inside")
            continue
        centers = np.array([s.center for s in sketch.spheres]) - end
        shell = np.linalg.norm(centers[0])
        passage = np.linalg.norm(shell * look[:, None] - centers, axis=2).min(axis=1).max()
        passage -= sketch.spheres[0].radius
        assert passage < HULL - 0.03
        kinds.add("wall" if passage < 0.0 else "gap")
    assert kinds == {"inside", "wall", "gap"}


def test_a_flight_depends_on_suite_seed_and_number_only():
    first = draw_flight("moving", 3, 17)
    draw_flight("moving", 3, 0)
    again = draw_flight("moving", 3, 17)
    assert first.entries() == again.entries()
    assert (first.seed, first.heading) == (again.seed, again.heading)
    others = [draw_flight("moving", 3, 18), draw_flight("moving", 4, 17)]
    others.append(draw_flight("static_fields", 3, 17))
    assert all(other.entries() != first.entries() for other in others)
    assert len({first.seed, *(other.seed for other in others)}) == 4


@pytest.mark.parametrize("name", list(SUITES))
def test_the_simulators_world_is_the_sketch(name):
    flight = draw_flight(name, SEED, 1)
    world, scenario = flight.world(), flight.scenario()
    assert world.moves == flight.sketch.changes
    assert len(world.obstacles) == len(flight.sketch.spheres)
    assert scenario.trajectory.length == pytest.approx(flight.sketch.length)
    known = {o.id: o for o in scenario.obstacles}
    assert len(known) == (0 if flight.sketch.changes else len(flight.sketch.spheres))
    for obstacle, sphere in zip(world.obstacles, flight.sketch.spheres):
        along = (np.array(obstacle.position) - flight.start) @ (flight.end - flight.start)
        assert along / flight.sketch.length == pytest.approx(sphere.center[0])
        if known:
            assert np.allclose(known[obstacle.id].position, obstacle.position)
