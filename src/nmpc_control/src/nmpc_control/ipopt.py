# SPDX-License-Identifier: MIT
"""The IPOPT backend: the same problem by multiple shooting, the paper's method and the tests' oracle."""

import time
from typing import Any, Dict, Optional

import casadi as ca
import numpy as np

from nmpc_control.ocp import THETA_SIZE, Instance, Structure, Symbols, next_state, stage_cost
from nmpc_control.solution import Guess, Solution, cold_guess
from nmpc_control.state import NU, NX


class IpoptSolver:
    """Solver of one problem structure with IPOPT and MUMPS."""

    def __init__(
        self,
        structure: Structure,
        tolerance: float,
        max_iterations: int,
        time_budget: float,
        options: Optional[Dict[str, Any]] = None,
    ) -> None:
        self.structure = structure
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": max_iterations,
            "max_wall_time": time_budget,
            "warm_start_init_point": "yes",
            "mu_strategy": "adaptive",
            **(options or {}),
        }
        self._solver = ca.nlpsol("nmpc", "ipopt", _transcribe(structure), {"print_time": False, "ipopt": ipopt})

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution from a guess, or from hover where there is none."""
        start = time.perf_counter()
        N = self.structure.horizon
        guess = guess or cold_guess(instance.x0, N)
        lower, upper = np.full(N * (NX + NU) + NX, -np.inf), np.full(N * (NX + NU) + NX, np.inf)
        free_states = N * NX + NX
        lower[:NX] = upper[:NX] = instance.x0
        lower[free_states:], upper[free_states:] = np.tile(instance.input_min, N), np.tile(instance.input_max, N)
        parameters = np.concatenate([instance.u_before, instance.theta, instance.stages.ravel(order="F")])
        result = self._solver(
            x0=np.concatenate([guess.states.ravel(), guess.inputs.ravel()]),
            lbx=lower, ubx=upper, lbg=0.0, ubg=0.0, p=parameters,
        )
        stats = self._solver.stats()
        z = np.asarray(result["x"]).ravel()
        inputs = z[free_states:].reshape(N, NU)
        multipliers = np.asarray(result["lam_x"]).ravel()[free_states:]
        defect = float(np.max(np.abs(np.asarray(result["g"]))))
        status = str(stats["return_status"])
        return Solution(
            found=bool(np.all(np.isfinite(z)) and defect < 1e-3),
            status="converged" if stats["success"] else status,
            states=z[:free_states].reshape(N + 1, NX),
            inputs=np.clip(inputs, instance.input_min, instance.input_max),
            cost=float(result["f"]),
            iterations=int(stats["iter_count"]),
            kkt_residual=max(defect, float(stats["iterations"]["inf_du"][-1]) if stats["iter_count"] >= 0 else np.inf),
            active_bounds=int(np.sum(np.abs(multipliers) > 1e-4)),
            solve_time=time.perf_counter() - start,
        )


def _transcribe(structure: Structure) -> Dict[str, ca.SX]:
    N = structure.horizon
    s = Symbols(structure)
    step = ca.Function("step", [s.x, s.u, s.theta], [next_state(structure, s)])
    inner = ca.Function("l", [s.x, s.u, s.u_before, s.stage, s.theta], [stage_cost(structure, s, False)])
    last = ca.Function("l_N", [s.x, s.stage, s.theta], [stage_cost(structure, s, True)])
    X, U = ca.SX.sym("X", NX, N + 1), ca.SX.sym("U", NU, N)
    u_before, theta = ca.SX.sym("u_before", NU), ca.SX.sym("theta", THETA_SIZE)
    stages = ca.SX.sym("stages", structure.stage_size, N + 1)
    cost, defects = last(X[:, N], stages[:, N], theta), []
    for k in range(N):
        before = U[:, k - 1] if k else u_before
        cost += inner(X[:, k], U[:, k], before, stages[:, k], theta)
        defects.append(X[:, k + 1] - step(X[:, k], U[:, k], theta))
    return {
        "x": ca.vertcat(ca.vec(X), ca.vec(U)),
        "f": cost,
        "g": ca.vertcat(*defects),
        "p": ca.vertcat(u_before, theta, ca.vec(stages)),
    }
