# SPDX-License-Identifier: MIT
"""The inputs that were really sent lately, and the state to which they lead."""

import math
from collections import deque
from typing import Deque, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.estimator import StateEstimate
from nmpc_control.params import Vehicle
from nmpc_control.prediction import predict
from nmpc_control.state import PITCH, PITCH_REF, ROLL, ROLL_REF, hover_input, hover_state

MEMORY = 2.0  # [s] inputs sent earlier cannot matter for the delay
IN_FORCE = 0.1  # [s] the last one counts as in force for so long


class SentInputs:
    """A short memory of inputs, on the guard's own model."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.history: Deque[Tuple[float, np.ndarray]] = deque()  # (time sent [s], input (4,))
        self.unknown = -math.inf  # [s] when something was sent last that the model does not have

    def forget(self) -> None:
        """Drop all, as when the clock went backwards."""
        self.history.clear()
        self.unknown = -math.inf

    def add(self, t: float, applied: Optional[Sequence[float]]) -> None:
        """Take what was sent at ``t`` [s]; None: a setpoint of DJI's own velocity control."""
        if applied is None:
            self.unknown = t
        # that is not in the model; level hover is the nearest that is
        self.history.append((t, hover_input() if applied is None else np.array(applied)))

    def trim(self, t: float) -> None:
        """Drop what is too old at ``t`` [s] to matter."""
        while self.history and self.history[0][0] < t - MEMORY:
            self.history.popleft()

    def last(self, t: float, estimate: Optional[StateEstimate]) -> np.ndarray:
        """Return the input (4,) in force at ``t`` [s], or one that explains the attitude."""
        if self.history and t - self.history[-1][0] <= IN_FORCE:
            return self.history[-1][1]
        u = hover_input()
        if estimate is not None:
            u[ROLL_REF] = estimate.vector[ROLL] / self.vehicle.roll.gain
            u[PITCH_REF] = estimate.vector[PITCH] / self.vehicle.pitch.gain
        return u

    def state_in_effect(self, t: float, known: Optional[StateEstimate]) -> np.ndarray:
        """Return the state (10,) expected when a command sent at ``t`` [s] takes effect."""
        if known is None:
            return hover_state(np.zeros(3))
        return predict(known.vector, known.t, t + self.vehicle.delay, self.history, self.vehicle)
