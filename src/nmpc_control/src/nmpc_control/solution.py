# SPDX-License-Identifier: MIT
"""What every solver backend takes as a guess and gives back."""

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.state import GRAVITY, NU, NX


@dataclass(frozen=True)
class Guess:
    """Where a solver starts; gains and multipliers only help the compiled one."""

    states: np.ndarray  # (N + 1, 10)
    inputs: np.ndarray  # (N, 4)
    gains: Optional[np.ndarray] = None  # (N, 14, 4) feedback on x and u_before, transposed
    multipliers: Optional[np.ndarray] = None  # (N + 1, nc) of the softened inequalities
    cost: float = np.inf  # of the solution that it comes from


@dataclass(frozen=True)
class Solution:
    """Result of one solve; ``found`` says whether states and inputs may be used at all."""

    found: bool
    status: str  # converged | budget | stalled | failed, or the word of IPOPT
    states: np.ndarray  # (N + 1, 10)
    inputs: np.ndarray  # (N, 4)
    cost: float
    iterations: int
    kkt_residual: float  # largest projected gradient, scaled by the input ranges
    active_bounds: int
    solve_time: float  # [s] wall time
    violation: float = 0.0  # [m] or [m/s] by which a softened bound is exceeded most
    softened: str = ""  # which kind of bound that is; empty while all hold
    gains: Optional[np.ndarray] = None  # (N, 14, 4) feedback on x and u_before, transposed
    multipliers: Optional[np.ndarray] = None  # (N + 1, nc) of the softened inequalities

    @property
    def guess(self) -> Guess:
        """The solution as a guess for the next solve."""
        return Guess(self.states, self.inputs, self.gains, self.multipliers, self.cost)


def cold_guess(x0: np.ndarray, horizon: int) -> Guess:
    """Return the guess that stays at the position of ``x0`` (10,), level and in hover."""
    x = np.zeros(NX)
    x[:3], x[5] = x0[:3], x0[5]
    inputs = np.zeros((horizon, NU))
    inputs[:, 0] = GRAVITY
    return Guess(np.tile(x, (horizon + 1, 1)), inputs)


def no_solution(x0: np.ndarray, horizon: int, status: str) -> Solution:
    """Return what a solver answers when it has nothing: finite numbers that may not be flown."""
    hover = cold_guess(np.nan_to_num(x0, nan=0.0, posinf=0.0, neginf=0.0), horizon)
    return Solution(
        found=False,
        status=status,
        states=hover.states,
        inputs=hover.inputs,
        cost=np.inf,
        iterations=0,
        kkt_residual=np.inf,
        active_bounds=0,
        solve_time=0.0,
    )


def shift(guess: Guess, stages: float) -> Guess:
    """Return the guess moved on by a (fractional) number of stages, its last stage held."""
    N = len(guess.inputs)
    at = np.minimum(np.arange(N + 1) + stages, N)
    low = np.minimum(at.astype(int), N - 1)
    part = (at - low)[:, None]
    states = (1 - part) * guess.states[low] + part * guess.states[low + 1]
    at, low, part = at[:N], np.minimum(low[:N], N - 1), part[:N]
    inputs = (1 - part) * guess.inputs[low] + part * guess.inputs[np.minimum(low + 1, N - 1)]
    nearest = np.minimum(np.round(at).astype(int), N - 1)
    gains = None if guess.gains is None else guess.gains[nearest]
    multipliers = guess.multipliers
    if multipliers is not None:
        multipliers = multipliers[np.minimum(np.round(np.arange(N + 1) + stages).astype(int), N)]
    return Guess(states, inputs, gains, multipliers, guess.cost)


def worst_violation(g: np.ndarray, kinds: Sequence[str], tolerance: float) -> Tuple[float, str]:
    """Return the largest excess in g (N + 1, nc) and its kind, "" within the tolerance."""
    most = g.max(axis=0)
    row = int(np.argmax(most))
    return (
        (float(most[row]), kinds[row])
        if most[row] > tolerance
        else (max(0.0, float(most[row])), "")
    )
