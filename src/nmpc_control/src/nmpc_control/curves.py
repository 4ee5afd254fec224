# SPDX-License-Identifier: MIT
"""Curves in space over a parameter s in [0, 1], and their arc length."""

from typing import Protocol

import numpy as np

from nmpc_control.errors import NmpcError

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_CELLS_PER_SPAN = (
    24  # of the length table; 8-point Gauss in each, then Newton, leaves ~1e-9 relative
)


class CurveError(NmpcError):
    """No curve or trajectory can be made of an argument: its name, value, what was expected."""

    def __init__(self, argument: str, value: object, expected: str) -> None:
        super().__init__(f"{argument}: got {value!r}, expected {expected}")
        self.argument, self.value, self.expected = argument, value, expected


class Curve(Protocol):
    """A curve c(s), smooth between its breaks, where derivatives are those of the right side."""

    breaks: np.ndarray  # (m,) increasing from 0 to 1

    def __call__(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return the point or derivative 0, 1 or 2 (M, 3) at parameters s (M,)."""


class Segment:
    """The straight line from one point to another; a point when both are the same."""

    breaks = np.array([0.0, 1.0])

    def __init__(self, start: np.ndarray, end: np.ndarray) -> None:
        self.start = np.array(start, float)
        self.end = np.array(end, float)

    def __call__(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return the point or a derivative (M, 3) at parameters s (M,)."""
        s = np.atleast_1d(s)[:, None]
        if derivative == 0:
            return self.start + s * (self.end - self.start)
        return np.ones_like(s) * (self.end - self.start) * (derivative == 1)


class Sinusoids:
    """``center + sum_h (cosines[h] cos(h a) + sines[h] sin(h a))`` with ``a = start + turn s``."""

    def __init__(
        self, center: np.ndarray, cosines: np.ndarray, sines: np.ndarray, start: float, turn: float
    ) -> None:
        self.center = np.array(center, float)  # (3,) [m]
        self.cosines = np.array(cosines, float)  # (H, 3) [m] of harmonics 1..H
        self.sines = np.array(sines, float)  # (H, 3) [m]
        self.start, self.turn = start, turn  # [rad]
        self.breaks = np.linspace(0.0, 1.0, 1 + max(4, int(abs(turn))))

    def __call__(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return the point or a derivative (M, 3) at parameters s (M,)."""
        harmonics = np.arange(1, len(self.cosines) + 1)
        # Each derivative of cos and sin turns the phase by a quarter.
        angle = (
            np.outer(self.start + self.turn * np.atleast_1d(s), harmonics) + derivative * np.pi / 2
        )
        scale = (self.turn * harmonics) ** derivative
        wave = (np.cos(angle) * scale) @ self.cosines + (np.sin(angle) * scale) @ self.sines
        return wave + self.center if derivative == 0 else wave


def circle(center: np.ndarray, radius: float, start: float = 0.0, turns: float = 1.0) -> Sinusoids:
    """Return a level circle, counter-clockwise from an angle [rad]; negative turns: clockwise."""
    return Sinusoids(center, [[radius, 0, 0]], [[0, radius, 0]], start, 2 * np.pi * turns)


def lemniscate(center: np.ndarray, width: float, height: float) -> Sinusoids:
    """Return the figure eight ``center + (width sin a, width sin a cos a, height cos a)``."""
    cosines = [[0, 0, height], [0, 0, 0]]
    sines = [[width, 0, 0], [0, width / 2, 0]]  # sin a cos a = sin(2 a) / 2
    return Sinusoids(center, cosines, sines, 0.0, 2 * np.pi)


class ArcLength:
    """Length along a curve as a function of its parameter, and the inverse."""

    def __init__(self, curve: Curve) -> None:
        self._curve = curve
        steps = np.arange(_CELLS_PER_SPAN) / _CELLS_PER_SPAN
        spans = curve.breaks[:-1, None] + np.diff(curve.breaks)[:, None] * steps
        self._s = np.append(spans.ravel(), 1.0)
        cells = self._integrate(self._s[:-1], self._s[1:])
        self._length = np.concatenate([[0.0], np.cumsum(cells)])
        self.total = float(self._length[-1])  # [m]

    def at(self, s: np.ndarray) -> np.ndarray:
        """Return the length [m] from the start to parameters s (M,)."""
        s = np.atleast_1d(np.asarray(s, float))
        cell = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._s) - 2)
        return self._length[cell] + self._integrate(self._s[cell], s)

    def parameter(self, length: np.ndarray) -> np.ndarray:
        """Return the parameters (M,) at lengths (M,) [m] from the start, clipped to the curve."""
        length = np.clip(np.atleast_1d(np.asarray(length, float)), 0.0, self.total)
        cell = np.searchsorted(self._length, length, side="right") - 1
        cell = np.clip(cell, 0, len(self._s) - 2)
        low, high = self._s[cell], self._s[cell + 1]
        s = np.interp(length, self._length, self._s)
        for _ in range(2):
            speed = np.maximum(self._speed(s), 1e-9 * max(self.total, 1e-9))
            missing = length - self._length[cell] - self._integrate(low, s)
            s = np.clip(s + missing / speed, low, high)
        return s

    def _speed(self, s: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self._curve(s, 1), axis=-1)

    def _integrate(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        half = (high - low) / 2
        nodes = (low + half)[:, None] + half[:, None] * _NODES
        return half * (self._speed(nodes.ravel()).reshape(nodes.shape) @ _WEIGHTS)
