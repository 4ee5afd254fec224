# SPDX-License-Identifier: MIT
"""Order and meaning of states and inputs (paper, Eqs.

4a and 4b), and the data that flows between modules.

State (10): position [m], roll, pitch, yaw [rad], velocity [m/s], all in the ENU world frame, and
yaw rate [rad/s]. Input (4): mass-normalised thrust [m/s^2], roll and pitch references [rad], yaw
rate
reference [rad/s]; body frame FLU, so positive pitch is nose down.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

NX = 10
NU = 4

POSITION = slice(0, 3)
ATTITUDE = slice(3, 6)
VELOCITY = slice(6, 9)
ROLL, PITCH, YAW, YAW_RATE = 3, 4, 5, 9

THRUST, ROLL_REF, PITCH_REF, YAW_RATE_REF = 0, 1, 2, 3

GRAVITY = 9.81  # [m/s^2]


def hover_input(gravity: float = GRAVITY) -> np.ndarray:
    """Return the input (4,) that holds a level, still aircraft in the air."""
    return np.array([gravity, 0.0, 0.0, 0.0])


def hover_state(position: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """Return the state (10,) at rest and level at a position (3,) [m] with a yaw [rad]."""
    x = np.zeros(NX)
    x[POSITION] = position
    x[YAW] = yaw
    return x


class Goal(IntEnum):
    """What a plan serves: values of ``nmpc_msgs/Plan.GOAL_*``."""

    HOLD = 0
    APPROACH = 1
    TRAJECTORY = 2


@dataclass(frozen=True)
class Plan:
    """One solution of the optimal control problem; ``found`` False when there is none.

    ``inputs[k]`` is to be commanded from ``t + k * dt``; ``states[k]`` is what the telemetry shows
    at ``times[k]``.
    """

    t: float  # [s] time at which inputs[0] is commanded
    dt: float  # [s]
    delay: float  # [s] dead time from command to effect in the telemetry
    states: np.ndarray  # (N + 1, 10)
    inputs: np.ndarray  # (N, 4)
    found: bool = True
    status: str = ""
    iterations: int = 0
    solve_time: float = 0.0  # [s] wall time
    cost: float = float("nan")
    kkt_residual: float = float("nan")
    state_t: float = float("nan")  # [s] stamp of the newest telemetry it came from; NaN: unknown

    @property
    def horizon(self) -> int:
        """Number of stages N."""
        return len(self.inputs)

    @property
    def end(self) -> float:
        """Time [s] at which the last input ends."""
        return self.t + self.dt * self.horizon

    @property
    def times(self) -> np.ndarray:
        """When (N + 1,) [s] the telemetry shows the states."""
        return self.t + self.delay + self.dt * np.arange(len(self.states))

    def input_at(self, t: float) -> np.ndarray:
        """Return the input (4,) to command at time ``t`` [s], held constant over each stage."""
        k = int(np.clip((t - self.t) / self.dt + 1e-9, 0, self.horizon - 1))
        return self.inputs[k]

    def state_at(self, t: float) -> np.ndarray:
        """Return the state (10,) that the telemetry should show at ``t`` [s]."""
        s = float(np.clip((t - self.t - self.delay) / self.dt, 0.0, self.horizon))
        k = min(int(s), self.horizon - 1)
        return self.states[k] + (s - k) * (self.states[k + 1] - self.states[k])
