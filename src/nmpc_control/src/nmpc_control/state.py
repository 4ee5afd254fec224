# SPDX-License-Identifier: MIT
"""Order and meaning of states and inputs (paper, Eqs.

4a and 4b), and the data that flows between modules.

State (10): position [m], roll, pitch, yaw [rad], velocity [m/s], all in the ENU world frame, and
yaw rate [rad/s]. Input (4): mass-normalised thrust [m/s^2], roll and pitch references [rad], yaw
rate
reference [rad/s]; body frame FLU, so positive pitch is nose down.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Optional

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
    at
    ``t + delay + k * dt``.
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

    @property
    def horizon(self) -> int:
        """Number of stages N."""
        return len(self.inputs)

    @property
    def end(self) -> float:
        """Time [s] at which the last input ends."""
        return self.t + self.dt * self.horizon

    def input_at(self, t: float) -> np.ndarray:
        """Return the input (4,) to command at time ``t`` [s], held constant over each stage."""
        k = int(np.clip((t - self.t) / self.dt + 1e-9, 0, self.horizon - 1))
        return self.inputs[k]

    def state_at(self, t: float) -> np.ndarray:
        """Return the state (10,) that the telemetry should show at ``t`` [s]."""
        s = float(np.clip((t - self.t - self.delay) / self.dt, 0.0, self.horizon))
        k = min(int(s), self.horizon - 1)
        return self.states[k] + (s - k) * (self.states[k + 1] - self.states[k])


@dataclass(frozen=True)
class Obstacle:
    """A sphere, vertical cylinder or axis-aligned box; the hull that must not be touched."""

    id: str
    position: np.ndarray  # (3,) [m] centre, world frame
    size: (
        np.ndarray
    )  # [m] sphere: (radius,), cylinder: (radius, height), box: (3,) full edge lengths
    shape: str = "sphere"
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m/s]
    stamp: Optional[float] = None  # [s] time of the position; None: it stands still

    def position_at(self, t: float) -> np.ndarray:
        """Return the centre (3,) [m] at time ``t`` [s], moving at constant velocity."""
        if self.stamp is None:
            return self.position
        return self.position + (t - self.stamp) * self.velocity

    def distance(self, points: np.ndarray, t: Optional[float] = None) -> np.ndarray:
        """Return the distance [m] from points (..., 3) to the surface, negative inside."""
        offset = np.asarray(points) - (self.position if t is None else self.position_at(t))
        if self.shape == "sphere":
            return np.linalg.norm(offset, axis=-1) - self.size[0]
        if self.shape == "cylinder":
            q = np.stack(
                [
                    np.linalg.norm(offset[..., :2], axis=-1) - self.size[0],
                    np.abs(offset[..., 2]) - self.size[1] / 2,
                ],
                axis=-1,
            )
        else:
            q = np.abs(offset) - self.size / 2
        return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)
