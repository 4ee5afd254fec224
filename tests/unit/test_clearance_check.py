# SPDX-License-Identifier: MIT
"""Clearance of many obstacles at once: the same as one by one, and only the near ones looked at."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import LIMITS, PARAMS, VEHICLE, Aircraft, Flight, make_plan

from nmpc_control import verdict as verdict_module
from nmpc_control.clearance_check import approach, check_clearance
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.state import GRAVITY, POSITION, VELOCITY, Goal, hover_state
from nmpc_control.verdict import Finding, Inside

CHECK = PARAMS.plan_check
T = 10.0


def plan_at(speed, position=(0.0, 0.0, 5.0)):
    """Return a plan that flies east at a constant speed."""
    state = hover_state(np.array(position))
    state[6] = speed
    pitch = math.atan(VEHICLE.drag[0] * speed / GRAVITY)
    state[4] = pitch
    return make_plan(state, T, [GRAVITY / math.cos(pitch), 0.0, pitch, 0.0])


def sphere(position, radius=0.5, name="ball", **kwargs):
    return Obstacle(name, np.array(position, dtype=float), np.array([radius]), **kwargs)


def scattered(rng, count, extent):
    obstacles = []
    for k in range(count):
        shape = ("sphere", "cylinder", "box")[k % 3]
        size = rng.uniform(0.3, 1.2, {"sphere": 1, "cylinder": 2, "box": 3}[shape])
        moves = {}
        if k % 2:
            moves = {"velocity": rng.normal(0.0, 1.0, 3), "stamp": T - 0.3, "growth": 0.2}
        if k % 8 == 5:
            moves["path"], moves["path_dt"] = rng.normal(0.0, extent, (4, 3)), 0.7
        position = rng.uniform(-extent, extent, 3) + [0.0, 0.0, 5.0]
        obstacles.append(Obstacle(f"o{k}", position, size, shape, **moves))
    return obstacles


def one_by_one(plan, obstacles):
    """Return the least clearance by dense sampling, each as grown as it is now."""
    stages = plan.times
    times = np.linspace(stages[0], stages[-1], 2401)
    points = np.stack([np.interp(times, stages, plan.states[:, i]) for i in range(3)], axis=1)
    least = math.inf
    for o in obstacles:
        still = dataclasses.replace(o, growth=0.0)
        distance = still.distance(points, times) - o.growth_at(np.array(T))
        least = min(least, float(distance.min()) - VEHICLE.radius)
    return least


@pytest.mark.parametrize("extent", [6.0, 20.0])
def test_all_at_once_is_the_same_as_one_by_one(extent):
    rng = np.random.default_rng(3)
    for _ in range(12):
        obstacles = scattered(rng, 24, extent)
        plan = plan_at(rng.uniform(0.0, 4.0))
        found = check_clearance(plan, T, VEHICLE, obstacles, CHECK).clearance
        assert found == pytest.approx(one_by_one(plan, obstacles), abs=0.03)


def test_of_256_obstacles_only_the_near_ones_are_looked_at_point_by_point():
    rng = np.random.default_rng(4)
    positions = rng.uniform([-40.0, -40.0, 0.0], [40.0, 40.0, 10.0], (256, 3))
    obstacles = [sphere(p, rng.uniform(0.4, 1.5), f"o{k}") for k, p in enumerate(positions)]
    plan = plan_at(2.0)
    points, times = plan.states[:, POSITION], T + 0.1 * np.arange(61)
    near = approach(points, times, T, ObstacleField(obstacles), VEHICLE.radius, 1.0)
    truly = sum(one_by_one(plan, [o]) < 1.0 for o in obstacles)
    assert truly <= len(near.ids) <= truly + 10
    assert len(near.ids) < 40
    assert float(near.grown.min()) == pytest.approx(one_by_one(plan, obstacles), abs=0.03)


def test_an_obstacle_is_where_it_is_expected_and_as_large_as_it_may_be_now():
    known = dict(stamp=T - 1.0, growth=0.3, velocity=np.array([0.0, 0.5, 0.0]))
    plan = plan_at(0.0)
    away = check_clearance(plan, T, VEHICLE, [sphere([0.0, 1.5, 5.0], **known)], CHECK)
    # 1 s old: 0.5 m farther off and 0.3 m larger when the plan begins, and only leaving after that
    drift = 0.5 * VEHICLE.delay
    assert away.clearance == pytest.approx(2.0 + drift - 0.5 - 0.3 - VEHICLE.radius, abs=0.01)


SWALLOWING = sphere([2.0, 0.0, 5.0], stamp=T - 10.0, growth=0.3)  # grown by 3 m: over the aircraft


def test_what_swallows_the_aircraft_by_growth_lets_it_stay_and_leave_but_not_come_nearer():
    stays = check_clearance(plan_at(0.0), T, VEHICLE, [SWALLOWING], CHECK)
    assert stays.ok
    assert stays.clearance < -1.0
    assert check_clearance(plan_at(-1.0), T, VEHICLE, [SWALLOWING], CHECK).ok
    nearer = check_clearance(plan_at(0.2), T, VEHICLE, [SWALLOWING], CHECK)
    assert nearer.finding is Finding.CLEARANCE
    fresh = dataclasses.replace(SWALLOWING, stamp=T)
    assert check_clearance(plan_at(0.2), T, VEHICLE, [fresh], CHECK).ok


def test_growth_keeps_a_plan_farther_off():
    plan = plan_at(1.0)
    beside = sphere([3.0, 1.4, 5.0], stamp=T - 1.0, growth=0.3)  # 0.4 m, 0.1 m as grown
    assert check_clearance(plan, T, VEHICLE, [beside], CHECK).finding is Finding.CLEARANCE
    grown_over = dataclasses.replace(beside, growth=0.6)
    assert check_clearance(plan, T, VEHICLE, [grown_over], CHECK).finding is Finding.COLLISION
    assert check_clearance(plan, T, VEHICLE, [dataclasses.replace(beside, growth=0.0)], CHECK).ok


def test_what_is_tolerated_counts_from_where_the_minimum_was_entered():
    ball = sphere([1.05, 0.0, 5.0])  # 0.05 m off
    plan = plan_at(0.0)
    assert check_clearance(plan, T, VEHICLE, [ball], CHECK, Inside({"ball": 0.12})).ok
    pushed = Inside({"ball": 0.19})  # 0.14 m deeper than where it came in
    assert not check_clearance(plan, T, VEHICLE, [ball], CHECK, pushed).ok
    assert check_clearance(plan_at(-0.3), T, VEHICLE, [ball], CHECK, pushed).ok, "the way out"


def test_what_is_remembered_is_forgotten_outside():
    before = Inside({"a": 0.1, "b": 0.15}, fence=0.3)
    after = Inside({"a": 0.02, "c": 0.18}).since(before)
    assert after == Inside({"a": 0.1, "c": 0.18})
    assert Inside(fence=0.5).since(before).fence == 0.3


def creeping(towards, speed=0.05):
    """Return a flight on plans that creep on in a direction (3,) at a speed [m/s]."""
    flight = Flight(aircraft=Aircraft().airborne([0.0, 0.0, 5.0])).hovering()
    flight.change = {"gps_health": 0, "needs_gps": False}
    direction = np.array(towards, dtype=float)

    def solver(t, x):
        x = x.copy()
        a = np.clip(speed * direction - x[6:9], -0.3, 0.3)
        u = [GRAVITY + a[2], -a[1] / GRAVITY, a[0] / GRAVITY, 0.0]
        plan = make_plan(
            x, t, np.vstack([np.tile(u, (5, 1)), np.tile([GRAVITY, 0, 0, 0], (30, 1))]), horizon=35
        )
        return plan, Goal.TRAJECTORY

    flight.solver = solver
    return flight


@pytest.mark.parametrize("remembers", [True, False], ids=["guard", "twin"])
def test_creeping_inside_the_minimum_is_bounded(monkeypatch, remembers):
    if not remembers:
        monkeypatch.setattr(verdict_module.Inside, "since", lambda self, before: self)
    flight = creeping([1.0, 0.0, 0.0])
    ball = sphere([1.21, 0.0, 5.0])  # 0.21 m off
    flight.obstacles = (ball,)
    least = []
    for _ in range(11):
        flight.run(1.0)
        least.append(float(ball.distance(flight.aircraft.x[:3])) - VEHICLE.radius)
    floor = CHECK.minimum_clearance - CHECK.growth_tolerance
    assert bool(min(least) > floor - 0.03) is remembers


@pytest.mark.parametrize("remembers", [True, False], ids=["guard", "twin"])
def test_creeping_out_of_the_fence_is_bounded(monkeypatch, remembers):
    if not remembers:
        monkeypatch.setattr(verdict_module.Inside, "since", lambda self, before: self)
    flight = creeping([0.0, 1.0, 0.0])
    flight.guard.ladder.limits = dataclasses.replace(LIMITS, fence_max=np.array([9.0, 0.05, 99.0]))
    flight.run(10.0)
    farthest = max(inputs.estimate.vector[1] for _, inputs, _ in flight.log) - 0.05
    assert bool(farthest < CHECK.growth_tolerance + 0.05) is remembers


def test_the_speed_of_a_way_around_is_not_that_of_its_slowest_place():
    plan = plan_at(2.0)
    slow = np.array(plan.states)
    slow[10, VELOCITY] = 0.1  # on a way that keeps the same distance
    level = Obstacle("floor", np.array([0.0, 0.0, 0.0]), np.array([100.0, 100.0, 7.0]), "box")
    found = check_clearance(dataclasses.replace(plan, states=slow), T, VEHICLE, [level], CHECK)
    assert found.speed == pytest.approx(2.0)
    ends = check_clearance(plan_at(0.1), T, VEHICLE, [level], CHECK)
    assert ends.speed == pytest.approx(0.1)
