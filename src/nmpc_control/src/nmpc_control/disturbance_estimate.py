# SPDX-License-Identifier: MIT
"""What the model leaves out, as a slowly changing acceleration: wind, thrust gain, mass.

The velocity is predicted from one state estimate to the next with the inputs really sent; what it
misses by, divided by the time, goes through a low-pass into the model. That makes control free of
offset (Pannocchia and Rawlings 2003), tells the hover thrust as the battery drains, and needs no
second model. Nothing here reaches the solver, the guard estimates on its own.
"""

import math
from dataclasses import replace
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.params import Disturbance, Vehicle
from nmpc_control.prediction import predict
from nmpc_control.state import GRAVITY, VELOCITY

_LONGEST = 0.3  # [s] between two states; after a longer gap nothing is learnt
_SHORTEST = 0.005  # [s] closer ones say nothing
_JUMP = 5.0  # [1] times the bound: more is a source that jumps, or a blow, and counts as this
_MISS_TIME = 1.0  # [s] of the low-pass on how far velocities are missed


def steady_input(vehicle: Vehicle, yaw: float) -> np.ndarray:
    """Return the input (4,) that holds still at a yaw [rad] against the vehicle's disturbance."""
    x, y, z = np.array([0.0, 0.0, GRAVITY]) - vehicle.disturbance
    forward, left = math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x
    thrust = math.sqrt(x * x + y * y + z * z)
    roll, pitch = -math.asin(left / thrust), math.atan2(forward, z)
    return np.array([thrust, roll / vehicle.roll.gain, pitch / vehicle.pitch.gain, 0.0])


def learnable(parameters: Disturbance, vertical_command: str) -> Disturbance:
    """Return the parameters for what is sent: a thrust that is not sent teaches nothing."""
    return parameters if vertical_command == "thrust" else replace(parameters, vertical=0.0)


class DisturbanceEstimate:
    """The acceleration (3,) [m/s^2] in the world frame that the model lacks."""

    def __init__(self, parameters: Disturbance) -> None:
        """Begin with none."""
        self.parameters = parameters
        self.reset()

    def reset(self) -> None:
        """Forget all, as when the inputs are not known: the pilot or DJI's own loops fly."""
        self.acceleration = np.zeros(3)
        self.miss = 0.0  # [m/s] root mean square by which velocities are missed
        self._last: Optional[Tuple[float, np.ndarray]] = None

    def pause(self) -> None:
        """Learn nothing from what happens until the next update, but keep what is known."""
        self._last = None

    def update(
        self,
        t: float,
        state: np.ndarray,
        inputs: Sequence[Tuple[float, Sequence[float]]],
        vehicle: Vehicle,
    ) -> None:
        """Learn from the state (10,) at ``t`` [s].

        Args:
            t: [s] time of the state.
            state: (10,) estimate.
            inputs: (time sent [s], input (4,)) sorted, all that were sent lately.
            vehicle: the model with the present estimate as its ``disturbance``.
        """
        last, dt = self._last, 0.0
        if last is not None:
            dt = t - last[0]
            if 0.0 <= dt < _SHORTEST:
                return
        self._last = (t, np.array(state))
        if not _SHORTEST <= dt <= _LONGEST:
            return
        expected = predict(last[1], last[0], t, inputs, vehicle)
        miss = state[VELOCITY] - expected[VELOCITY]
        p = self.parameters
        most = np.array([p.horizontal, p.horizontal, p.vertical])
        miss = np.where(most > 0.0, miss, 0.0)
        believed = np.clip(miss, -_JUMP * most * dt, _JUMP * most * dt)
        learnt = self.acceleration + believed * min(1.0 / p.time_constant, 1.0 / dt)
        self.acceleration = np.clip(learnt, -most, most)
        part = min(1.0, dt / _MISS_TIME)
        self.miss = float(np.sqrt((1.0 - part) * self.miss**2 + part * float(miss @ miss)))
