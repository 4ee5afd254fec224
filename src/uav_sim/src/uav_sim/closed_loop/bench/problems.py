# SPDX-License-Identifier: MIT
"""Problems on which the backends are compared, recorded from closed loops."""

from dataclasses import replace
from typing import Dict, List, Optional

import numpy as np

from nmpc_control.ocp import PARTS, SLOT_SIZE
from nmpc_control.scenario import load_scenario
from nmpc_control.slots import clearance
from nmpc_control.state import NU, NX, POSITION
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.problem import Problem
from uav_sim.closed_loop.bench.recording import exact_solver, record, structure_of
from uav_sim.closed_loop.bench.scenes import scatter

KINDS = ("hexagon", "multi_obstacle", "obstacles_32", "push", "cold_start")

_AFTER_PUSH = 2.0  # [s] of flight that counts as its consequence
_JUMP = 5.0  # [m] sudden change of the position before a cold start
_LOWEST = 0.5  # [m] height after it


def recorded_problems(
    count: int, seed: int = 0, until: Optional[float] = None
) -> Dict[str, List[Problem]]:
    """Return at most ``count`` problems of every kind, spread evenly over the flights.

    Args:
        count: of each kind.
        seed: of scattered spheres, pushes and jumps.
        until: end the flights at this part of the trajectory's time.
    """
    multi = load_scenario("multi_obstacle")
    flights = {
        "hexagon": (load_scenario("hexagon"), None),
        "multi_obstacle": (multi, None),
        "obstacles_32": (scatter(multi, 32, seed), None),
        "push": (multi, seed),
    }
    result = {}
    for kind, (scenario, pushes_seed) in flights.items():
        parameters = bench_parameters(scenario.weights)
        solver = exact_solver(structure_of(parameters))
        flight = record(scenario, parameters, solver, pushes_seed, until)
        rate = parameters.solver.budget.rate
        stride = round(parameters.solver.dt * rate)
        indices = np.arange(stride, len(flight.recorder.instances))
        if flight.pushes:
            after = round(_AFTER_PUSH * rate)
            indices = np.concatenate([np.arange(i, i + after) for i in flight.pushes])
            indices = indices[indices < len(flight.recorder.instances)]
        result[kind] = flight.recorder.problems(kind, stride, _spread(indices, count))
    warm = result["hexagon"] + result["multi_obstacle"]
    chosen = [warm[i] for i in _spread(np.arange(len(warm)), count)]
    result["cold_start"] = _cold_starts(chosen, seed)
    return result


def in_reach(problem: Problem, positions: np.ndarray) -> bool:
    """Return whether the potential of any obstacle acts at positions (M, 3) of stages 0..M-1."""
    slots = problem.instance.stages[NX + NU :].reshape(-1, SLOT_SIZE, problem.structure.horizon + 1)
    slots = slots[:, :, : len(positions)].swapaxes(1, 2)
    begins = problem.instance.theta[PARTS["cushion"]]
    return bool(np.any(clearance(slots, positions) < begins))


def _cold_starts(problems: List[Problem], seed: int) -> List[Problem]:
    """Return the problems after a jump in a random direction, to be solved from hover."""
    rng = np.random.default_rng(seed)
    result = []
    for problem in problems:
        x0 = problem.instance.x0.copy()
        while True:
            way = rng.normal(size=3) * [1.0, 1.0, 0.3]
            x0[POSITION] = problem.instance.x0[POSITION] + _JUMP * way / np.linalg.norm(way)
            if x0[2] > _LOWEST and not in_reach(problem, x0[None, POSITION]):
                break
        instance = replace(problem.instance, x0=x0)
        result.append(Problem("cold_start", problem.structure, instance, None))
    return result


def _spread(indices: np.ndarray, count: int) -> np.ndarray:
    wanted = np.linspace(0, len(indices) - 1, min(count, len(indices)))
    return indices[np.unique(wanted.round().astype(int))]
