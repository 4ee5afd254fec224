# SPDX-License-Identifier: MIT
"""When the guard holds the aircraft back inside its mode, and when it does not."""

import dataclasses

import numpy as np
import pytest
from flight_stub import PARAMS, VEHICLE, Aircraft, Flight, make_plan
from guarded_m100 import following, steered

from nmpc_control.estimator import StateEstimate
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import Goal

STALE = "obstacles are 1.2 s old"


def without(**changes):
    return dataclasses.replace(PARAMS, stopping=dataclasses.replace(PARAMS.stopping, **changes))


def flight_with(solver, velocity=(0.0, 0.0, 0.0), params=PARAMS, obstacles=(), gps=0):
    """Return a flight that hovered and then begins anew at a velocity, on plans of a solver."""
    flight = Flight(params=params, aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.change = {"gps_health": gps, "needs_gps": gps > 0}
    flight.aircraft.airborne([0.0, 0.0, 5.0], velocity)

    def from_effect(t, x):
        return solver(
            t, flight.guard._sent.state_in_effect(t, StateEstimate(t, x, 0.0, 0.0, 0.0)), VEHICLE
        )

    flight.solver = from_effect
    flight.obstacles = tuple(obstacles)
    return flight


def sphere(position, radius=0.5, **kwargs):
    return Obstacle("ball", np.array(position, dtype=float), np.array([radius]), **kwargs)


def since(flight, t):
    return [output for when, _, output in flight.log if when > t]


def least(flight, obstacle, after):
    """Return the least clearance of the hull from an obstacle after a time."""
    rows = [(t, i.estimate.vector[:3]) for t, i, _ in flight.log if t > after]
    times, points = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    return float(obstacle.distance(points, times).min()) - VEHICLE.radius


# obstacles too long unseen


@pytest.mark.parametrize("gps", [0, 5])
def test_stale_obstacles_hold_it_back_inside_its_mode_until_they_are_fresh(gps):
    flight = flight_with(following([2.0, 0.0, 0.0]), [2.0, 0.0, 0.0], gps=gps)
    assert flight.run(0.5).mode is Mode.FLYING
    flight.stale = STALE
    output = flight.run(4.0)
    assert (output.mode, output.rung, output.reason) == (Mode.FLYING, Rung.BRAKE, STALE)
    assert flight.speed < 0.1
    flight.stale = ""
    output = flight.run(2.0)
    assert (output.mode, output.reason) == (Mode.FLYING, "the plan is verified")
    assert flight.speed > 1.0


def test_what_stale_obstacles_have_grown_to_does_not_end_the_mode():
    flight = flight_with(following([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0])
    flight.run(0.3)
    x = flight.aircraft.x[0]
    ball = sphere([x + 4.0, 0.0, 5.0], stamp=flight.t, growth=0.5)
    flight.obstacles, flight.stale = (ball,), STALE
    output = flight.run(6.0)  # it has grown over the aircraft, and the plans lead into it
    assert (output.mode, output.reason) == (Mode.FLYING, STALE)
    flight.stale = ""
    output = flight.run(0.6)
    assert output.mode is Mode.BRAKING


def met_by_one_whose_sender_is_silent(params):
    """Hover, with plans that step aside, while a ball comes that was seen last 2 s ago."""
    step_aside = steered(lambda x, vehicle: [-x[6], 3.0 * (2.0 - x[7]), -x[8]])
    flight = flight_with(step_aside, params=params)
    flight.stale, begun = STALE, flight.t
    ball = sphere([4.5, -0.1, 5.0], 0.5, velocity=np.array([-1.5, 0.0, 0.0]), stamp=flight.t)
    flight.obstacles = (ball,)
    flight.run(4.0)
    return flight, least(flight, ball, begun)


def test_what_comes_is_evaded_although_its_sender_is_silent_and_then_it_holds():
    flight, clearance = met_by_one_whose_sender_is_silent(PARAMS)
    assert clearance > 0.2
    output = flight.log[-1][2]
    assert (output.rung, output.reason) == (Rung.BRAKE, STALE), "it has passed"
    assert flight.speed < 0.3


def test_twin_that_always_brakes_for_what_is_stale_is_met():
    _, clearance = met_by_one_whose_sender_is_silent(without(advantage=1e3))
    assert clearance < 0.0


def test_stale_obstacles_are_nothing_to_an_aircraft_that_is_not_flown():
    flight = Flight()
    flight.stale = STALE
    output = flight.run(1.0)
    assert (output.mode, output.axes) == (Mode.READY, None)
    assert STALE not in output.reason


# something new in the way of the plan, far ahead


def told_of_a_wall(distance, grace):
    """Fly east at 1 m/s; return the modes of each tick in 0.5 s, new plans not coming any more."""
    check = dataclasses.replace(PARAMS.plan_check, grace=grace, timeout=5.0)
    params = dataclasses.replace(PARAMS, plan_check=check)
    flight = flight_with(following([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0], params)
    flight.run(0.5)
    begun, x, flight.solver = flight.t, flight.aircraft.x[0], None
    wall = Obstacle("wall", np.array([x + distance + 1.0, 0.0, 5.0]), np.array([1, 40, 40]), "box")
    flight.obstacles = (wall,)
    flight.run(0.5)
    return [o.mode for o in since(flight, begun)]


def test_a_plan_with_a_conflict_beyond_a_stop_is_flown_on_for_the_grace_only():
    modes = told_of_a_wall(2.9, 0.3)
    assert set(modes[:14]) == {Mode.FLYING}
    assert modes[-1] is Mode.BRAKING


def test_twin_without_grace_or_with_no_time_left_it_brakes_at_once():
    assert told_of_a_wall(2.9, 0.0)[0] is Mode.BRAKING
    assert told_of_a_wall(1.5, 0.3)[0] is Mode.BRAKING


# no room to stop


def test_a_moving_obstacle_that_comes_at_a_hover_is_evaded_not_braked_against():
    """It comes head-on at 3 m/s; the plan leaves sideways, and passes below the minimum."""
    evade = steered(lambda x, vehicle: [-x[6], 3.0 * (2.0 - x[7]), -x[8]])
    flight = flight_with(evade)
    begun = flight.t
    velocity = np.array([-3.0, 0.0, 0.0])
    ball = sphere([3.5, -0.1, 5.0], 0.5, velocity=velocity, stamp=flight.t)
    flight.obstacles = (ball,)
    flight.run(3.0)
    assert Mode.BRAKING not in {o.mode for o in since(flight, begun)}
    assert Rung.BRAKE not in {o.rung for o in since(flight, begun)}
    assert any("but braking would come to" in o.reason for o in since(flight, begun))
    assert 0.0 < least(flight, ball, begun) < PARAMS.plan_check.minimum_clearance


def test_a_plan_through_an_obstacle_is_not_the_lesser_evil():
    flight = flight_with(following([2.0, 0.0, 0.0]), [2.0, 0.0, 0.0])
    flight.run(0.5)
    begun, x = flight.t, flight.aircraft.x[0]
    flight.obstacles = (sphere([x + 2.6, 0.0, 5.0]),)  # too near to stop, and no plan past it
    assert flight.run(0.1).mode is Mode.BRAKING
    flight.run(0.5)
    assert {o.rung for o in since(flight, begun + 0.1)} == {Rung.BRAKE}


def passing(x, vehicle):
    """Fly east at 2.5 m/s on a line that turns aside in time: 1.6 m beside the way straight on."""
    aside = 1.7 if x[0] > 0.5 else 0.0
    return [2.5 - x[6], 2.0 * (1.6 * (aside - x[1]) - x[7]), -x[8]]


def test_a_plan_that_leads_past_what_it_could_not_stop_before_is_flown_and_told():
    ball = sphere([6.5, 0.0, 5.0], 0.6)
    flight = flight_with(steered(passing), [2.5, 0.0, 0.0], obstacles=[ball])
    begun = flight.t
    flight.run(5.0)
    outputs = since(flight, begun)
    assert Mode.BRAKING not in {o.mode for o in outputs}
    assert sum(o.rung is Rung.BRAKE for o in outputs) == 0
    assert least(flight, ball, begun) > 0.4


def test_the_reason_says_what_is_in_the_way_and_the_plans_go_on_afterwards():
    """It flies at a wall faster than it may, stops, and goes on once the wall is gone."""
    wall = Obstacle("wall", np.array([9.0, 0.0, 5.0]), np.array([1.0, 40.0, 40.0]), "box")

    def hard(x, vehicle):
        room = 8.5 - 0.9 - x[0] - 0.2 * x[6]
        wanted = min(3.5, np.sqrt(2.0 * 3.8 * max(room, 0.0)))
        return [1.5 * (wanted - x[6]) - (3.8 if 0.0 < wanted < 3.5 else 0.0), -x[7], -x[8]]

    flight = flight_with(steered(hard), [3.5, 0.0, 0.0], obstacles=[wall])
    begun = flight.t
    flight.run(4.0)
    held = [o for o in since(flight, begun) if o.rung is Rung.BRAKE]
    assert held
    assert all(o.reason.startswith("cannot stop before obstacle wall: needs ") for o in held)
    assert {o.mode for o in held} == {Mode.FLYING}
    assert flight.log[-1][2].rung is not Rung.BRAKE, "slow enough: the plans go on"
    twin = flight_with(steered(hard), [3.5, 0.0, 0.0], without(enabled=False), [wall])
    begun = twin.t
    twin.run(4.0)
    assert Rung.BRAKE not in {o.rung for o in since(twin, begun)}


def test_an_obstacle_that_is_nowhere_does_not_stop_the_guard():
    flight = flight_with(following([2.0, 0.0, 0.0]), [2.0, 0.0, 0.0])
    flight.obstacles = (sphere([np.nan, 0.0, 0.0]),)
    output = flight.run(0.5)
    assert output.mode is Mode.BRAKING
    assert "nowhere" in output.reason


def test_holding_is_not_held_back():
    """A plan that hovers beside a wall needs no room."""
    flight = flight_with(lambda t, x, vehicle: (make_plan(x, t, vehicle=vehicle), Goal.HOLD))
    flight.obstacles = (sphere([1.3, 0.0, 5.0]),)
    begun = flight.t
    assert flight.run(1.0).mode is Mode.HOVERING
    assert Rung.BRAKE not in {o.rung for o in since(flight, begun)}
