# SPDX-License-Identifier: MIT
"""Bounded brake from measured velocity, for when there is neither a plan nor DJI's own hold."""

import math
from dataclasses import dataclass, field
from typing import Optional, Sequence

import numpy as np

from nmpc_control.params import Limits, Vehicle
from nmpc_control.state import GRAVITY, POSITION, VELOCITY, YAW, hover_input

# [m/s^2] learnt push that is made up for beyond the deceleration: both fit into a tilt of 25 deg
MADE_UP = 1.5


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _non_negative() -> float:
    return field(metadata={"min": 0.0})


@dataclass(frozen=True)
class BrakeParameters:
    """Gains and bounds of the brake; deceleration is proportional to velocity up to its bound."""

    velocity_gain: float = _positive()  # [1/s] horizontal
    position_gain: float = _non_negative()  # [1/s^2] horizontal, towards where it came to rest
    vertical_velocity_gain: float = _positive()  # [1/s]
    height_gain: float = _non_negative()  # [1/s] climb rate per height, to where it began
    vertical_speed: float = _positive()  # [m/s] of that climb or descent, at most
    thrust_adaptation: float = _non_negative()  # [1/s^2] integral of the vertical speed's error
    deceleration: float = _positive()  # [m/s^2] horizontal, at most
    vertical_acceleration: float = _positive()  # [m/s^2] at most, adaptation included
    tilt_rate: float = _positive()  # [rad/s] of each attitude reference, at most
    rest_speed: float = _positive()  # [m/s] horizontal; below it the position is held


class Brake:
    """A brake that remembers where it came to rest, how much thrust it needs and what it sent."""

    def __init__(self, vehicle: Vehicle, limits: Limits, params: BrakeParameters) -> None:
        """Begin level, in hover thrust."""
        self.vehicle = vehicle
        self.limits = limits
        self.params = params
        self.begin(hover_input())

    def begin(self, previous: Sequence[float]) -> None:
        """Start a new brake after the input (4,) that was sent last."""
        self._previous = np.array(previous, dtype=float)
        self._rest: Optional[np.ndarray] = None
        self._height: Optional[float] = None
        self._thrust_bias = 0.0

    def input(
        self,
        state: np.ndarray,
        dt: float,
        has_position: bool,
        push: Sequence[float] = (0, 0, 0),
        velocity: Optional[np.ndarray] = None,
    ) -> np.ndarray:
        """Return the input (4,) that brakes and, once at rest, holds.

        Args:
            state: (10,) expected when the input takes effect.
            dt: [s] since the last call.
            has_position: whether the position in the state is to be trusted.
            push: (3,) [m/s^2] what the model was found to lack, as wind; it is made up for.
            velocity: (3,) [m/s] to fly with instead, within the same bounds.
        """
        wanted = np.zeros(3) if velocity is None else velocity
        if not has_position or velocity is not None:
            self._rest = self._height = None
        made_up = _shorten(np.array(push[:2], dtype=float), MADE_UP)
        holds = has_position and velocity is None
        horizontal = self._horizontal(state, holds, wanted[:2]) - made_up
        vertical = self._vertical(state, dt, holds, float(wanted[2])) - push[2]
        self._previous = self._limited(
            self._thrust_vector_input(horizontal, vertical, state[YAW]), dt
        )
        return self._previous.copy()

    def _horizontal(self, state: np.ndarray, holds: bool, wanted: np.ndarray) -> np.ndarray:
        """Return the acceleration (2,) [m/s^2] to a velocity, and back to the resting place."""
        p = self.params
        position, velocity = state[POSITION][:2], state[VELOCITY][:2] - wanted
        if holds and self._rest is None and math.hypot(*velocity) <= p.rest_speed:
            self._rest = position.copy()
        offset = np.zeros(2) if self._rest is None else self._rest - position
        return _shorten(p.position_gain * offset - p.velocity_gain * velocity, p.deceleration)

    def _vertical(self, state: np.ndarray, dt: float, holds: bool, climb: float) -> float:
        """Return the acceleration [m/s^2] that holds the height, learning what hover takes."""
        p = self.params
        height, velocity = float(state[POSITION][2]), float(state[VELOCITY][2])
        if holds and self._height is None:
            self._height = height
        wanted = climb if self._height is None else p.height_gain * (self._height - height)
        error = _clamp(wanted, p.vertical_speed) - velocity
        bound = p.vertical_acceleration
        self._thrust_bias = _clamp(self._thrust_bias + p.thrust_adaptation * error * dt, bound)
        return _clamp(p.vertical_velocity_gain * error + self._thrust_bias, bound)

    def _thrust_vector_input(
        self, horizontal: np.ndarray, vertical: float, yaw: float
    ) -> np.ndarray:
        """Return the input (4,) whose thrust vector gives the acceleration, Eq. 1 solved for it."""
        forward = math.cos(yaw) * horizontal[0] + math.sin(yaw) * horizontal[1]
        left = -math.sin(yaw) * horizontal[0] + math.cos(yaw) * horizontal[1]
        up = GRAVITY + vertical
        thrust = math.sqrt(forward * forward + left * left + up * up)
        roll = math.asin(-left / thrust) / self.vehicle.roll.gain
        pitch = math.atan2(forward, up) / self.vehicle.pitch.gain
        return np.array([thrust, roll, pitch, 0.0])

    def _limited(self, u: np.ndarray, dt: float) -> np.ndarray:
        u = np.clip(u, self.limits.input_min, self.limits.input_max)
        change = self.params.tilt_rate * dt
        u[1:3] = np.clip(u[1:3], self._previous[1:3] - change, self._previous[1:3] + change)
        return u


def _shorten(vector: np.ndarray, limit: float) -> np.ndarray:
    norm = math.hypot(vector[0], vector[1])
    return vector if norm <= limit else vector * (limit / norm)


def _clamp(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
