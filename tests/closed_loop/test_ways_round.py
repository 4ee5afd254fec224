# SPDX-License-Identifier: MIT
"""Flat, thin and thick bodies and walls of small spheres are flown round, on truth, in the margin.

The scenario multi_obstacle at the paper's speed keeps its distances and its time.
"""

import dataclasses

import numpy as np
import pytest

from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import load_parameters
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.trajectory import line
from uav_sim.closed_loop.flight_record import record_of, world_of
from uav_sim.closed_loop.loop import fly
from uav_sim.closed_loop.simulate import new_loop, simulate

MARGIN = 0.5  # [m] hull to surface
START, END = np.array([0.0, 0.0, 12.0]), np.array([16.0, 0.0, 12.0])
TIME_LIMIT = 40.0  # [s]


def box(*size):
    return (Obstacle("box", np.array([8.0, 0.0, 12.0]), np.array(size), "box"),)


def small_spheres():
    return tuple(
        Obstacle(f"s{i}_{j}", np.array([8.0, 0.8 * i, 12.0 + 0.8 * j]), np.array([0.4]))
        for i in range(-4, 5)
        for j in range(-4, 5)
    )


BODIES = {
    "board": (box(0.2, 4.0, 4.0), 2.5),
    "thick": (box(2.0, 8.0, 8.0), 2.5),
    "small spheres": (small_spheres(), 1.5),
}


def flight(obstacles, speed, **avoidance):
    scenario = Scenario(
        "body", "", line(START, END, speed), obstacles, None, "outdoor", START, np.zeros(3)
    )
    p = load_parameters("dji_hil", "outdoor")
    p = dataclasses.replace(
        p,
        avoidance=dataclasses.replace(p.avoidance, **avoidance),
        solver=p.solver.with_budget(time_budget=1.0),  # what is found does not hang on the load
    )
    loop = new_loop(scenario, p, "dji_hil", world_of(scenario, 0.5))

    class TimeIsOverError(Exception):
        pass

    def watch(progress):
        if loop.t > TIME_LIMIT:
            raise TimeIsOverError

    try:
        fly(scenario, loop, on_progress=watch)
    except TimeIsOverError:
        loop.log.end = loop.t
    return flight_metrics(record_of(scenario, loop.log, 0), 0.5), min(
        loop.aircraft.clearance.values()
    )


@pytest.mark.parametrize("body", BODIES)
def test_a_body_is_flown_round(body):
    metrics, clearance = flight(*BODIES[body])
    assert metrics["arrived"]
    assert clearance >= MARGIN


@pytest.mark.parametrize("plant", ["dji_hil", "eth"])
@pytest.mark.parametrize(("radius", "deviation"), [(0.0, 0.35), (0.5, 0.55)])
def test_multi_obstacle_at_the_papers_speed(plant, radius, deviation):
    scenario = load_scenario("multi_obstacle", speed=1.65)
    p = load_parameters(plant, scenario.weights)
    p = dataclasses.replace(
        p,
        vehicle=dataclasses.replace(p.vehicle, radius=radius),
        solver=p.solver.with_budget(time_budget=1.0),
    )
    metrics = simulate(scenario, p, plant)
    assert metrics["average_deviation_m"] <= deviation
    assert min(metrics["clearance_truth_m"].values()) >= MARGIN
    assert metrics["navigation_time_s"] <= 1.05 * scenario.trajectory.duration
