# SPDX-License-Identifier: MIT
"""The controller's optimiser: poses the problem of ``ocp``, keeps the warm start, returns plans."""

import time
from dataclasses import replace
from typing import Optional, Sequence, Tuple, Union

import numpy as np

from nmpc_control.ipopt import IpoptSolver
from nmpc_control.model import DISTURBANCE
from nmpc_control.obstacle import Obstacle
from nmpc_control.ocp import PARTS, Structure
from nmpc_control.other_ways import OtherWays, Posed
from nmpc_control.packing import check_arguments, pack_theta
from nmpc_control.params import Parameters
from nmpc_control.slots import Slots
from nmpc_control.solution import Guess, Solution, shift
from nmpc_control.sqp import SqpSolver
from nmpc_control.state import GRAVITY, POSITION, VELOCITY, Plan, hover_input

_SOON = 2.0  # [s] ahead in which a plan that goes on makes headway
_NO_HEADWAY = 0.3  # [m], [m/s]
_LEAST_PACE = 1.0  # [m/s]
_BRISK = 1.2  # [1] times the reference's speed is no haste yet
_HASTE, _MOST_HASTE = 0.08, 0.2  # [s], [m]: at full tilt nothing is left to correct with
_SLOWER = 0.3  # [m/s] at once, where it is too fast already
_NAMED = 3  # obstacles in a sentence


class Nmpc:
    """Non-linear model predictive controller: state, reference and obstacles in, plan out."""

    def __init__(self, parameters: Parameters) -> None:
        p = parameters.solver
        self.parameters = parameters
        self.structure = Structure(p.horizon, p.dt, p.integrator, p.obstacle_slots)
        budget = (p.budget.tolerance, p.budget.max_iterations, p.budget.time_budget)
        self.solver: Union[SqpSolver, IpoptSolver] = (
            SqpSolver(self.structure, *budget, p.budget.warm_iterations)
            if p.backend == "compiled"
            else IpoptSolver(self.structure, *budget, linear_solver=p.linear_solver)
        )
        self._last: Optional[Solution] = None
        self._last_t = 0.0
        self._solved: Optional[Posed] = None  # the last problem, until other ways were looked for
        self._slots = Slots(p.obstacle_slots)
        self._other_ways = OtherWays(parameters.avoidance.guides, shooting=p.backend == "compiled")
        self.held_up_by: Tuple[str, ...] = ()  # obstacles before which the last plan waits
        self.tracking_error = 0.0  # [m] by which plans have been missed lately; raises the margin
        self._theta = self._pack_theta(parameters)

    def use(self, parameters: Parameters) -> None:
        """Take over other weights, limits, avoidance or vehicle from the next solve on.

        The structure stays.

        Raises:
            ProblemError: unusable numbers; the old parameters remain in force.
        """
        parameters = replace(parameters, solver=self.parameters.solver)
        self._theta = self._pack_theta(parameters)
        self.parameters = parameters

    def expect(self, disturbance: np.ndarray, tracking_error: float = 0.0) -> None:
        """Take what was learnt in flight into the problem.

        Args:
            disturbance: (3,) [m/s^2] constant acceleration in the world frame.
            tracking_error: [m] by which plans are missed; added to the margin of Eq. 7.
        """
        self.tracking_error = tracking_error
        self._theta[PARTS["model"]][DISTURBANCE] = disturbance

    def reset(self) -> None:
        """Forget the last solution: the next solve starts from hover."""
        self._last, self._solved, self.held_up_by = None, None, ()

    def stage_times(self, t: float) -> np.ndarray:
        """Return when (N + 1,) [s] the telemetry shows the stages of a plan made for ``t``."""
        N = self.structure.horizon
        return t + self.parameters.vehicle.delay + self.structure.dt * np.arange(N + 1)

    def solve(
        self,
        t: float,
        x0: np.ndarray,
        x_ref: np.ndarray,
        u_before: np.ndarray,
        obstacles: Sequence[Obstacle] = (),
        u_ref: Optional[np.ndarray] = None,
    ) -> Plan:
        """Return a plan; ``found`` False where the solver has none.

        Args:
            t: time [s] at which the first input will be commanded.
            x0: (10,) state expected at ``t + delay``.
            x_ref: (N + 1, 10) reference at ``stage_times(t)``.
            u_before: (4,) input commanded before ``t``.
            obstacles: any number; those nearest in prediction fill the slots.
            u_ref: (4,) or (N, 4) reference input, hover by default.

        Raises:
            ProblemError: a wrong shape; a time, reference or obstacle that is not finite.
        """
        start = time.perf_counter()
        self.prepare()
        self.held_up_by = ()
        check_arguments(t, x0, x_ref, u_before, u_ref, self.structure.horizon)
        problem = self._pose(t, x0, x_ref, u_before, obstacles, u_ref)
        guess, reference = self._guess(t), x_ref[:, POSITION]
        path = reference if guess is None else guess.states[:, POSITION]
        instance = problem.instance(self._slots, [path, reference])
        if guess is not None:
            guess = self._slots.forgotten(guess)
        solution = self.solver.solve(instance, guess)
        self._solved = problem if problem.obstacles else None
        self._last, self._last_t = solution if solution.found else None, t
        if problem.obstacles:
            if guess is None or not solution.found:
                solution = self._look_further(solution, at_once=True)
            self.held_up_by = self._holding(problem, solution)
        whole = replace(solution, solve_time=time.perf_counter() - start)
        return self.as_plan(t, whole, self._remark(solution, problem))

    def prepare(self) -> None:
        """Look for a better way round for the next solve to begin with, while there is time.

        A plan need not wait for this; what was not done before the next solve is done then.
        """
        if self._last is not None:
            self._look_further(self._last, at_once=False)

    def _look_further(self, solution: Solution, at_once: bool) -> Solution:
        """Return the best solution of the last problem that is known now, and go on from it."""
        problem, self._solved = self._solved, None
        if problem is None:
            return solution
        choice = self._other_ways.improve(self.solver, problem, solution, self._slots, at_once)
        self._slots = choice.slots
        self._last = choice.solution if choice.solution.found else None
        return choice.solution

    def _pose(
        self,
        t: float,
        x0: np.ndarray,
        x_ref: np.ndarray,
        u_before: np.ndarray,
        obstacles: Sequence[Obstacle],
        u_ref: Optional[np.ndarray],
    ) -> Posed:
        """Return the problem without choice of slots; arguments as of ``solve``."""
        avoidance = self.parameters.avoidance
        known = obstacles if avoidance.enabled else ()
        margin, paper = self.parameters.vehicle.radius + avoidance.safety_distance, False
        if avoidance.term == "potential":
            reach, paper = avoidance.inflation, True  # Eq. 8 is taken as it stands
        else:
            reach = avoidance.cushion if avoidance.term == "barrier" else 0.0
            margin += avoidance.allowance + self.tracking_error + self._haste(x0, x_ref)
        return Posed(
            structure=self.structure,
            times=self.stage_times(t),
            x0=x0,
            u_before=u_before,
            x_ref=x_ref,
            u_ref=hover_input(GRAVITY) if u_ref is None else u_ref,
            theta=self._paced(x0, x_ref, known),
            obstacles=known,
            margin=margin,
            reach=reach,
            between=not paper,
        )

    def _paced(
        self, x0: np.ndarray, x_ref: np.ndarray, obstacles: Sequence[Obstacle]
    ) -> np.ndarray:
        """Return theta with the speed bounded by that of the reference, or of what comes.

        Who is late or aside would else sprint among obstacles, and have no room to correct.
        """
        avoidance = self.parameters.avoidance
        if not (avoidance.pace and obstacles) or avoidance.term == "potential":
            return self._theta.copy()
        fastest = float(np.linalg.norm(x_ref[:, VELOCITY], axis=1).max())
        fastest = max(fastest, self._slots.field_of(obstacles).fastest, _LEAST_PACE)
        own = float(np.linalg.norm(x0[VELOCITY])) - _SLOWER
        theta = self._theta.copy()
        theta[PARTS["speed"]] = np.minimum(
            theta[PARTS["speed"]], max(avoidance.pace * fastest, own)
        )
        return theta

    @staticmethod
    def _haste(x0: np.ndarray, x_ref: np.ndarray) -> float:
        """Return by how much [m] to keep farther off while flying faster than the reference."""
        pace = float(np.linalg.norm(x_ref[:, VELOCITY], axis=1).max())
        excess = float(np.linalg.norm(x0[VELOCITY])) - _BRISK * pace
        return min(_HASTE * max(0.0, excess), _MOST_HASTE)

    @property
    def left_out(self) -> int:
        """Number of obstacles in reach that found no slot in the last solve."""
        return self._slots.left_out

    def as_plan(self, t: float, solution: Solution, remark: str = "") -> Plan:
        """Return a solution as plan of time ``t`` [s], its status with a remark."""
        return Plan(
            t=t,
            dt=self.structure.dt,
            delay=self.parameters.vehicle.delay,
            states=solution.states,
            inputs=solution.inputs,
            found=solution.found,
            status=solution.status + remark,
            iterations=solution.iterations,
            solve_time=solution.solve_time,
            cost=solution.cost,
            kkt_residual=solution.kkt_residual,
        )

    def _pack_theta(self, p: Parameters) -> np.ndarray:
        return pack_theta(p.vehicle, p.weights, p.limits, p.avoidance)

    def _remark(self, solution: Solution, problem: Posed) -> str:
        """Return which softened bound the plan exceeds, or into which margin it begins; or ""."""
        if self.held_up_by:
            return f", held up by {', '.join(self.held_up_by)}"
        if solution.softened:
            return f", {solution.softened} exceeded by {solution.violation:.2f}"
        if self._slots.left_out:
            return f", {self._slots.left_out} obstacles in reach have no slot"
        now = self._slots.field.distances(problem.x0[None, POSITION], problem.times[:1])
        inside = problem.margin - now.min(initial=np.inf)
        if inside > 0.0 and problem.obstacles:
            return f", obstacle margin entered by {inside:.2f}"
        return ""

    def _holding(self, problem: Posed, solution: Solution) -> Tuple[str, ...]:
        """Return the ids of the obstacles before which a plan waits, nearest first, or ()."""
        soon = min(int(_SOON / self.structure.dt), self.structure.horizon)
        here = problem.x0[POSITION]
        moves = np.linalg.norm(solution.states[soon, POSITION] - here) > _NO_HEADWAY
        moves |= np.linalg.norm(problem.x0[VELOCITY]) > _NO_HEADWAY
        arrived = np.linalg.norm(problem.x_ref[-1, POSITION] - here) < _NO_HEADWAY
        if moves or arrived:
            return ()
        blocked = problem.on_reference(self._slots.field)
        distances = self._slots.field.distances(here[None], problem.times[:1])[:, 0]
        nearest = np.argsort(np.where(blocked, distances, np.inf), kind="stable")
        return tuple(self._slots.field.ids[i] for i in nearest[: min(_NAMED, blocked.sum())])

    def _guess(self, t: float) -> Optional[Guess]:
        if self._last is None:
            return None
        stages = (t - self._last_t) / self.structure.dt
        if not 0.0 <= stages < self.structure.horizon / 2:
            return None
        return shift(self._last.guess, stages)
