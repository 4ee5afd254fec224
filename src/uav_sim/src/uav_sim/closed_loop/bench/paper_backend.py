# SPDX-License-Identifier: MIT
"""The paper's formulation on the states, references and obstacles of recorded problems."""

from typing import Dict, Optional, Tuple

import numpy as np

from nmpc_control.ocp import SLOT_SIZE, Instance
from nmpc_control.params import Parameters
from nmpc_control.solution import Solution
from nmpc_control.state import NU, NX
from uav_sim.closed_loop.bench.paper_formulation import (
    DT,
    FORCE,
    INPUT_MAX,
    INPUT_MIN,
    MASS,
    N,
    PaperFormulation,
    PaperGuess,
    PaperSolution,
    hover_guess,
)
from uav_sim.closed_loop.bench.problem import Problem

_TIGHT = {"tol": 1e-9, "acceptable_iter": 0, "max_iter": 1000}


class PaperBackend:
    """Solves with as many spheres as the recorded problem has, which is what the paper's code does.

    Its warm start is its own: the shifted, fully converged solution of the problem one stage
    before; hover after a cold start.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._margin = parameters.vehicle.radius + parameters.avoidance.safety_distance
        self._formulations: Dict[Tuple[int, bool], PaperFormulation] = {}
        self._problem: Optional[Problem] = None
        self._guess: Optional[PaperGuess] = None

    def prepare(self, problem: Problem) -> None:
        """Compute the warm start of a problem, and build its graph if need be."""
        self._problem, self._guess = problem, hover_guess(problem.instance.x0)
        if problem.earlier is not None:
            start = hover_guess(problem.earlier.x0)
            self._guess = self._run(problem.earlier, start, tight=True).shifted()
        self._formulation(len(self._spheres(problem.instance)), tight=False)

    def solve(self, problem: Problem, tight: bool = False) -> Solution:
        """Return the solution of the problem that was prepared."""
        if problem is not self._problem:
            raise ValueError("the problem was not prepared")
        solution = self._run(problem.instance, self._guess, tight)
        inputs = solution.inputs.copy()
        inputs[:, 0] *= FORCE / MASS
        outside = (solution.inputs <= INPUT_MIN + 1e-6) | (solution.inputs >= INPUT_MAX - 1e-6)
        return Solution(
            found=solution.success,
            status="converged" if solution.success else solution.status,
            states=solution.states,
            inputs=inputs,
            cost=solution.cost,
            iterations=solution.iterations,
            kkt_residual=solution.defect,
            active_bounds=int(np.sum(outside)),
            solve_time=solution.solve_time,
        )

    def _run(self, instance: Instance, guess: PaperGuess, tight: bool) -> PaperSolution:
        spheres = self._spheres(instance)
        stages = instance.stages[:3].T
        times = np.linspace(0.0, N * DT, N)
        at = DT * np.arange(len(stages))
        reference = np.stack([np.interp(times, at, stages[:, i]) for i in range(3)], axis=1)
        return self._formulation(len(spheres), tight).solve(instance.x0, reference, spheres, guess)

    def _formulation(self, count: int, tight: bool) -> PaperFormulation:
        key = (count, tight)
        if key not in self._formulations:
            self._formulations[key] = PaperFormulation(count, _TIGHT if tight else None)
        return self._formulations[key]

    def _spheres(self, instance: Instance) -> np.ndarray:
        """Return the spheres (n, 4) in the obstacle slots, centre and radius [m]."""
        slots = instance.stages[NX + NU :, 0].reshape(-1, SLOT_SIZE)
        radius = 1.0 / slots[:, 4] - self._margin
        return np.column_stack([slots[:, :3], radius])[radius > 0.0]
