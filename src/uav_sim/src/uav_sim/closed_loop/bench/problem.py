# SPDX-License-Identifier: MIT
"""One problem as a flight posed it, and the recorder that takes it down."""

from dataclasses import dataclass
from typing import Any, List, Optional, Sequence

from nmpc_control.ocp import Instance, Structure
from nmpc_control.solution import Guess, Solution


@dataclass(frozen=True)
class Problem:
    """What a solver was given: every backend solves the same numbers from the same guess."""

    kind: str  # the flight that it comes from
    structure: Structure
    instance: Instance
    guess: Optional[Guess]  # None: from hover
    earlier: Optional[Instance] = None  # the problem one stage (dt) before, None after a cold start


class Recorder:
    """A solver that notes every problem it is given and passes it on."""

    def __init__(self, solver: Any) -> None:
        self.solver = solver
        self.instances: List[Instance] = []
        self.guesses: List[Optional[Guess]] = []
        self.solutions: List[Solution] = []

    def solve(self, instance: Instance, guess: Optional[Guess] = None) -> Solution:
        """Return the solver's solution."""
        solution = self.solver.solve(instance, guess)
        self.instances.append(instance)
        self.guesses.append(guess)
        self.solutions.append(solution)
        return solution

    def problems(self, kind: str, stride: int, indices: Sequence[int]) -> List[Problem]:
        """Return the problems at some indices; ``stride`` is the number of solves in one stage."""
        structure = self.solver.structure
        return [
            Problem(
                kind,
                structure,
                self.instances[i],
                self.guesses[i],
                self.instances[i - stride] if self.guesses[i] is not None and i >= stride else None,
            )
            for i in indices
        ]
