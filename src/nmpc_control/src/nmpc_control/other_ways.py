# SPDX-License-Identifier: MIT
"""Solutions on other sides of what stands on the reference, and when one is worth changing to.

A local optimiser stays on the side on which it began, and head-on on none. While the reference
leads through an obstacle, some other ways round (``guides``) are tried, and one that is
cheaper by more than a little replaces the solution; the little keeps the side from flipping.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import List, Optional, Protocol, Sequence, Tuple

import numpy as np

from nmpc_control.guides import SIDES, Turns, conflicts, eased, sides, way_round
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.ocp import PARTS, Instance, Structure
from nmpc_control.packing import pack_stages
from nmpc_control.slots import Slots
from nmpc_control.solution import Guess, Solution
from nmpc_control.state import NU, NX, POSITION, VELOCITY

_PAUSE = 3  # ticks from one try to the next while there is a solution
_AT_ONCE = 3  # sides tried in a tick without one; the others one a tick, for a tick has to end
_ROUNDS, _WORTH_MORE = 4, 2.0  # of iterations, for what may yet become better than what there is
_BETTER = 0.95  # of its cost: what is dearer than this is no reason to change
_SHORT_CUT = 1e6  # [1/m] of entering margins by more than a touch
_TOUCH_SOON, _SOON, _TOUCH = 0.02, 2.0, 0.1  # [m] of a touch now, and from these [s] ahead on
_AHEAD = 4.0  # [s] farther ahead no margin is looked at
_BODIES = 8  # times that a way is pushed on where a body turns out to be wider
_IN_TIME = 4  # stages of sideways motion that a way may lack at its start
_STOPPING = 0.7  # [s] time constant of the stop that is tried where every way leads through
_SIDEWAYS = 1.5  # [m/s] of a way away from the reference


class Solver(Protocol):
    """A backend."""

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solution."""


@dataclass
class Posed:
    """One problem with its obstacles; slots depend on where the aircraft may go."""

    structure: Structure
    times: np.ndarray  # (N + 1,) [s]
    x0: np.ndarray  # (10,)
    u_before: np.ndarray  # (4,)
    x_ref: np.ndarray  # (N + 1, 10)
    u_ref: np.ndarray  # (4,) or (N, 4)
    theta: np.ndarray  # (THETA_SIZE,)
    obstacles: Sequence[Obstacle]
    margin: float  # [m] least distance of the centre from surfaces
    reach: float  # [m] beyond it, where terms begin
    between: bool  # whether the margin holds between the stages, too

    def instance(self, slots: Slots, paths: List[np.ndarray]) -> Instance:
        """Return the numbers for the solver, with obstacles near some paths (N + 1, 3) [m]."""
        data = slots.fill(self.obstacles, self.times, paths, self.margin, self.reach, self.between)
        return self._with(self.x_ref, data, self.theta)

    def again(self, slots: Slots, solution: Solution) -> Tuple[Instance, Guess]:
        """Return the problem as the next tick would pose it, and where it would begin."""
        path, reference = solution.states[:, POSITION], self.x_ref[:, POSITION]
        return self.instance(slots, [path, reference]), slots.forgotten(solution.guess)

    def short_cut(self, field: ObstacleField, solution: Solution) -> float:
        """Return how much deeper [m] a solution leads into margins than the aircraft is now.

        On the true bodies, also halfway between the stages. A touch is none, less so where it would
        be soon; nor is what is far ahead: a way is found by then.
        """
        N = min(int(_AHEAD / self.structure.dt), self.structure.horizon)
        stages, times = solution.states[: N + 1, POSITION], self.times[: N + 1]
        points = np.concatenate([stages, (stages[1:] + stages[:-1]) / 2.0])
        when = np.concatenate([times, (times[1:] + times[:-1]) / 2.0])
        least = field.distances(points, when).min(axis=0, initial=np.inf)
        touch = np.interp(when - times[0], [0.0, _SOON], [_TOUCH_SOON, _TOUCH])
        return max(0.0, float((min(self.margin, least[0]) - least - touch).max()))

    @cached_property
    def eased_reference(self) -> np.ndarray:
        """The positions (N + 1, 3) [m] of the reference, led away from the aircraft."""
        return eased(self.x_ref[:, POSITION], self.x0[POSITION], self.times)

    def on_reference(self, field: ObstacleField) -> np.ndarray:
        """Return which obstacles (n,) stand on the reference, led away from the aircraft."""
        reference = self.eased_reference
        return conflicts(field.spheres(reference, self.times), self.margin, reference)

    def free(self, path: np.ndarray) -> Instance:
        """Return the problem of following a path (N + 1, 3) [m] without obstacles."""
        x_ref = self.x_ref.copy()
        x_ref[:, POSITION] = path
        x_ref[:, VELOCITY] = np.gradient(path, self.structure.dt, axis=0)
        theta = self.theta.copy()
        theta[PARTS["eta"]] = theta[PARTS["hard_obstacles"]] = 0.0
        return self._with(x_ref, (), theta)

    def _with(self, x_ref: np.ndarray, slots: Sequence[np.ndarray], theta: np.ndarray) -> Instance:
        stages = pack_stages(self.structure, x_ref, self.u_ref, slots)
        return Instance(self.x0, self.u_before, stages, theta)


class OtherWays:
    """Tries sides in turn, and counts how often one was better."""

    def __init__(self, tries: int, shooting: bool) -> None:
        """Begin.

        Args:
            tries: sides tried in one tick beside the last tick's; none: no side ever is.
            shooting: whether the solver takes a guess by its inputs.
        """
        self._tries = tries
        self.changes = 0
        self._turns = Turns()
        self._ticks = 0
        self._owed = 0  # sides of a round that had no turn yet
        self._shooting = shooting

    def improve(
        self,
        solver: Solver,
        problem: Posed,
        solution: Solution,
        slots: Slots,
        at_once: bool,
    ) -> "Choice":
        """Return the solution with its slots, or a much better one with its own.

        Args:
            solver: the backend.
            problem: what is solved.
            solution: what it found from its own guess.
            slots: where the obstacles sit in it.
            at_once: whether it had none to begin with, or found none: all sides are tried then,
                some now and one in each of the next ticks.
        """
        best, field = Choice(solution, slots), slots.field
        self._ticks += 1
        if not problem.on_reference(field).any():
            self._owed = 0
            return best
        if not self._tries:
            return best
        short_cut = problem.short_cut(field, solution)
        now = at_once or short_cut > 0.0 or self._owed
        if not (now or self._ticks % _PAUSE == 0):  # else a try now and then is enough
            return best
        reference = problem.eased_reference
        rounds = 0 if at_once else _ROUNDS  # a plan waits for those at once

        def merit_of(found: Solution) -> float:
            return _merit(found, problem.short_cut(field, found))

        def worked_out(
            found: Solution, merit: float, seats: Slots, most: float
        ) -> Tuple[Solution, float]:
            for _ in range(rounds):
                if found.status != "budget" or merit > most:
                    break
                found = solver.solve(*problem.again(seats, found))
                merit = merit_of(found)
            return found, merit

        least = _merit(solution, short_cut)  # worked out, too, or who came first would lose
        _, least = worked_out(solution, least, slots.copy(), math.inf)
        ways = [self._stay(problem)] if short_cut > 0.0 else []
        across = sides(reference[-1] - reference[0])
        for index in self._due(at_once):
            ways.append(self._round(problem, field, reference, across[index]))
        for way in ways:
            if way is None:
                continue
            seats = slots.copy()
            posed = problem.instance(seats, [way, reference])
            tried = solver.solve(posed, self._guess(solver, problem, way))
            other, merit = worked_out(tried, merit_of(tried), seats, _WORTH_MORE * least)
            if other.found and merit < _BETTER * least:
                least = merit
                best = Choice(other, seats)
                self.changes += 1
        return best

    def _round(
        self, problem: Posed, field: ObstacleField, reference: np.ndarray, side: np.ndarray
    ) -> Optional[np.ndarray]:
        """Return the reference pushed out of all margins to one side, or None.

        Where the body is so near that there is no room to get aside on the way, first aside.
        """
        way = self._pushed(problem, field, reference, side)
        if way is None:
            return None
        late = math.ceil(np.linalg.norm(way[0] - reference[0]) / (_SIDEWAYS * problem.structure.dt))
        if late < _IN_TIME:
            return way
        late = min(late, len(reference) - 1)
        waiting = np.concatenate([np.tile(reference[0], (late, 1)), reference[:-late]])
        return self._pushed(problem, field, waiting, side)

    def _pushed(
        self, problem: Posed, field: ObstacleField, path: np.ndarray, side: np.ndarray
    ) -> Optional[np.ndarray]:
        """Spheres stand for flat bodies only where the path is: they are asked for anew on it."""
        way: Optional[np.ndarray] = path
        slope = _SIDEWAYS * problem.structure.dt
        for _ in range(_BODIES):
            way = way_round(field.spheres(way, problem.times), problem.margin, way, side, slope)
            if way is None or (field.distances(way, problem.times) >= problem.margin).all():
                return way
        return None

    def _stay(self, problem: Posed) -> np.ndarray:
        """Return the way of a stop (N + 1, 3) [m]."""
        ahead = _STOPPING * -np.expm1(-(problem.times - problem.times[0]) / _STOPPING)
        return problem.x0[POSITION] + ahead[:, None] * problem.x0[VELOCITY]

    def _due(self, at_once: bool) -> List[int]:
        """Return which sides to try in this tick: a count, for a clock is never the same."""
        if not self._shooting:
            return self._turns.take(self._tries)
        if at_once and not self._owed:
            self._turns, self._owed = Turns(), SIDES  # a round begins with the right
        count = max(_AT_ONCE, self._tries) if at_once else self._tries
        self._owed = max(0, self._owed - count)
        return self._turns.take(count)

    def _guess(self, solver: Solver, problem: Posed, way: np.ndarray) -> Guess:
        follow = problem.free(way)
        if self._shooting:
            found = solver.solve(follow)
            return Guess(found.states, found.inputs)
        states = follow.stages[:NX].T.copy()
        states[0] = problem.x0
        inputs = np.broadcast_to(problem.u_ref, (problem.structure.horizon, NU))
        return Guess(states, np.array(inputs))


def _merit(solution: Solution, short_cut: float) -> float:
    """Return the cost of a solution; a short cut costs more than any way is worth.

    The L1 penalty is exact about where a way leads, not about which: for a goal far beyond, one
    through a thin body or margin could be cheaper than to wait.
    """
    return solution.cost + _SHORT_CUT * short_cut


@dataclass(frozen=True)
class Choice:
    """A solution, and where its obstacles sit."""

    solution: Solution
    slots: Slots
