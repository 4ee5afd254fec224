# SPDX-License-Identifier: MIT
"""The compiled backend: projected Gauss-Newton with Riccati sweeps, every iterate feasible.

One iteration is a backward sweep (gradient, active bounds, Newton step with feedback; ``riccati``)
and a
rollout along it, shortened until the cost falls enough (Armijo), with Levenberg damping where no
length
helps. Because dynamics and bounds hold exactly at every iterate, the cost itself is the merit
function and
a solve cut off by its wall-time budget still returns a plan that can be flown. Inequalities beside
the input bounds
enter by an augmented Lagrangian whose multipliers, bounded by the weight of the L1 penalty, are
updated whenever the
inner iteration has converged.
"""

import logging
import time
from typing import Dict, Optional, Tuple

import numpy as np

from nmpc_control import constraints
from nmpc_control.compiled_function import Buffered, compile_functions
from nmpc_control.ocp import Instance, Structure
from nmpc_control.riccati import NZ, sweeps
from nmpc_control.solution import Guess, Solution, cold_guess, worst_violation
from nmpc_control.state import NU

LOGGER = logging.getLogger(__name__)
_ARMIJO = 1e-4
_NEWTON_REGION = 0.02  # relative change of the cost below which the exact Hessian is tried
_LEAST_PIVOT = 1e-6
_SHORTEST_STEP = 1.0 / 64.0
_DAMPING_FIRST, _DAMPING_FACTOR, _DAMPING_LAST = 1e-2, 10.0, 1e6
_DECREASE = (
    1e-3  # times tolerance: a smaller predicted change of the cost, relative, counts as none
)
_SHOWN = 2e-3  # [m], [m/s] by which a softened bound must be exceeded to be reported
_FIRST_ACCURACY = (
    1e-3  # predicted relative change of the cost at which the multipliers are first updated
)
_ROUNDING = 1e-9  # a smaller predicted change, relative, is rounding


class SqpSolver:
    """Solver of one problem structure; call ``solve`` from one thread at a time."""

    def __init__(
        self, structure: Structure, tolerance: float, max_iterations: int, time_budget: float
    ) -> None:
        self.structure = structure
        self.tolerance, self.max_iterations, self.time_budget = (
            tolerance,
            max_iterations,
            time_budget,
        )
        functions = compile_functions(sweeps(structure))
        self._arrays: Dict[str, np.ndarray] = {}
        self._backward = Buffered(functions["backward"], self._arrays)
        self._backward_exact = Buffered(functions["backward_exact"], self._arrays)
        self._forward = Buffered(functions["forward"], self._arrays)
        self._kinds = constraints.rows(structure.obstacle_slots)
        self._curvature = constraints.curvature(structure.obstacle_slots)[:, None]
        self._inequalities = np.zeros_like(self._arrays["inequalities"])

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution from a guess, or from hover where there is none or it is useless.

        Args:
            instance: the numbers of the problem.
            guess: e.g. the last solution, shifted.
        """
        start = time.perf_counter()
        a = self._arrays
        a["x0"][:, 0], a["u_before"][:, 0] = instance.x0, instance.u_before
        a["stages"][:], a["theta"][:, 0] = instance.stages, instance.theta
        cost = self._begin(guess, instance)
        damping, iterations, status, residual, active = 0.0, 0, "failed", np.inf, 0
        newton, accuracy, final = False, _FIRST_ACCURACY, _DECREASE * self.tolerance
        while np.isfinite(cost):
            slope, residual, active = self._direction(damping, newton)
            if residual <= self.tolerance or -slope <= accuracy * (1.0 + abs(cost)):
                moved = self._update_multipliers(instance.soft_weight)
                if moved <= self.tolerance and (residual <= self.tolerance or accuracy <= final):
                    status = "converged"
                    break
                accuracy = final if moved <= self.tolerance else max(final, accuracy / 10.0)
                if moved > 0.0:
                    cost = self._evaluate()
                    slope, residual, active = self._direction(damping, newton)
            if iterations >= self.max_iterations or time.perf_counter() - start > self.time_budget:
                status = "budget"
                break
            iterations += 1
            new_cost = self._search(cost, slope)
            if new_cost is not None:
                newton = cost - new_cost <= _NEWTON_REGION * (1.0 + abs(cost))
                cost, damping = (
                    new_cost,
                    damping / _DAMPING_FACTOR if damping > _DAMPING_FIRST else 0.0,
                )
            elif slope > -_ROUNDING * (1.0 + abs(cost)) or damping >= _DAMPING_LAST:
                status = "stalled"
                break
            else:
                damping, newton = max(damping * _DAMPING_FACTOR, _DAMPING_FIRST), False
        violation, softened = worst_violation(self._inequalities.T, self._kinds, _SHOWN)
        return Solution(
            found=bool(np.isfinite(cost)),
            status=status,
            states=a["X"].T.copy(),
            inputs=a["U"].T.copy(),
            cost=self._objective(cost, instance.soft_weight),
            iterations=iterations,
            kkt_residual=float(residual),
            active_bounds=int(active),
            solve_time=time.perf_counter() - start,
            violation=violation,
            softened=softened,
            gains=a["gains"].T.reshape(-1, NZ, NU).transpose(0, 2, 1).copy(),
            multipliers=a["multipliers"].T.copy(),
        )

    def _begin(self, guess: Optional[Guess], instance: Instance) -> float:
        """Roll the guess out from x0.

        Fall back to hover when that is not finite. Returns the cost.
        """
        a = self._arrays
        for warm in (True, False):
            candidate = guess if warm else cold_guess(instance.x0, self.structure.horizon)
            if candidate is None or not np.all(np.isfinite(candidate.inputs)):
                continue
            a["X"][:], a["U"][:] = candidate.states.T, candidate.inputs.T
            if candidate.gains is None:
                a["gains"][:] = 0.0
            else:
                a["gains"][:] = candidate.gains.transpose(0, 2, 1).reshape(-1, NU).T
            a["multipliers"][:] = 0.0 if candidate.multipliers is None else candidate.multipliers.T
            cost = self._evaluate()
            if np.isfinite(cost):
                self._accept()
                return cost
        return np.inf

    def _evaluate(self) -> float:
        """Return the cost of the present iterate, rolled out with its feedback."""
        self._arrays["alpha"][0, 0] = 0.0
        self._forward()
        return float(self._arrays["cost"][0, 0])

    def _objective(self, augmented: float, weight: float) -> float:
        """Return the problem's own cost.

        Tracking and potentials plus the L1 penalty on the inequalities.
        """
        g, mu = self._inequalities, self._curvature
        excess = np.maximum(0.0, g + self._arrays["multipliers"] / mu)
        linear = weight * excess - weight**2 / (2 * mu)
        penalty = np.where(mu * excess <= weight, mu / 2 * excess**2, linear)
        return float(augmented - np.sum(penalty) + weight * np.sum(np.maximum(0.0, g)))

    def _update_multipliers(self, weight: float) -> float:
        """Move the multipliers by the inequalities at the iterate.

        Returns the largest move, as an excess.
        """
        old = self._arrays["multipliers"]
        new = np.clip(old + self._curvature * self._inequalities, 0.0, weight)
        moved = float(np.max(np.abs(new - old) / self._curvature))
        old[:] = new
        return moved

    def _direction(self, damping: float, newton: bool) -> Tuple[float, float, int]:
        """Compute step and gains.

        Returns the slope along the step, projected gradient and active bounds.

        Near a solution (``newton``) the exact Hessian converges fast; where it is not positive,
        Gauss-Newton is used.
        """
        self._arrays["damping"][0, 0] = damping
        slope, residual, active, pivot = 0.0, np.inf, 0, 0.0
        if newton:
            self._backward_exact()
            slope, residual, active, pivot = self._arrays["summary"][:, 0]
        if not pivot > _LEAST_PIVOT or not slope <= 0.0:
            self._backward()
            slope, residual, active, _ = self._arrays["summary"][:, 0]
        return slope, residual, active

    def _search(self, cost: float, slope: float) -> Optional[float]:
        """Take the longest of the tried steps that lowers the cost enough.

        None when there is none.
        """
        alpha = 1.0
        while alpha >= _SHORTEST_STEP:
            self._arrays["alpha"][0, 0] = alpha
            self._forward()
            new_cost = float(self._arrays["cost"][0, 0])
            if new_cost <= cost + _ARMIJO * alpha * slope:
                self._accept()
                return new_cost
            alpha /= 2.0
        return None

    def _accept(self) -> None:
        a = self._arrays
        a["X"][:], a["U"][:] = a["X_new"], a["U_new"]
        self._inequalities[:] = a["inequalities"]
