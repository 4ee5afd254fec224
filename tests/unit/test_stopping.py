# SPDX-License-Identifier: MIT
"""The stopping distance by hand, and what counts as being in the way."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import PARAMS, VEHICLE

from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import load_vehicle
from nmpc_control.state import GRAVITY, hover_state
from nmpc_control.stopping import clearance_of, shortfall, way_to_stop

BRAKE = PARAMS.brake
A, K = BRAKE.deceleration, BRAKE.velocity_gain
MARGIN, FACTOR = 0.1, 1.5
LATENCY = VEHICLE.delay + 0.02 + 0.05  # [s] dead time, period, age of the plan
RISE = VEHICLE.pitch.time_constant  # [s] of the tilt


def moving(velocity, position=(0.0, 0.0, 5.0), tilt=0.0):
    state = hover_state(np.array(position))
    state[6:9] = velocity
    state[4] = tilt
    return state


def way(velocity=(3.0, 0.0, 0.0), **kwargs):
    return way_to_stop(moving(velocity, **kwargs), VEHICLE, BRAKE, LATENCY, FACTOR)


def wall(x):
    """Return a wall across the way whose near face is at ``x`` [m]."""
    return Obstacle("wall", np.array([x + 1.0, 0.0, 5.0]), np.array([2.0, 50.0, 50.0]), "box")


def sphere(position, radius=0.5, **kwargs):
    return Obstacle("ball", np.array(position, dtype=float), np.array([radius]), **kwargs)


def fall_short(*obstacles, velocity=(3.0, 0.0, 0.0), t=10.0, **kwargs):
    field = ObstacleField(obstacles)
    return shortfall(way(velocity, **kwargs), t, field, VEHICLE.radius, MARGIN)


@pytest.mark.parametrize("speed", [3.0, 5.0])
def test_the_distance_of_a_fast_stop_is_reaction_and_one_and_a_half_times_the_braking(speed):
    expected = speed * (LATENCY + RISE) + 1.5 * speed**2 / (2.0 * A)
    assert way([speed, 0.0, 0.0]).needed == pytest.approx(expected)


def test_a_slow_stop_takes_what_a_brake_proportional_to_velocity_takes():
    assert way([0.6, 0.0, 0.0]).needed == pytest.approx(0.6 * LATENCY + 0.6 / K)


def test_the_rise_of_the_tilt_is_the_lag_of_the_vehicle():
    slow = load_vehicle("eth")
    lag = way_to_stop(moving([3.0, 0.0, 0.0]), slow, BRAKE, LATENCY, FACTOR)
    assert lag.needed - way().needed == pytest.approx(3.0 * (0.267 - RISE))


def test_a_tilt_that_speeds_it_up_counts_until_it_has_decayed():
    tilt = 0.2
    speed = 3.0 + GRAVITY * math.tan(tilt) * RISE
    assert way(tilt=tilt).speed == pytest.approx(speed)
    assert way(tilt=-tilt).speed == pytest.approx(3.0), "slowing down is no promise"


def test_the_way_is_covered_at_constant_speed_then_ever_slower_to_its_end():
    w = way()
    times = np.linspace(0.0, w.duration, 400)
    covered = w.distance(times)
    assert covered[-1] == pytest.approx(w.needed)
    assert w.distance(np.array([w.reaction]))[0] == pytest.approx(3.0 * w.reaction)
    rate = np.diff(covered) / np.diff(times)
    assert rate[0] == pytest.approx(3.0, rel=0.01)
    assert rate[-1] < 0.1
    assert (np.diff(rate) <= 1e-9).all()


def test_a_wall_ahead_must_be_as_far_as_the_way_the_hull_and_the_margin():
    free = way().needed + VEHICLE.radius + MARGIN
    assert fall_short(wall(free + 0.01)) is None
    found = fall_short(wall(free - 0.15))
    assert found.obstacle == "wall"
    assert found.needed == pytest.approx(way().needed)
    assert found.has == pytest.approx(way().needed - 0.15, abs=0.08)
    assert str(found) == "cannot stop before obstacle wall: needs 3.2 m, has 3.0 m"


def test_what_is_beside_or_behind_does_not_count():
    beside = VEHICLE.radius + 0.5 + MARGIN + 0.01
    assert fall_short(sphere([1.5, beside, 5.0])) is None
    assert fall_short(sphere([1.5, beside - 0.1, 5.0])) is not None
    assert fall_short(sphere([-1.2, 0.0, 5.0])) is None
    assert fall_short(sphere([-1.05, 0.0, 5.0])) is None, "near, but being left"


def test_flying_along_a_wall_inside_the_margin_is_not_flying_at_it():
    along = Obstacle("side", np.array([0.0, 1.55, 5.0]), np.array([40.0, 2.0, 9.0]), "box")
    assert fall_short(along) is None
    assert fall_short(along, velocity=(3.0, 0.3, 0.0)) is not None


def test_a_moving_obstacle_counts_where_it_is_expected_at_that_time():
    crossing = sphere([2.0, -3.0, 5.0], velocity=np.array([0.0, 4.0, 0.0]), stamp=10.0)
    assert fall_short(crossing) is not None
    assert fall_short(dataclasses.replace(crossing, velocity=np.zeros(3))) is None
    leaving = dataclasses.replace(crossing, velocity=np.array([0.0, -4.0, 0.0]))
    assert fall_short(leaving) is None
    fleeing = sphere([3.0, 0.0, 5.0], velocity=np.array([4.0, 0.0, 0.0]), stamp=10.0)
    assert fall_short(fleeing) is None
    assert fall_short(dataclasses.replace(fleeing, velocity=np.zeros(3))) is not None


def test_an_obstacle_is_as_large_as_its_information_is_old():
    far = way().needed + VEHICLE.radius + MARGIN + 0.5 + 0.2
    ball = sphere([far, 0.0, 5.0], stamp=9.0, growth=0.1)
    assert fall_short(ball) is None
    assert fall_short(dataclasses.replace(ball, growth=0.4)) is not None


def test_inside_what_an_obstacle_may_have_grown_to_only_flying_at_it_counts():
    ball = sphere([2.5, 0.0, 5.0], stamp=0.0, growth=0.3)  # 3 m larger than it was
    assert fall_short(ball, velocity=(-2.0, 0.0, 0.0)) is None
    assert fall_short(ball, velocity=(1.0, 0.0, 0.0)) is not None


def test_the_clearance_of_a_stop_is_at_its_end_and_of_standing_there():
    w = way()
    ahead = ObstacleField([wall(w.needed + 1.0)])
    assert clearance_of(w, 3.0, 10.0, ahead, VEHICLE.radius) == pytest.approx(0.5, abs=0.02)
    coming = sphere([9.0, 0.0, 5.0], velocity=np.array([-1.0, 0.0, 0.0]), stamp=10.0)
    at_end = 9.0 - 5.0 - w.needed - 0.5 - VEHICLE.radius
    after = clearance_of(w, 5.0, 10.0, ObstacleField([coming]), VEHICLE.radius)
    assert after == pytest.approx(at_end, abs=0.05)
