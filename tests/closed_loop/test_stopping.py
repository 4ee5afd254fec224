# SPDX-License-Identifier: MIT
"""The stopping distance against the simulated aircraft, and a solver that dies at a bad moment."""

import dataclasses

import numpy as np
import pytest
from guarded_m100 import HEIGHT, PARAMS, TICK, GuardedM100, following, stopping_late
from hypothesis import given, settings
from hypothesis import strategies as st

from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.stopping import shortfall, way_to_stop

PLANTS = ("dji_hil", "eth")
OFF = dataclasses.replace(PARAMS, stopping=dataclasses.replace(PARAMS.stopping, enabled=False))
GPS = pytest.mark.parametrize("gps", [True, False], ids=["velocity hold", "own brake"])


def heading(azimuth, climb):
    level = np.sqrt(1.0 - climb**2)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), climb])


def at_speed(plant, velocity, gps, gathers, wind=(0.0, 0.0, 0.0)):
    """Return a flight at about a velocity (3,) [m/s], still gathering speed or not, and its way."""
    start = velocity * (0.7 if gathers else 1.0)
    flight = GuardedM100(plant, start, following(velocity), gps=gps, wind=wind)
    flight.run(0.4)
    return flight, way_of(flight)


def way_of(flight):
    x = flight.in_effect()
    return way_to_stop(x, flight.known, PARAMS.brake, TICK, PARAMS.stopping.factor)


def fits(flight, way, obstacle):
    field, t = ObstacleField([obstacle]), flight.t + flight.vehicle.delay
    return shortfall(way, t, field, flight.vehicle.radius, PARAMS.stopping.margin) is None


def brake(flight):
    """Let the guard brake, as for obstacles long unseen, until the aircraft stands."""
    flight.solver, flight.obstacles_stale = None, "unseen"
    flight.until_at_rest()


@pytest.mark.parametrize("plant", PLANTS)
@GPS
@settings(max_examples=12, derandomize=True)
@given(
    speed=st.floats(0.5, 5.0),
    azimuth=st.floats(-np.pi, np.pi),
    climb=st.floats(-0.3, 0.3),
    radius=st.floats(0.3, 3.0),
    offset=st.floats(-1.0, 1.0),
    beyond=st.floats(0.0, 0.5),
    gathers=st.booleans(),
    wind=st.floats(-8.0, 8.0),
)
def test_where_a_stop_fits_the_brake_does_not_hit(
    plant, gps, speed, azimuth, climb, radius, offset, beyond, gathers, wind
):
    """The sphere is put as near as the condition allows, or a little farther; on truth."""
    ahead = heading(azimuth, climb)
    flight, way = at_speed(plant, speed * ahead, gps, gathers, wind * heading(azimuth, 0.0))
    aside = np.cross(way.direction, [0.0, 0.0, 1.0]) * offset * (radius + flight.vehicle.radius)
    ball = near = None
    for distance in np.arange(0.0, 20.0, 0.02):
        near = Obstacle("ball", way.start + distance * way.direction + aside, np.array([radius]))
        if distance > radius + 0.5 and fits(flight, way, near):
            place = near.position + beyond * way.direction
            ball = dataclasses.replace(near, position=place)
            break
    assert ball is not None
    brake(flight)
    assert Rung.BRAKE in {o.rung for o in flight.outputs}
    assert flight.clearance(ball) > 0.0


@pytest.mark.parametrize("plant", PLANTS)
@GPS
def test_twin_where_a_stop_is_far_from_fitting_it_hits(plant, gps):
    for speed in (1.5, 3.0, 4.5):
        flight, way = at_speed(plant, np.array([speed, 0.0, 0.0]), gps, False)
        room = 0.35 * way.needed + flight.vehicle.radius
        wall = Obstacle("wall", way.start + [room + 0.5, 0, 0], np.array([1.0, 50, 50]), "box")
        assert not fits(flight, way, wall)
        brake(flight)
        assert flight.clearance(wall) < 0.0


def braked_in_tail_wind(plant, params):
    """Return the way [m] that the own brake took from 3 m/s, and the drift [m/s] after it."""
    flight = GuardedM100(plant, [3.0, 0, 0], following([3.0, 0, 0]), params, False, (8.0, 0, 0))
    flight.run(2.0)
    needed, start = way_of(flight).needed, flight.in_effect()[0]
    brake(flight)
    flight.run(2.0)
    travel = [p[0] - start for p in flight.path]
    return needed, max(travel), abs(flight.aircraft.truth.velocity[0])


@pytest.mark.parametrize("plant", PLANTS)
def test_the_own_brake_makes_up_for_a_tail_wind_that_was_learnt(plant):
    needed, took, drift = braked_in_tail_wind(plant, PARAMS)
    assert took < needed
    assert drift < 0.1


@pytest.mark.parametrize("plant", PLANTS)
def test_twin_that_learns_nothing_is_carried_on(plant):
    none = dataclasses.replace(PARAMS.disturbance, horizontal=0.0)
    _, took, _ = braked_in_tail_wind(plant, dataclasses.replace(PARAMS, disturbance=none))
    learnt = braked_in_tail_wind(plant, PARAMS)[1]
    assert took > learnt + 0.05


WALL = Obstacle("wall", np.array([12.5, 0.0, HEIGHT]), np.array([1.0, 40.0, 40.0]), "box")
HANGS = np.arange(1.3, 2.2, 0.2)  # [s] on the way to the wall


def hung(plant, gps, params, after):
    """Fly at a wall at 4 m/s with a solver that stops as late as it can, and dies ``after`` [s]."""
    solver = stopping_late(12.0, 4.0, 4.0, 0.4)
    flight = GuardedM100(plant, [4.0, 0.0, 0.0], solver, params, gps)
    flight.obstacles = [WALL]
    flight.run(after)
    flight.solver = None
    flight.until_at_rest(6.0)
    return flight


@pytest.mark.parametrize("plant", PLANTS)
def test_a_solver_that_dies_on_the_way_to_a_wall_does_not_hit_it(plant):
    flights = [hung(plant, False, PARAMS, after) for after in HANGS]
    assert min(flight.clearance(WALL) for flight in flights) > 0.1
    held = [o for flight in flights for o in flight.outputs if "cannot stop" in o.reason]
    assert {o.mode for o in held} <= {Mode.FLYING, Mode.BRAKING}
    assert Rung.BRAKE in {o.rung for o in held}


@pytest.mark.parametrize("plant", PLANTS)
def test_twin_without_the_stopping_distance_hits_the_wall(plant):
    """Each of its plans is verified, and stops before the wall with more than the brake can do."""
    flights = [hung(plant, False, OFF, after) for after in HANGS]
    assert min(flight.clearance(WALL) for flight in flights) < -0.1


@pytest.mark.parametrize("plant", PLANTS)
def test_a_stop_in_time_by_the_plan_alone_is_let_be(plant):
    """Gently stopped, with room for the brake at every moment: nothing is held back."""
    solver = stopping_late(12.0, 2.0, 0.8, 1.0)
    flight = GuardedM100(plant, [2.0, 0.0, 0.0], solver)
    flight.obstacles = [WALL]
    flight.run(9.0)
    assert flight.clearance(WALL) > 0.5
    assert {o.rung for o in flight.outputs} <= {Rung.NEW_PLAN, Rung.LAST_PLAN}
