# SPDX-License-Identifier: MIT
"""Yaw as a function of the curve parameter s: psi(s) [rad] and its derivative, never wrapped."""

from typing import Protocol, Tuple

import numpy as np

from nmpc_control.bspline import BSpline
from nmpc_control.curves import Curve

_LEVEL_FRACTION = 1e-3  # a tangent with a smaller level part than this has no direction
_SAMPLES_PER_SPAN = 50


class Heading(Protocol):
    """Maps curve parameters to yaw."""

    def __call__(self, s: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return yaw [rad] and d yaw / d s [rad], each (M,), at parameters s (M,)."""


class LinearHeading:
    """From one yaw to another [rad] in proportion to s."""

    def __init__(self, start: float, end: float) -> None:
        self.start, self.end = start, end

    def __call__(self, s: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return yaw [rad] and d yaw / d s [rad], each (M,), at parameters s (M,)."""
        turn = self.end - self.start
        return self.start + turn * s, np.full_like(s, turn)


class SplineHeading:
    """A one-column B-spline."""

    def __init__(self, spline: BSpline) -> None:
        self._spline = spline

    def __call__(self, s: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return yaw [rad] and d yaw / d s [rad], each (M,), at parameters s (M,)."""
        return self._spline(s)[:, 0], self._spline(s, 1)[:, 0]


class TangentHeading:
    """Along the curve; where that is (almost) vertical or still, the last direction is held."""

    def __init__(self, curve: Curve) -> None:
        self._curve = curve
        steps = np.arange(_SAMPLES_PER_SPAN) / _SAMPLES_PER_SPAN
        spans = curve.breaks[:-1, None] + np.diff(curve.breaks)[:, None] * steps
        self._s = np.append(spans.ravel(), 1.0)
        tangent = curve(self._s, 1)
        self._least = _LEVEL_FRACTION * np.linalg.norm(tangent, axis=1).max()
        moving = np.hypot(tangent[:, 0], tangent[:, 1]) > self._least
        self._yaw = np.zeros_like(self._s)
        if moving.any():
            last = np.maximum.accumulate(
                np.where(moving, np.arange(len(moving)), np.argmax(moving))
            )
            self._yaw = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0])[last])

    def __call__(self, s: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return yaw [rad] and d yaw / d s [rad], each (M,), at parameters s (M,)."""
        held = self._yaw[
            np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._s) - 1)
        ]
        tangent, bend = self._curve(s, 1), self._curve(s, 2)
        level = tangent[:, 0] ** 2 + tangent[:, 1] ** 2
        moving = level > self._least**2
        exact = np.arctan2(tangent[:, 1], tangent[:, 0])
        yaw = exact + 2 * np.pi * np.round((held - exact) / (2 * np.pi))
        slope = tangent[:, 0] * bend[:, 1] - tangent[:, 1] * bend[:, 0]
        slope = slope / np.where(moving, level, 1.0)
        return np.where(moving, yaw, held), np.where(moving, slope, 0.0)
