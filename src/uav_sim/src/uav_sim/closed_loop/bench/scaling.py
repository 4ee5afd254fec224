# SPDX-License-Identifier: MIT
"""Time of a solve against the length of the horizon and against the number of obstacles."""

import time
from dataclasses import replace
from typing import Dict, List, Sequence

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.state import hover_input
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.random_problems import reference_states
from uav_sim.closed_loop.bench.recording import exact_solver
from uav_sim.closed_loop.bench.scenes import WIDE, scatter

_PERIOD = 0.05  # [s] between two solves
_NUDGE = 0.05  # [m], [m/s] sigma of what the model did not foresee in between


def by_horizon(sizes: Sequence[int], count: int, repeats: int) -> Dict[str, object]:
    """Return median times for horizons of N stages, and the exponent of their growth."""
    scenario = load_scenario("multi_obstacle")
    medians = [_median(_problems(scenario, N, 8, count), repeats) for N in sizes]
    exponent = float(np.polyfit(np.log(sizes), np.log(medians), 1)[0])
    return {"size": list(sizes), "p50_ms": medians, "exponent": exponent}


def by_obstacles(sizes: Sequence[int], count: int, repeats: int, seed: int) -> Dict[str, object]:
    """Return median times for as many obstacles, each in a slot of its own.

    The exponent is that of the growth beyond no obstacles; ``ratio`` compares with none.
    """
    scenario = load_scenario("multi_obstacle")
    scenes = {n: scatter(scenario, n, seed, WIDE) for n in sizes}
    medians = [_median(_problems(scene, 60, n, count), repeats) for n, scene in scenes.items()]
    some = [(n, ms) for n, ms in zip(sizes, medians) if n > 0]
    exponent = float(np.polyfit(*np.log(some).T, 1)[0])
    ratio = [ms / medians[0] for ms in medians]
    return {"size": list(sizes), "p50_ms": medians, "exponent": exponent, "ratio": ratio}


def _problems(scenario: Scenario, horizon: int, slots: int, count: int) -> List[Problem]:
    """Return warm-started problems spread over a scenario, with another structure."""
    parameters = bench_parameters(scenario.weights)
    solver = replace(parameters.solver, horizon=horizon, obstacle_slots=slots)
    nmpc = Nmpc(replace(parameters, solver=solver))
    nmpc.solver = recorder = Recorder(exact_solver(nmpc.structure))
    rng = np.random.default_rng(0)
    problems = []
    for t in np.linspace(0.1, 0.9, count) * scenario.trajectory.duration:
        nmpc.reset()
        first = reference_states(nmpc, scenario, t)
        nmpc.solve(t, first[0], first, hover_input(), scenario.obstacles)
        plan = recorder.solutions[-1]
        x0 = 0.5 * (plan.states[0] + plan.states[1])
        x0[[0, 1, 2, 6, 7, 8]] += _NUDGE * rng.normal(size=6)
        following = reference_states(nmpc, scenario, t + _PERIOD)
        nmpc.solve(t + _PERIOD, x0, following, plan.inputs[0], scenario.obstacles)
        posed = (recorder.instances[-1], recorder.guesses[-1])
        problems.append(Problem("scaling", nmpc.structure, *posed))
    return problems


def _median(problems: List[Problem], repeats: int) -> float:
    """Return the median over the problems of the fastest repeat [ms]."""
    solver = exact_solver(problems[0].structure)
    fastest = []
    for problem in problems:
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            solver.solve(problem.instance, problem.guess)
            times.append(time.perf_counter() - start)
        fastest.append(1e3 * min(times))
    return float(np.median(fastest))
