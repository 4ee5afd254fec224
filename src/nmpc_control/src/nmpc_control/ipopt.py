# SPDX-License-Identifier: MIT
"""The IPOPT backend: multiple shooting, the paper's method and the tests' oracle."""

import time
from typing import Any, Dict, Optional

import casadi as ca
import numpy as np

from nmpc_control import constraints
from nmpc_control.ocp import (
    PARTS,
    THETA_SIZE,
    Instance,
    Structure,
    Symbols,
    inequalities,
    next_state,
    stage_cost,
)
from nmpc_control.solution import Guess, Solution, cold_guess, worst_violation
from nmpc_control.state import NU, NX

_FEASIBLE = 1e-3  # [state or input unit] violation of hard constraints that can be flown
_SHOWN = 2e-3  # [m], [m/s] by which a softened bound must be exceeded to be reported


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
        self._kinds = constraints.rows(structure.obstacle_slots)
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": max_iterations,
            "max_wall_time": time_budget,
            "warm_start_init_point": "yes",
            "mu_strategy": "adaptive",
            "bound_relax_factor": 0.0,  # relaxed slacks would pay for themselves in the cost
            **(options or {}),
        }
        self._solver = ca.nlpsol(
            "nmpc", "ipopt", _transcribe(structure), {"print_time": False, "ipopt": ipopt}
        )

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution from a guess, or from hover where there is none."""
        start = time.perf_counter()
        N = self.structure.horizon
        guess = guess or cold_guess(instance.x0, N)
        free_states, slacks = N * NX + NX, N * (NX + NU) + NX
        count = self.structure.inequalities * (N + 1)
        lower, upper = np.full(slacks + count, -np.inf), np.full(slacks + count, np.inf)
        lower[:NX] = upper[:NX] = instance.x0
        lower[free_states:slacks], upper[free_states:slacks] = (
            np.tile(instance.input_min, N),
            np.tile(instance.input_max, N),
        )
        lower[slacks:] = 0.0
        parameters = np.concatenate(
            [instance.u_before, instance.theta, instance.stages.ravel(order="F")]
        )
        result = self._solver(
            x0=np.concatenate([guess.states.ravel(), guess.inputs.ravel(), np.zeros(count)]),
            lbx=lower,
            ubx=upper,
            lbg=np.concatenate([np.zeros(N * NX), np.full(count + 2 * NU * N, -np.inf)]),
            ubg=0.0,
            p=parameters,
        )
        stats = self._solver.stats()
        z = np.asarray(result["x"]).ravel()
        inputs = z[free_states:slacks].reshape(N, NU)
        multipliers = np.asarray(result["lam_x"]).ravel()[free_states:slacks]
        g = np.asarray(result["g"]).ravel()
        defect = float(np.max(np.abs(g[: N * NX])))
        excess = z[slacks:].reshape(N + 1, self.structure.inequalities)
        too_fast = float(np.max(g[N * NX + count :]))
        violation, softened = worst_violation(excess, self._kinds, _SHOWN)
        status = str(stats["return_status"])
        return Solution(
            found=bool(np.all(np.isfinite(z)) and max(defect, too_fast) < _FEASIBLE),
            status="converged" if stats["success"] else status,
            states=z[:free_states].reshape(N + 1, NX),
            inputs=np.clip(inputs, instance.input_min, instance.input_max),
            cost=float(result["f"]),
            iterations=int(stats["iter_count"]),
            kkt_residual=max(
                defect,
                float(stats["iterations"]["inf_du"][-1]) if stats["iter_count"] >= 0 else np.inf,
            ),
            active_bounds=int(np.sum(np.abs(multipliers) > 1e-4)),
            solve_time=time.perf_counter() - start,
            violation=violation,
            softened=softened,
        )


def _transcribe(structure: Structure) -> Dict[str, ca.SX]:
    N = structure.horizon
    s = Symbols(structure)
    step = ca.Function("step", [s.x, s.u, s.theta], [next_state(structure, s)])
    inner = ca.Function(
        "l", [s.x, s.u, s.u_before, s.stage, s.theta], [stage_cost(structure, s, False)]
    )
    last = ca.Function("l_N", [s.x, s.stage, s.theta], [stage_cost(structure, s, True)])
    bounds = ca.Function("g", [s.x, s.stage, s.theta], [inequalities(structure, s)])
    X, U = ca.SX.sym("X", NX, N + 1), ca.SX.sym("U", NU, N)
    u_before, theta = ca.SX.sym("u_before", NU), ca.SX.sym("theta", THETA_SIZE)
    stages = ca.SX.sym("stages", structure.stage_size, N + 1)
    slack = ca.SX.sym("slack", structure.inequalities * (N + 1))
    soft_weight = theta[PARTS["soft_weight"]]
    cost = last(X[:, N], stages[:, N], theta) + soft_weight * ca.sum1(slack)
    largest_step = structure.dt * theta[PARTS["input_rate"]]
    defects, g, rates = [], [], []
    for k in range(N):
        before = U[:, k - 1] if k else u_before
        cost += inner(X[:, k], U[:, k], before, stages[:, k], theta)
        defects.append(X[:, k + 1] - step(X[:, k], U[:, k], theta))
        rates += [U[:, k] - before - largest_step, before - U[:, k] - largest_step]
    for k in range(N + 1):
        g.append(bounds(X[:, k], stages[:, k], theta))
    return {
        "x": ca.vertcat(ca.vec(X), ca.vec(U), slack),
        "f": cost,
        "g": ca.vertcat(*defects, ca.vertcat(*g) - slack, *rates),
        "p": ca.vertcat(u_before, theta, ca.vec(stages)),
    }
