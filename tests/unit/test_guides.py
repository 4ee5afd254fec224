# SPDX-License-Identifier: MIT
"""Ways round: out of all margins, on the side that was asked for, or none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nmpc_control.guides import SIDES, Turns, conflicts, eased, sides, way_round
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField

TIMES = 0.1 * np.arange(61)
PATH = np.outer(1.5 * TIMES, [1.0, 0.0, 0.0]) + [0.0, 0.0, 5.0]  # 9 m along x
MARGIN, SLOPE = 1.0, 0.15  # [m], [m] a stage
ACROSS = sides(PATH[-1] - PATH[0])
RIGHT, LEFT, OVER, UNDER = ACROSS[:4]


def spheres(*obstacles, path=PATH):
    return ObstacleField(obstacles).spheres(path, TIMES)


def ball(x, y=0.0, z=5.0, radius=0.5, velocity=(0.0, 0.0, 0.0)):
    place, speed = np.array([x, y, z]), np.array(velocity)
    return Obstacle(f"{x}", place, np.array([radius]), velocity=speed, stamp=0.0)


def test_sides_are_across_and_apart():
    for travel in ([1.0, 0, 0], [0.3, -2.0, 0.5], [0, 0, 1.0], [0, 0, -3.0], [0, 0, 0]):
        across = sides(np.array(travel))
        assert across.shape == (SIDES, 3)
        assert across @ travel == pytest.approx(np.zeros(SIDES), abs=1e-9)
        assert np.linalg.norm(across, axis=1) == pytest.approx(np.ones(SIDES))
        angles = across @ across.T - 2.0 * np.eye(SIDES)
        assert angles.max() < 0.75, "no two are the same"
    assert RIGHT == pytest.approx([0.0, -1.0, 0.0])
    assert OVER == pytest.approx([0.0, 0.0, 1.0])


def test_head_on_gives_a_way_on_each_side():
    """Exactly in the middle, where a gradient says nothing."""
    around = spheres(ball(4.5))
    ways = [way_round(around, MARGIN, PATH, side, SLOPE) for side in ACROSS]
    for way, side in zip(ways, ACROSS):
        push = (way - PATH) @ side
        assert push.max() == pytest.approx(0.5 + MARGIN, abs=0.1)
        assert way - PATH == pytest.approx(np.outer(push, side))
        assert np.abs(np.diff(push)).max() <= SLOPE + 1e-9
    assert ways[0][:, 1] == pytest.approx(-ways[1][:, 1])
    assert ways[2][:, 2] - 5.0 == pytest.approx(5.0 - ways[3][:, 2])


@given(seed=st.integers(0, 10_000))
def test_a_way_round_leaves_all_margins(seed):
    rng = np.random.default_rng(seed)
    around = spheres(
        *(
            ball(*rng.uniform([2, -2, 3], [9, 2, 7]), rng.uniform(0.2, 1.0), rng.normal(0, 0.5, 3))
            for _ in range(rng.integers(1, 7))
        )
    )
    for side in ACROSS:
        way = way_round(around, MARGIN, PATH, side, SLOPE)
        assert way is None or not conflicts(around, MARGIN, way).any()


def test_hardly_any_scene_has_no_way_round():
    """Else the property above could hold of nothing."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(30):
        scene = [ball(*rng.uniform([3, -2, 3], [9, 2, 7]), rng.uniform(0.2, 1.0)) for _ in range(5)]
        found += [way_round(spheres(*scene), MARGIN, PATH, s, SLOPE) is not None for s in ACROSS]
    assert np.mean(found) > 0.9


def test_a_free_path_stays_as_it_is():
    around = spheres(ball(4.5, 1.6))
    assert not conflicts(around, MARGIN, PATH).any()
    # the side with the sphere is pushed only where it would be entered: nowhere
    assert way_round(around, MARGIN, PATH, RIGHT, SLOPE) == pytest.approx(PATH)


def test_an_upright_cylinder_is_passed_beside_never_along_its_axis():
    pole = Obstacle("pole", np.array([4.5, 0.1, 5.0]), np.array([0.3, 30.0]), "cylinder")
    around = spheres(pole)
    assert way_round(around, MARGIN, PATH, OVER, SLOPE) is None
    assert way_round(around, MARGIN, PATH, UNDER, SLOPE) is None
    for side in (RIGHT, LEFT):
        way = way_round(around, MARGIN, PATH, side, SLOPE)
        assert pole.distance(way).min() >= MARGIN - 1e-6


def test_what_is_too_wide_is_not_gone_round():
    wall = ball(29.0, radius=25.0)
    assert all(way_round(spheres(wall), MARGIN, PATH, side, SLOPE) is None for side in ACROSS)


def test_a_way_begins_where_the_aircraft_is():
    start = np.array([-1.0, 2.0, 4.0])
    way = eased(PATH, start, TIMES)
    assert way[0] == pytest.approx(start)
    assert way[-1] == pytest.approx(PATH[-1], abs=0.02)


def test_all_sides_have_their_turn():
    for count in (1, 2, 3, 8, 20):
        turns = Turns()
        taken = [turns.take(count) for _ in range(SIDES)]
        assert {side for tick in taken for side in tick} == set(range(SIDES))
        assert all(len(set(tick)) == min(count, SIDES) for tick in taken)
