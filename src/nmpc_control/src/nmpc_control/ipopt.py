# SPDX-License-Identifier: MIT
"""The IPOPT backend: multiple shooting, the paper's method and the tests' oracle."""

import time
from typing import Any, Dict, List, Optional

import casadi as ca
import numpy as np

from nmpc_control import constraints
from nmpc_control.errors import ConfigError
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
from nmpc_control.solution import Guess, Solution, cold_guess, no_solution, worst_violation
from nmpc_control.state import NU, NX

_FEASIBLE = 1e-3  # [state or input unit] violation of hard constraints that can be flown
_SHOWN = 2e-3  # [m], [m/s] by which a softened bound must be exceeded to be reported
_AXES = 3


class IpoptSolver:
    """Solver of one problem structure with IPOPT.

    The L1 penalty is posed with as few slack variables as it needs: one for the speed, one for each
    axis of the fence, of which both faces cannot be exceeded at once, and one per obstacle only
    where Eq. 7 is an inequality.
    """

    def __init__(
        self,
        structure: Structure,
        tolerance: float,
        max_iterations: int,
        time_budget: float,
        options: Optional[Dict[str, Any]] = None,
        linear_solver: str = "mumps",
    ) -> None:
        """Build the problem with and without Eq. 7, so that no solve has to wait for it.

        Raises:
            ConfigError: IPOPT cannot load the linear solver.
        """
        self.structure = structure
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": max_iterations,
            "max_wall_time": time_budget,
            "warm_start_init_point": "yes",
            "mu_strategy": "adaptive",
            "bound_relax_factor": 0.0,  # relaxed slacks would pay for themselves in the cost
            "linear_solver": linear_solver,
            **(options or {}),
        }
        require(linear_solver)
        self._solvers = {
            hard: ca.nlpsol(
                "nmpc", "ipopt", transcribe(structure, hard), {"print_time": False, "ipopt": ipopt}
            )
            for hard in (False, True)
        }

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution from a guess, or from hover where there is none or it is useless."""
        start = time.perf_counter()
        N = self.structure.horizon
        if not np.all(np.isfinite(np.concatenate([instance.x0, instance.u_before]))):
            return no_solution(instance.x0, N, "failed")
        if guess is None or not np.all(np.isfinite(np.hstack([guess.states[:-1], guess.inputs]))):
            guess = cold_guess(instance.x0, N)
        hard = bool(instance.theta[PARTS["hard_obstacles"]][0])
        kinds = slack_kinds(self.structure, hard)
        free_states, slacks = N * NX + NX, N * (NX + NU) + NX
        count = len(kinds) * (N + 1)
        solver = self._solvers[hard]
        lower, upper = np.full(slacks + count, -np.inf), np.full(slacks + count, np.inf)
        lower[:NX] = upper[:NX] = instance.x0
        lower[free_states:slacks], upper[free_states:slacks] = (
            np.tile(instance.input_min, N),
            np.tile(instance.input_max, N),
        )
        lower[slacks:] = 0.0
        softened_rows = solver.size1_in("lbg") - N * (NX + NU)
        largest_steps = np.tile(self.structure.dt * instance.theta[PARTS["input_rate"]], N)
        least_changes, greatest_changes = -largest_steps, largest_steps.copy()
        # from an input outside its bounds, the way back may be longer than the rate allows
        back = instance.input_max - instance.u_before, instance.input_min - instance.u_before
        least_changes[:NU] = np.minimum(least_changes[:NU], back[0])
        greatest_changes[:NU] = np.maximum(greatest_changes[:NU], back[1])
        parameters = np.concatenate(
            [instance.u_before, instance.theta, instance.stages.ravel(order="F")]
        )
        result = solver(
            x0=np.concatenate([guess.states.ravel(), guess.inputs.ravel(), np.zeros(count)]),
            lbx=lower,
            ubx=upper,
            lbg=np.concatenate([np.zeros(N * NX), least_changes, np.full(softened_rows, -np.inf)]),
            ubg=np.concatenate([np.zeros(N * NX), greatest_changes, np.zeros(softened_rows)]),
            p=parameters,
        )
        stats = solver.stats()
        z = np.asarray(result["x"]).ravel()
        if not np.all(np.isfinite(z)) or "iterations" not in stats:
            return no_solution(instance.x0, N, str(stats["return_status"]))
        inputs = z[free_states:slacks].reshape(N, NU)
        multipliers = np.asarray(result["lam_x"]).ravel()[free_states:slacks]
        g = np.asarray(result["g"]).ravel()
        defect = float(np.max(np.abs(g[: N * NX])))
        changes = g[N * NX : N * (NX + NU)]
        too_fast = float(np.max(np.maximum(changes - greatest_changes, least_changes - changes)))
        violation, softened = worst_violation(z[slacks:].reshape(N + 1, -1), kinds, _SHOWN)
        status = str(stats["return_status"])
        return Solution(
            found=bool(max(defect, too_fast) < _FEASIBLE),
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


def require(linear_solver: str) -> None:
    """Raise ConfigError where IPOPT has no such linear solver; HSL is a library of the user's."""
    x = ca.SX.sym("x")
    options = {"print_level": 0, "sb": "yes", "linear_solver": linear_solver}
    try:
        probe = ca.nlpsol(
            "probe", "ipopt", {"x": x, "f": x**2}, {"print_time": False, "ipopt": options}
        )
        probe(x0=1.0)
        loaded = bool(probe.stats()["success"])
    except RuntimeError:
        loaded = False
    if not loaded:
        raise ConfigError(
            "controller.yaml",
            "solver.linear_solver",
            linear_solver,
            "a solver that IPOPT can load: mumps, or for ma27 and ma57 an installed libhsl.so",
        )


def slack_kinds(structure: Structure, hard: bool) -> List[str]:
    """Return what the slack variables of a stage stand for; ``hard``: Eq. 7 is an inequality."""
    obstacles = [constraints.OBSTACLE] * structure.obstacle_slots if hard else []
    return [constraints.SPEED] + [constraints.FENCE] * _AXES + obstacles


def transcribe(structure: Structure, hard: bool) -> Dict[str, ca.SX]:
    """Return the problem by multiple shooting; ``hard``: with Eq. 7 as softened inequality.

    Unknowns are the states, the inputs and the slacks, stage by stage; constraints are the
    dynamics, the changes of the inputs and the softened inequalities; parameters are the input
    before, theta and the stage data.
    """
    N = structure.horizon
    s = Symbols(structure)
    step = ca.Function("step", [s.x, s.u, s.theta], [next_state(structure, s)])
    inner = ca.Function(
        "l", [s.x, s.u, s.u_before, s.stage, s.theta], [stage_cost(structure, s, False)]
    )
    last = ca.Function("l_N", [s.x, s.stage, s.theta], [stage_cost(structure, s, True)])
    bounds = ca.Function("g", [s.x, s.stage, s.theta], [inequalities(structure, s)])
    slack_of = _slack_of(structure, hard)
    X, U = ca.SX.sym("X", NX, N + 1), ca.SX.sym("U", NU, N)
    u_before, theta = ca.SX.sym("u_before", NU), ca.SX.sym("theta", THETA_SIZE)
    stages = ca.SX.sym("stages", structure.stage_size, N + 1)
    slack = ca.SX.sym("slack", len(slack_kinds(structure, hard)), N + 1)
    weight = {kind: theta[PARTS["soft_weight"]] for kind in (constraints.SPEED, constraints.FENCE)}
    weight[constraints.OBSTACLE] = theta[PARTS["obstacle_weight"]]
    weights = ca.vertcat(*[weight[kind] for kind in slack_kinds(structure, hard)])
    cost = last(X[:, N], stages[:, N], theta) + ca.dot(weights, ca.sum2(slack))
    defects, changes, softened = [], [], []
    for k in range(N):
        before = U[:, k - 1] if k else u_before
        cost += inner(X[:, k], U[:, k], before, stages[:, k], theta)
        defects.append(X[:, k + 1] - step(X[:, k], U[:, k], theta))
        changes.append(U[:, k] - before)
    for k in range(N + 1):
        g = bounds(X[:, k], stages[:, k], theta)
        softened += [g[row] - slack[i, k] for row, i in slack_of.items()]
    return {
        "x": ca.vertcat(ca.vec(X), ca.vec(U), ca.vec(slack)),
        "f": cost,
        "g": ca.vertcat(*defects, *changes, *softened),
        "p": ca.vertcat(u_before, theta, ca.vec(stages)),
    }


def _slack_of(structure: Structure, hard: bool) -> Dict[int, int]:
    """Return which slack softens which row of ``inequalities``; the rest is left out."""
    kinds = constraints.rows(structure.obstacle_slots)
    chosen = {}
    for kind, first, period in (
        (constraints.SPEED, 0, 1),
        (constraints.FENCE, 1, _AXES),
        (constraints.OBSTACLE, 1 + _AXES, max(1, structure.obstacle_slots)),
    ):
        if kind == constraints.OBSTACLE and not hard:
            continue
        rows = [row for row, other in enumerate(kinds) if other == kind]
        chosen.update({row: first + i % period for i, row in enumerate(rows)})
    return chosen
