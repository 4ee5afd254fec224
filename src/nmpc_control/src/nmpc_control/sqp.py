# SPDX-License-Identifier: MIT
"""The compiled backend: projected Newton with Riccati sweeps, every iterate feasible.

One iteration is a backward sweep (``riccati``: gradient, active bounds, Newton step with feedback)
and a rollout along it (``rollout``), shortened until the cost falls enough (Armijo), with Levenberg
damping where no length helps. Because dynamics and input bounds hold exactly at every iterate, the
cost itself is the merit function, and a solve cut off by its wall-time budget still returns a plan
that can be flown. The other inequalities enter by an augmented Lagrangian whose multipliers,
bounded by the weight of the L1 penalty, are updated whenever the inner iteration has converged.
"""

import time
from typing import Dict, Optional, Tuple

import numpy as np

from nmpc_control.augmented import MAXIMA, SUMS
from nmpc_control.compiled_function import Buffered
from nmpc_control.newton_step import Step, StepModel, left_to_gain
from nmpc_control.ocp import PARTS, Instance, Structure
from nmpc_control.riccati import NZ
from nmpc_control.solution import Guess, Solution, cold_guess, no_solution, worst_violation
from nmpc_control.state import NU, NX, YAW
from nmpc_control.sweeps import compiled

_ARMIJO = 1e-4
_LEAST_PIVOT = 1e-6
_SHORTEST_STEP = 1.0 / 64.0
_LESS, _MORE = 0.5, 1.3  # times its promise: what a step brings so that another length is tried
_LEAST_DAMPING = 1e-8  # keeps the recursion regular where inputs cost nothing
_FIRST_ACCURACY = 1e-3  # relative decrease below which the multipliers are first updated
_NO_EXCESS = 1e-6  # [m], [m/s] a smaller move of the multipliers, as an excess, is none
_SLOW = 0.25  # of the last move of the multipliers: if one is larger, the bounds get stiffer
_STIFFER, _STIFFEST = 5.0, 1e4
_ROUNDING = 1e-10  # a smaller promise, relative, is rounding
_BAD_GUESS = 2.0  # times the cost that the guess had where it comes from
_SHOWN = 2e-3  # [m], [m/s] by which a softened bound must be exceeded to be reported


class SqpSolver:
    """Solver of one problem structure; call ``solve`` from one thread at a time.

    Args:
        structure: of the problem.
        tolerance: [1] part of the cost (plus 1) that may be left to gain.
        max_iterations: Newton steps at most.
        time_budget: [s] wall time after which no further step is begun.
        warm_iterations: the same from a good guess; None: as many.
    """

    def __init__(
        self,
        structure: Structure,
        tolerance: float,
        max_iterations: int,
        time_budget: float,
        warm_iterations: Optional[int] = None,
    ) -> None:
        self.structure = structure
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.warm_iterations = min(max_iterations, warm_iterations or max_iterations)
        self.time_budget = time_budget
        self._arrays: Dict[str, np.ndarray] = {}
        calls = {name: Buffered(f, self._arrays) for name, f in compiled(structure).items()}
        self._backward, self._backward_exact = calls["backward"], calls["backward_exact"]
        self._forward, self._settle = calls["forward"], calls["settle"]
        self._tracking, self._penalties = np.inf, 0.0  # cost of the iterate
        self._alpha = 1.0  # the last step's length
        self._forced = False  # whether any multiplier is not zero

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution from a guess; a useless one counts as none.

        Args:
            instance: the numbers of the problem.
            guess: e.g. the last solution, shifted; None: from hover or toward the reference,
                whichever is better.
        """
        start = time.perf_counter()
        a = self._arrays
        a["x0"][:, 0], a["u_before"][:, 0] = instance.x0, instance.u_before
        a["stages"][:], a["theta"][:, 0] = instance.stages, instance.theta
        self._alpha = 1.0
        cost, model, most = self._begin(instance, guess)
        accuracy, before = _FIRST_ACCURACY, np.inf
        iterations, status, step = 0, "budget", Step(np.inf, -np.inf, np.inf, 0, False)
        while np.isfinite(cost):
            if iterations >= most or time.perf_counter() - start > self.time_budget:
                break
            step = self._direction(model)
            scale = 1.0 + self._tracking
            if not np.isfinite(step.promise):
                if model.exhausted:
                    status = "stalled"
                    break
                model.failed()
                continue
            left, stationary = step.to_gain / scale, step.residual <= self.tolerance
            is_enough = left <= self.tolerance
            if left > _ROUNDING and not stationary:  # also where it is enough: the step is there
                iterations += 1
                new_cost, alpha = self._search(cost, step)
                if new_cost is None and not is_enough:
                    if model.exhausted:
                        status = "stalled"
                        break
                    model.failed()
                    continue
                if new_cost is not None:
                    full = alpha == 1.0 and model.damping == 0.0
                    after = left_to_gain(step, cost - new_cost) / scale if full else np.inf
                    left = min(left, after) if is_enough else after
                    model.succeeded((cost - new_cost) / scale)
                    cost = new_cost
            if left <= accuracy or stationary:
                gap, moved, cost = self._update_multipliers(cost)
                is_exact = gap <= self.tolerance * scale or moved <= _NO_EXCESS
                if is_exact and (left <= self.tolerance or stationary):
                    status = "converged"
                    break
                accuracy = max(self.tolerance, 0.0 if is_exact else accuracy / 10.0)
                if not is_exact and moved > _SLOW * before:
                    cost = self._stiffen()
                before = moved
        if not np.isfinite(cost):
            return no_solution(instance.x0, self.structure.horizon, "failed")
        violation, softened, objective = self._statement()
        return Solution(
            found=True,
            status=status,
            states=a["X"].T.copy(),
            inputs=a["U"].T.copy(),
            cost=objective,
            iterations=iterations,
            kkt_residual=step.residual,
            active_bounds=step.active,
            solve_time=time.perf_counter() - start,
            violation=violation,
            softened=softened,
            gains=a["gains"].T.reshape(-1, NZ, NU).copy(),
            multipliers=a["multipliers"].T.copy(),
        )

    def _begin(self, instance: Instance, guess: Optional[Guess]) -> Tuple[float, StepModel, int]:
        """Set the first iterate; return its cost, the first model and the most iterations."""
        trials = []
        if guess is not None and np.all(np.isfinite(guess.inputs)):
            self._load(guess.states, guess.inputs, guess.gains, guess.multipliers)
            cost = self._evaluate(0.0)
            if cost <= _BAD_GUESS * (1.0 + guess.cost):
                self._accept()
                warm = guess.gains is not None
                return cost, StepModel(warm), self.warm_iterations if warm else self.max_iterations
            trials.append(self._trial(cost))
        hover = cold_guess(instance.x0, self.structure.horizon)
        self._load(hover.states, hover.inputs)
        trials.append(self._trial(self._evaluate(0.0)))
        # toward the reference, under the feedback law of the problem linearised there
        states = instance.stages[:NX].T.copy()
        states[:, YAW] = np.unwrap(np.r_[instance.x0[YAW], states[:, YAW]])[1:]
        self._load(states, instance.stages[NX : NX + NU, :-1].T)
        self._direction(StepModel(newton=False))
        for alpha in (0.0, 1.0):
            trials.append(self._trial(self._evaluate(alpha)))
        trials = [trial for trial in trials if np.isfinite(trial[0])]
        if not trials:
            return np.inf, StepModel(False), 0
        _, X, U = min(trials, key=lambda trial: trial[0])
        self._load(X, U)
        cost = self._evaluate(0.0)
        self._accept()
        return cost, StepModel(False), self.max_iterations

    def _load(
        self,
        states: np.ndarray,
        inputs: np.ndarray,
        gains: Optional[np.ndarray] = None,
        multipliers: Optional[np.ndarray] = None,
    ) -> None:
        """Set the iterate that the sweeps start from."""
        a = self._arrays
        a["X"][:], a["U"][:] = states.T, inputs.T
        a["step"][:] = 0.0
        a["gains"][:] = 0.0 if gains is None else gains.reshape(-1, NU).T
        a["multipliers"][:] = 0.0 if multipliers is None else multipliers.T
        self._forced = multipliers is not None and bool(multipliers.any())

    def _evaluate(self, alpha: float) -> float:
        """Roll out under the law with a step length; return the augmented cost."""
        self._arrays["alpha"][0, 0] = alpha
        self._forward()
        return float(self._arrays["cost"].sum())

    def _trial(self, cost: float) -> Tuple[float, np.ndarray, np.ndarray]:
        return cost, self._arrays["X_new"].T.copy(), self._arrays["U_new"].T.copy()

    def _direction(self, model: StepModel) -> Step:
        """Compute step and gains, by the exact Hessian if that is wanted and positive."""
        self._arrays["damping"][0, 0] = max(model.damping, _LEAST_DAMPING)
        self._arrays["clamping"][0, 0] = 1.0
        if model.newton:
            self._backward_exact()
            step = self._step(exact=True)
            if step.pivot > _LEAST_PIVOT and step.descends(self.tolerance):
                model.refusals = 0
                return step
            model.refused()
        self._backward()
        step = self._step()
        if step.descends(self.tolerance):
            return step
        # sent to bounds one by one, inputs can together do harm: then only hold those on one
        self._arrays["clamping"][0, 0] = 0.0
        self._backward()
        return self._step()

    def _step(self, exact: bool = False) -> Step:
        slope, promise, residual, active, pivot, changed = self._arrays["summary"][:, 0].tolist()
        return Step(promise, slope, residual, int(active), changed > 0, exact, pivot)

    def _search(self, cost: float, step: Step) -> Tuple[Optional[float], float]:
        """Take the longest of the tried steps that lowers the cost enough.

        One that brings much less than promised is compared with half of it (between pieces of the
        potential, full steps can go to and fro), one that brings more with its double (around an
        obstacle the convex model sees too much curvature). Returns the new cost, None when there is
        none, and the step's length.
        """
        alpha = min(1.0, 2.0 * self._alpha)
        new_cost = self._evaluate(alpha)
        while not new_cost <= cost + _ARMIJO * alpha * step.slope:
            alpha /= 2.0
            if alpha < _SHORTEST_STEP:
                self._alpha = 1.0
                return None, alpha
            new_cost = self._evaluate(alpha)
        self._accept()
        gain = (cost - new_cost) / (alpha * step.promise)
        factor = 0.5 if gain < _LESS else 2.0
        while gain < _LESS or (gain > _MORE and alpha >= 1.0):
            other = self._evaluate(factor * alpha)
            if not other < new_cost:
                break
            self._accept()
            alpha, new_cost = factor * alpha, other
            gain = (cost - new_cost) / (alpha * step.promise)
        self._alpha = alpha
        return new_cost, alpha

    def _accept(self) -> None:
        a = self._arrays
        a["X"][:], a["U"][:] = a["X_new"], a["U_new"]
        self._tracking, self._penalties = a["cost"][:, 0].tolist()

    @property
    def _quiet(self) -> bool:
        """Whether no softened bound is felt at the iterate."""
        return self._penalties == 0.0 and not self._forced

    def _update_multipliers(self, cost: float) -> Tuple[float, float, float]:
        """Move the multipliers by the inequalities at the iterate.

        Returns by how much the L1 penalty exceeds what the new ones make of it, the largest move,
        as an excess, and the cost with the new ones.
        """
        if self._quiet:
            return 0.0, 0.0, cost
        a = self._arrays
        self._settle()
        a["multipliers"][:] = a["multipliers_new"]
        self._forced = bool(a["multipliers"].any())
        self._penalties = float(a["sums"][0, 0])
        gap = float(a["sums"][SUMS.index("gap"), 0])
        return gap, float(a["maxima"][0, 0]), self._tracking + self._penalties

    def _stiffen(self) -> float:
        """Raise the curvatures of the augmented Lagrangian; return the cost with them."""
        stiffness = self._arrays["theta"][PARTS["stiffness"]]
        stiffness[:] = np.minimum(stiffness * _STIFFER, _STIFFEST)
        cost = self._evaluate(0.0)
        self._accept()
        return cost

    def _statement(self) -> Tuple[float, str, float]:
        """Return the worst violation, its kind, and the problem's own cost at the iterate."""
        if self._quiet:
            return 0.0, "", self._tracking
        self._settle()
        worst = self._arrays["maxima"][1:, 0]
        violation, kind = worst_violation(worst[None], MAXIMA[1:], _SHOWN)
        return violation, kind, self._tracking + float(self._arrays["sums"][1, 0])
