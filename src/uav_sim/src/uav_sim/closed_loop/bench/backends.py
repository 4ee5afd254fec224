# SPDX-License-Identifier: MIT
"""The backends that are compared, each behind the same two calls."""

from typing import Any, Dict, Optional

from nmpc_control.ipopt import IpoptSolver
from nmpc_control.ocp import Structure
from nmpc_control.params import Parameters
from nmpc_control.solution import Solution
from nmpc_control.sqp import SqpSolver
from uav_sim.closed_loop.bench.paper_backend import PaperBackend
from uav_sim.closed_loop.bench.problem import Problem
from uav_sim.closed_loop.bench.recording import structure_of

TOLERANCE = 1e-9  # of "converged"
_IPOPT_TOLERANCE = 1e-6
_TIGHT = {"constr_viol_tol": 1e-9, "dual_inf_tol": 1e-6, "compl_inf_tol": 1e-9}
_LAST_STRAW = 60.0  # [s] for a solve that shall not be stopped


class Backend:
    """A solver of the project's own problem, started from the guess of the flight."""

    def __init__(self, solver: Any) -> None:
        self.solver = solver

    def prepare(self, problem: Problem) -> None:
        """Do what is not part of the solve."""

    def solve(self, problem: Problem) -> Solution:
        """Return the solution; this call is what is timed."""
        return self.solver.solve(problem.instance, problem.guess)


def budgeted(parameters: Parameters, structure: Optional[Structure] = None) -> SqpSolver:
    """Return the compiled solver as it flies."""
    budget = parameters.solver.compiled
    return SqpSolver(
        structure or structure_of(parameters),
        budget.tolerance,
        budget.max_iterations,
        budget.time_budget,
    )


def converged(structure: Structure) -> SqpSolver:
    """Return the compiled solver to a tight tolerance, as long as it takes."""
    return SqpSolver(structure, TOLERANCE, 500, _LAST_STRAW)


def ipopt(structure: Structure) -> IpoptSolver:
    """Return IPOPT on the same problem object, as long as it takes."""
    return IpoptSolver(structure, _IPOPT_TOLERANCE, 500, _LAST_STRAW)


def tight_ipopt(structure: Structure, near: bool = False) -> IpoptSolver:
    """Return IPOPT as the yardstick; ``near``: for a start that is a solution already."""
    options = dict(_TIGHT, mu_strategy="monotone", mu_init=1e-7) if near else _TIGHT
    return IpoptSolver(structure, 1e-9, 1000, _LAST_STRAW, options)


def all_backends(parameters: Parameters) -> Dict[str, Backend]:
    """Return the backends by name."""
    structure = structure_of(parameters)
    return {
        "budgeted": Backend(budgeted(parameters)),
        "converged": Backend(converged(structure)),
        "ipopt": Backend(ipopt(structure)),
        "paper": PaperBackend(parameters),
    }
