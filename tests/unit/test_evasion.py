# SPDX-License-Identifier: MIT
"""What comes at an aircraft without plans is evaded, by DJI's control or by our own."""

import dataclasses

import numpy as np
import pytest
from guarded_m100 import HEIGHT, PARAMS, GuardedM100

from nmpc_control.evasion import Evasion
from nmpc_control.mode_inputs import Mode
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import load_parameters
from nmpc_control.state import hover_state

FLIGHT = load_parameters("dji_hil")
BLIND = dataclasses.replace(PARAMS, evasion=dataclasses.replace(PARAMS.evasion, enabled=False))
REST = hover_state(np.array([0.0, 0.0, HEIGHT]))


def ball(t, position, velocity, radius=0.5):
    place = np.array([0.0, 0.0, HEIGHT]) + position
    return Obstacle("ball", place, np.array([radius]), velocity=np.array(velocity), stamp=t)


def flight(plant, gps, params=PARAMS):
    """Return the least clearance [m] of a flight at which a ball comes, and the flight."""
    m100 = GuardedM100(plant, (0.0, 0.0, 0.0), None, params, gps)
    coming = ball(m100.t, [-5.0, 0.3, 0.0], [1.5, 0.0, 0.0])
    m100.obstacles = [coming]
    m100.run(6.0)
    assert m100.outputs[-1].mode is Mode.BRAKING
    return m100.clearance(coming), m100


@pytest.mark.parametrize("gps", [True, False])
@pytest.mark.parametrize("plant", ["dji_hil", "eth"])
def test_who_has_no_plan_gets_out_of_the_way_and_holds_again(plant, gps):
    clearance, m100 = flight(plant, gps)
    assert clearance > 0.2
    assert any("out of the way of obstacle ball" in output.reason for output in m100.outputs)
    assert m100.guard.evasion.velocity is None and m100.speed < 0.3
    assert flight(plant, gps, BLIND)[0] < 0.0, "the twin is hit"


def evasion(**changes):
    return Evasion(dataclasses.replace(PARAMS.evasion, **changes), FLIGHT.vehicle, FLIGHT.limits)


def look(what, found=None, state=REST):
    found = evasion() if found is None else found
    return found.look(state, 0.0, ObstacleField([what]))


def test_what_stands_or_passes_is_not_evaded():
    assert look(ball(0.0, [1.2, 0.0, 0.0], [0.0, 0.0, 0.0])) is None, "0.2 m, and it stays"
    assert look(ball(0.0, [-3.0, 2.5, 0.0], [1.5, 0.0, 0.0])) is None
    assert look(ball(0.0, [-3.0, 0.0, 0.0], [-1.5, 0.0, 0.0])) is None
    assert look(ball(0.0, [-3.0, 0.0, 0.0], [1.5, 0.0, 0.0])) is not None


def test_what_it_may_have_grown_to_is_not_evaded():
    old = dataclasses.replace(ball(-5.0, [2.5, 0.0, 0.0], [0.0, 0.0, 0.0]), growth=0.5)
    assert look(old) is None


def test_who_is_fast_brakes_first():
    state = REST.copy()
    state[6] = 3.0
    assert look(ball(0.0, [6.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), state=state) is None


def test_the_side_is_kept_until_holding_is_good_enough():
    found = evasion()
    velocities = []
    for k in range(60):
        coming = ball(0.0, [-3.0 + 0.03 * k, 0.02 * (-1) ** k, 0.0], [1.5, 0.0, 0.0])
        velocities.append(look(coming, found))
    assert all(np.array_equal(v, velocities[0]) for v in velocities)
    gone = ball(0.0, [3.0, 0.0, 0.0], [1.5, 0.0, 0.0])
    assert look(gone, found) is None and found.obstacle == ""


@pytest.mark.parametrize("side", [np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0])])
def test_the_fence_is_not_left(side):
    corner = dataclasses.replace(
        FLIGHT.limits,
        fence_min=np.array([-3.0, -1.0 if side[1] > 0 else -20.0, 0.3]),
        fence_max=np.array([3.0, 20.0 if side[1] > 0 else 1.0, HEIGHT + 1.0]),
    )
    found = Evasion(PARAMS.evasion, FLIGHT.vehicle, corner)
    velocity = look(ball(0.0, [-3.0, 0.0, 0.0], [1.5, 0.0, 0.0]), found)
    assert velocity @ side > 1.0
