# SPDX-License-Identifier: MIT
"""Problems that the backends are compared on: recorded from closed loops, or drawn at random.

While recording, a solver without wall-time budget flies, so that the problems do not depend on the
machine's load.
"""

from dataclasses import replace
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.ocp import SLOT_SIZE, Structure
from nmpc_control.params import Parameters, load_parameters
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.sqp import SqpSolver
from nmpc_control.state import NU, NX, POSITION
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.scenes import scatter
from uav_sim.closed_loop.loop import ClosedLoop, Log, fly
from uav_sim.closed_loop.simulate import new_loop

PLANT = "dji_hil"
KINDS = ("hexagon", "multi_obstacle", "obstacles_32", "push", "cold_start")

_PUSH = 3.0  # [m/s] sudden change of the velocity
_PUSHES_AT = (0.15, 0.35, 0.55, 0.75)  # part of the trajectory's time
_AFTER_PUSH = 2.0  # [s] of flight that counts as its consequence
_JUMP = 5.0  # [m] sudden change of the position


def structure_of(parameters: Parameters) -> Structure:
    """Return the structure of the problem that these parameters pose."""
    p = parameters.solver
    return Structure(p.horizon, p.dt, p.integrator, p.obstacle_slots)


def exact_solver(structure: Structure, tolerance: float = 1e-3) -> SqpSolver:
    """Return the compiled solver without budget."""
    return SqpSolver(structure, tolerance, 200, 30.0)


def record(
    scenario: Scenario, parameters: Parameters, solver: Any, pushes_seed: Optional[int] = None
) -> Tuple[Recorder, ClosedLoop, Log, List[int]]:
    """Fly a scenario from its initial position.

    Args:
        scenario: what to fly.
        parameters: of the controller.
        solver: what flies.
        pushes_seed: of the directions in which the aircraft is pushed in mid-flight; None: it is not.

    Returns:
        What was posed and solved, the loop, its log, and the indices of the first problems after a push.
    """
    loop = new_loop(scenario, parameters, PLANT)
    recorder = Recorder(solver)
    loop.controller.nmpc.solver = recorder
    rng, pushed = np.random.default_rng(pushes_seed), []

    def push(progress: float) -> None:
        due = pushes_seed is not None and len(pushed) < len(_PUSHES_AT)
        if due and progress >= _PUSHES_AT[len(pushed)]:
            direction = rng.normal(size=3) * [1.0, 1.0, 0.3]
            plant = loop.aircraft.plant
            plant.velocity = tuple(plant.velocity + _PUSH * direction / np.linalg.norm(direction))
            pushed.append(len(recorder.instances))

    log = fly(scenario, loop, on_progress=push)
    return recorder, loop, log, pushed


def recorded_problems(count: int, seed: int = 0) -> Dict[str, List[Problem]]:
    """Return about ``count`` problems of every kind, spread evenly over the flights."""
    result = {}
    flights = {
        "hexagon": (load_scenario("hexagon"), None),
        "multi_obstacle": (load_scenario("multi_obstacle"), None),
        "obstacles_32": (scatter(load_scenario("multi_obstacle"), 32, seed), None),
        "push": (load_scenario("multi_obstacle"), seed),
    }
    for kind, (scenario, pushes_seed) in flights.items():
        parameters = load_parameters(PLANT, scenario.weights)
        solver = exact_solver(structure_of(parameters))
        recorder, _, _, pushed = record(scenario, parameters, solver, pushes_seed)
        stride = round(parameters.solver.dt * parameters.solver.budget.rate)
        indices = np.arange(stride, len(recorder.instances))
        if pushed:
            after = round(_AFTER_PUSH * parameters.solver.budget.rate)
            indices = np.concatenate([np.arange(i, i + after) for i in pushed])
        result[kind] = recorder.problems(kind, stride, _spread(indices, count))
    warm = result["hexagon"] + result["multi_obstacle"]
    result["cold_start"] = cold_starts(
        [warm[i] for i in _spread(np.arange(len(warm)), count)], seed
    )
    return result


def cold_starts(problems: List[Problem], seed: int) -> List[Problem]:
    """Return the problems after a jump of the position in a random direction, to be solved from hover."""
    rng = np.random.default_rng(seed)
    result = []
    for problem in problems:
        x0 = problem.instance.x0.copy()
        while True:
            direction = rng.normal(size=3) * [1.0, 1.0, 0.3]
            x0[POSITION] = problem.instance.x0[POSITION] + _JUMP * direction / np.linalg.norm(
                direction
            )
            if not in_reach(problem, x0[None, POSITION]):
                break
        result.append(
            Problem("cold_start", problem.structure, replace(problem.instance, x0=x0), None)
        )
    return result


def in_reach(problem: Problem, positions: np.ndarray) -> bool:
    """Return whether the potential of any obstacle acts at positions (1 or N + 1, 3)."""
    slots = problem.instance.stages[NX + NU :].reshape(-1, SLOT_SIZE, problem.structure.horizon + 1)
    slots = slots[:, :, : len(positions)]
    offset = positions.T - slots[:, :3]
    squares = offset[:, 0] ** 2 + offset[:, 1] ** 2 + slots[:, 3] * offset[:, 2] ** 2
    return bool(np.any(np.sqrt(squares) * slots[:, 4] < 1.0))


def _spread(indices: np.ndarray, count: int) -> np.ndarray:
    return indices[
        np.unique(np.linspace(0, len(indices) - 1, min(count, len(indices))).round().astype(int))
    ]
