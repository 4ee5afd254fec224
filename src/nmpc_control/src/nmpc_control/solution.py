# SPDX-License-Identifier: MIT
"""What every solver backend takes as a guess and gives back."""

from dataclasses import dataclass
from typing import Optional

import numpy as np

from nmpc_control.state import GRAVITY, NU, NX


@dataclass(frozen=True)
class Guess:
    """Where a solver starts: states (N + 1, 10), inputs (N, 4), feedback gains (N, 4, 14) or None."""

    states: np.ndarray
    inputs: np.ndarray
    gains: Optional[np.ndarray] = None


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
    gains: Optional[np.ndarray] = None  # (N, 4, 14) feedback on state and previous input


def cold_guess(x0: np.ndarray, horizon: int) -> Guess:
    """Return the guess that stays at the position of ``x0`` (10,), level and in hover."""
    x = np.zeros(NX)
    x[:3], x[5] = x0[:3], x0[5]
    inputs = np.zeros((horizon, NU))
    inputs[:, 0] = GRAVITY
    return Guess(np.tile(x, (horizon + 1, 1)), inputs)


def shift(guess: Guess, stages: float) -> Guess:
    """Return the guess moved on by a (fractional) number of stages, its last stage held."""
    N = len(guess.inputs)
    at = np.minimum(np.arange(N + 1) + stages, N)
    low = np.minimum(at.astype(int), N - 1)
    part = (at - low)[:, None]
    states = (1 - part) * guess.states[low] + part * guess.states[low + 1]
    at, low, part = at[:N], np.minimum(low[:N], N - 1), part[:N]
    inputs = (1 - part) * guess.inputs[low] + part * guess.inputs[np.minimum(low + 1, N - 1)]
    gains = None if guess.gains is None else guess.gains[np.minimum(np.round(at).astype(int), N - 1)]
    return Guess(states, inputs, gains)
