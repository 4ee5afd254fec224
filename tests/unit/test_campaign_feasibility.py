# SPDX-License-Identifier: MIT
"""The feasibility checker: finds ways that exist, none through walls, and checks what it finds."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.model import model_parameters, reference_step
from nmpc_control.params import load_parameters
from uav_sim.closed_loop.campaign import clamped_spline as spline
from uav_sim.closed_loop.campaign import feasibility, way
from uav_sim.closed_loop.campaign.draw import Sketch, Sphere
from uav_sim.closed_loop.campaign.reach import way_through
from uav_sim.closed_loop.campaign.suites import draw_flight

PARAMETERS = load_parameters("dji_hil")
VEHICLE, LIMITS = PARAMETERS.vehicle, PARAMETERS.limits


def sphere(x, y, z, radius, velocity=None):
    velocity = None if velocity is None else np.array(velocity, dtype=float)
    return Sphere(np.array([x, y, z], dtype=float), radius, velocity)


def straight(length, duration):
    """Return control points of a gentle straight flight from rest to rest."""
    u = np.linspace(0.0, 1.0, 200)
    return spline.through(np.outer(u**3 * (10 - 15 * u + 6 * u**2), [length, 0.0, 0.0]))


def test_open_field_is_feasible_at_the_first_start():
    sketch = Sketch(20.0, 2.0, (sphere(10.0, 6.0, 0.0, 1.0),))
    assert feasibility.find_way(sketch, VEHICLE, LIMITS) == 0


def test_around_a_sphere_on_the_line_and_past_one_that_crosses():
    for obstacle in (sphere(10.0, 0.0, 0.0, 1.5), sphere(10.0, -8.0, 0.0, 1.0, (0.0, 1.0, 0.0))):
        sketch = Sketch(20.0, 2.0, (obstacle,))
        assert feasibility.find_way(sketch, VEHICLE, LIMITS) >= 0


@pytest.fixture
def few_starts(monkeypatch):
    """Straight on, around on one side, through the grid: to save time."""
    monkeypatch.setattr(feasibility, "DIRECTIONS", feasibility.DIRECTIONS[:1])
    monkeypatch.setattr(feasibility, "STARTS", 3)


@pytest.mark.parametrize("index", [0, 1])
def test_closed_walls_are_infeasible(few_starts, index):
    sketch = draw_flight("no_way", 1, index).sketch
    assert feasibility.find_way(sketch, VEHICLE, LIMITS) == -1


def test_the_same_wall_with_a_door_is_feasible(few_starts):
    """Twin of the closed walls: a few spheres less on the near side."""
    flights = (draw_flight("no_way", 1, i).sketch for i in range(20))
    sketch = next(s for s in flights if len(s.spheres) > 1)
    door = np.array([sketch.length - 4.0, 0.0, 0.0])
    left = tuple(s for s in sketch.spheres if np.linalg.norm(s.center - door) > 2.6 + s.radius)
    assert len(left) < len(sketch.spheres)
    sketch = dataclasses.replace(sketch, spheres=left, is_closed=False)
    assert feasibility.find_way(sketch, VEHICLE, LIMITS) >= 0


def test_ten_starts():
    sketch = draw_flight("static_fields", 0, 2).sketch
    starts = list(feasibility.starts(sketch, feasibility.spheres_of(sketch)))
    assert len(starts) == feasibility.STARTS == 10
    for path, duration in starts:
        assert np.allclose(path[0], 0.0)
        assert np.allclose(path[-1], [sketch.length, 0.0, 0.0])
        assert duration > sketch.length / sketch.speed


def test_check_refuses_what_touches_tilts_or_races():
    nothing = way.Spheres(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    points = straight(20.0, 12.0)

    def check(duration, spheres=nothing, limits=LIMITS):
        return feasibility.is_way(points, duration, spheres, VEHICLE, limits, heading=1.0)

    assert check(12.0)
    assert not check(4.5), "it would have to tilt too much"
    assert not check(12.0, limits=dataclasses.replace(LIMITS, speed=2.0))
    for gap, free in ((0.99, True), (1.01, False)):
        beside = way.Spheres(np.array([[10.0, 1.0, 0.0]]), np.zeros((1, 3)), np.array([gap]))
        assert check(12.0, beside) == free
    late = way.Spheres(np.array([[10.0, 9.0, 0.0]]), np.array([[0.0, -1.5, 0.0]]), np.ones(1))
    assert not check(12.0, late), "both are there after 6 s"
    assert check(18.0, late)


def test_inputs_fly_the_spline_in_the_controllers_model():
    """An integrator with tight tolerances, given the references, must land on the spline."""
    duration, heading, substeps = 9.0, 0.7, 20
    rng = np.random.default_rng(2)
    path = np.linspace(0.0, 1.0, 30)[:, None] * [12.0, 3.0, 1.0]
    path[5:-5] += np.cumsum(0.1 * rng.normal(size=(20, 3)), axis=0)
    points, h = spline.through(path), duration / spline.SEGMENTS
    mid = (np.arange(substeps) + 0.5) / substeps
    v, a, j = (
        feasibility._turned(m @ points / h**i, heading)
        for i, m in enumerate(spline.matrices(mid))
        if i > 0
    )
    inputs = feasibility._inputs(v, a, j, VEHICLE)
    step, p = reference_step(h / substeps), model_parameters(VEHICLE)
    x = np.zeros(10)
    for u in inputs:
        x = np.array(step(x, [*u, 0.0], p)).ravel()
    end = feasibility._turned(points[-1:], heading)[0]
    assert np.linalg.norm(x[:3] - end) < 0.02
    assert np.linalg.norm(x[6:9]) < 0.02


def test_grid_waits_for_what_passes_and_gives_up_at_a_wall():
    passing = way.Spheres(np.array([[5.0, -6.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]), np.ones(1))
    path = way_through(10.0, 12.0, passing, 2.0)
    t = np.linspace(0.0, 12.0, len(path))
    assert passing.excess(t, path).min() > 0.0
    closed = feasibility.spheres_of(draw_flight("no_way", 1, 0).sketch)
    assert way_through(20.0, 20.0, closed, 2.0) is None
