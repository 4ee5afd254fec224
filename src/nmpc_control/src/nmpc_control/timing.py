# SPDX-License-Identifier: MIT
"""Where on a curve to be when: s(t) and its first two derivatives, for t in [0, duration]."""

import math
from typing import Protocol, Tuple

import numpy as np

from nmpc_control.curves import ArcLength, Curve

Motion = Tuple[np.ndarray, np.ndarray, np.ndarray]  # s [1], s' [1/s], s'' [1/s^2], each (M,)


class Timing(Protocol):
    """Maps times to curve parameters."""

    duration: float  # [s]
    continuous: bool  # False: it jumps

    def __call__(self, t: np.ndarray) -> Motion:
        """Return s, s', s'' at times t (M,) [s] in [0, duration]."""


class Uniform:
    """Curve parameter uniform in time, the paper's: fast where the parameter is stretched."""

    continuous = True

    def __init__(self, duration: float) -> None:
        self.duration = duration

    def __call__(self, t: np.ndarray) -> Motion:
        """Return s, s', s'' at times t (M,) [s]."""
        return t / self.duration, np.full_like(t, 1.0 / self.duration), np.zeros_like(t)


class ConstantSpeed:
    """The same speed all along the curve."""

    continuous = True

    def __init__(self, curve: Curve, duration: float) -> None:
        self.duration = duration
        self._curve, self._arc = curve, ArcLength(curve)
        self._speed = self._arc.total / duration

    def __call__(self, t: np.ndarray) -> Motion:
        """Return s, s', s'' at times t (M,) [s]."""
        s = self._arc.parameter(self._speed * t)
        tangent, bend = self._curve(s, 1), self._curve(s, 2)
        norm = np.maximum(np.linalg.norm(tangent, axis=1), 1e-6 * self._arc.total)
        rate = self._speed / norm
        # From |c'(s)| s' = speed, differentiated once more.
        return s, rate, -(rate**2) * np.sum(tangent * bend, axis=1) / norm**2


class RestToRest:
    """Accelerate, cruise, brake: at rest at both ends, within a limit of s' and one of s''."""

    continuous = True

    def __init__(self, rate: float, acceleration: float) -> None:
        self._acceleration = acceleration
        self._rate = min(rate, math.sqrt(acceleration))  # short ways have no cruise
        self._ramp = self._rate / acceleration  # [s]
        self.duration = 1.0 / self._rate + self._ramp

    def __call__(self, t: np.ndarray) -> Motion:
        """Return s, s', s'' at times t (M,) [s]."""
        up, left = np.minimum(t, self._ramp), np.minimum(self.duration - t, self._ramp)
        cruise = np.clip(t - self._ramp, 0.0, self.duration - 2 * self._ramp)
        braked = self._acceleration / 2 * (self._ramp**2 - left**2)
        s = self._acceleration / 2 * up**2 + self._rate * cruise + braked
        sign = (t < self._ramp).astype(float) - (self.duration - t < self._ramp)
        return s, self._acceleration * np.minimum(up, left), self._acceleration * sign


class Jump:
    """At the start until a moment, then at the end."""

    continuous = False

    def __init__(self, time: float, duration: float) -> None:
        self.duration = duration
        self._time = time

    def __call__(self, t: np.ndarray) -> Motion:
        """Return s, s', s'' at times t (M,) [s]."""
        return (t >= self._time).astype(float), np.zeros_like(t), np.zeros_like(t)
