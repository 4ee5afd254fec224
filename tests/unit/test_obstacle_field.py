# SPDX-License-Identifier: MIT
"""Obstacles as arrays agree with each one alone, and their spheres touch the true surfaces."""

from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.obstacle import MAX_GROWTH, MIN_PATH_DT, Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.obstacle_sighting import Sighting, fault

TIMES = np.linspace(0.5, 6.0, 23)


def some():
    path = np.array([[1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]])
    still = np.zeros(3)
    return [
        Obstacle("ball", np.array([4.0, 0.0, 2.0]), np.array([0.7])),
        Obstacle("pole", np.array([2.0, 1.0, 2.0]), np.array([0.3, 4.0]), "cylinder"),
        Obstacle("wall", np.array([5.0, -2.0, 2.0]), np.array([0.2, 4.0, 3.0]), "box"),
        Obstacle(
            "bird",
            np.ones(3),
            np.array([0.2]),
            "sphere",
            np.array([1.0, -0.5, 0.0]),
            0.2,
            None,
            0,
            0.1,
        ),
        Obstacle("guest", np.zeros(3), np.array([0.5]), "sphere", still, 0.0, path, 0.7, 0.9),
    ]


def way(seed):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 0.6, (len(TIMES), 3)), axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_all_at_once_is_each_alone(seed):
    points, obstacles = way(seed), some()
    together = ObstacleField(obstacles).distances(points, TIMES)
    alone = [o.distance(points, TIMES) for o in obstacles]
    np.testing.assert_allclose(together, alone, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_spheres_touch_the_surface_where_it_is_nearest(seed):
    points, field = way(seed), ObstacleField(some())
    spheres = field.spheres(points, TIMES)
    offset = points - spheres.centres
    offset[..., 2] *= spheres.vertical
    d = np.linalg.norm(offset, axis=-1) - spheres.radius
    np.testing.assert_allclose(d, field.distances(points, TIMES), atol=1e-9)


def test_a_path_is_followed_and_left_as_it_went_last():
    guest = some()[-1]
    at = guest.position_at(np.array([0.0, 0.35, 0.7, 1.4, 2.1, 2.8, -1.0]))
    expected = [[0, 0, 0], [0.5, 0, 1], [1, 0, 2], [1, 1, 2], [0, 1, 2], [-1, 1, 2], [0, 0, 0]]
    np.testing.assert_allclose(at, expected, atol=1e-12)


def test_what_is_not_heard_of_grows_but_not_for_ever():
    guest = some()[-1]
    assert guest.growth_at(1.0) == pytest.approx(0.9)
    assert guest.growth_at(1e6) == MAX_GROWTH
    assert some()[0].growth_at(1e6) == 0.0


def test_what_is_nowhere_is_named():
    lost = Obstacle("lost", np.array([np.nan, 0, 0]), np.array([1.0]))
    flat = Obstacle("flat", np.zeros(3), np.array([1.0, 0.0, 1.0]), "box")
    assert ObstacleField([*some(), lost, flat]).unusable == ("lost", "flat")
    assert ObstacleField(some()).unusable == ()


@pytest.mark.parametrize("path_dt", [1e-300, 1e-20, 0.9 * MIN_PATH_DT])
def test_a_path_of_hardly_any_spacing_is_unusable_and_breaks_nothing(path_dt):
    guest = replace(some()[-1], path=np.zeros((3, 3)), path_dt=path_dt)
    field = ObstacleField([guest, replace(guest, id="twin", path_dt=MIN_PATH_DT)])
    assert field.unusable == ("guest",)
    np.testing.assert_array_equal(field.centres(TIMES), np.zeros((2, len(TIMES), 3)))


def test_the_closest_points_of_a_path_that_are_believed():
    path = Sighting("bird", "sphere", (0.3,), (5.0, 0.0, 2.0), path=(5.0, 0.0, 2.0), path_dt=1e-3)
    assert fault(path) == ""
    assert fault(path._replace(path_dt=0.9e-3)) == "path"


def test_no_obstacle_is_no_row():
    field = ObstacleField([])
    assert len(field) == 0
    assert field.unusable == ()
    assert field.distances(way(0), TIMES).shape == (0, len(TIMES))
    assert field.spheres(way(0), TIMES).radius.shape == (0, len(TIMES))


def test_a_part_is_as_if_made_of_these_alone():
    which = np.array([4, 0, 2])
    points, obstacles = way(3), some()
    part, alone = ObstacleField(obstacles).part(which), ObstacleField([obstacles[i] for i in which])
    assert part.ids == alone.ids
    np.testing.assert_array_equal(part.distances(points, TIMES), alone.distances(points, TIMES))
    np.testing.assert_array_equal(part.has_path, [True, False, False])
    assert ObstacleField([*obstacles, obstacles[0]]).part(which).unusable == ()
