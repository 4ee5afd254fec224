# SPDX-License-Identifier: MIT
"""A flight from rest to rest as uniform cubic B-spline: piecewise constant jerk.

With SEGMENTS segments of ``h`` [s]; the first three control points are the start and the last three
the end, so that velocity and acceleration vanish there. Basis: C. de Boor, A Practical Guide to
Splines, Springer 2001, ch. IX, for equidistant knots.
"""

from typing import Tuple

import numpy as np

SEGMENTS = 64
POINTS = SEGMENTS + 3  # control points
CLAMPED = 3  # at either end

_BASIS = (  # rows: powers 0..3 of the local parameter; columns: the four control points
    np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], dtype=float) / 6.0
)


def matrices(local: np.ndarray) -> Tuple[np.ndarray, ...]:
    """Return four matrices (SEGMENTS * m, POINTS): value and three derivatives by the parameter.

    Args:
        local: (m,) places 0..1 within each segment.

    Returns:
        Times the control points (POINTS, 3) they give position, velocity * h, acceleration * h^2,
        jerk * h^3, segment by segment.
    """
    u = np.asarray(local, dtype=float)
    one, zero = np.ones_like(u), np.zeros_like(u)
    powers = (
        np.stack([one, u, u**2, u**3], axis=1),
        np.stack([zero, one, 2 * u, 3 * u**2], axis=1),
        np.stack([zero, zero, 2 * one, 6 * u], axis=1),
        np.stack([zero, zero, zero, 6 * one], axis=1),
    )
    result = []
    for rows in powers:
        matrix = np.zeros((SEGMENTS * len(u), POINTS))
        for i in range(SEGMENTS):
            matrix[i * len(u) : (i + 1) * len(u), i : i + 4] = rows @ _BASIS
        result.append(matrix)
    return tuple(result)


def times(local: np.ndarray, h: float) -> np.ndarray:
    """Return the times (SEGMENTS * m,) [s] of the rows of ``matrices``."""
    return h * np.add.outer(np.arange(SEGMENTS), np.asarray(local, dtype=float)).ravel()


def through(path: np.ndarray) -> np.ndarray:
    """Return control points (POINTS, 3) close to a path (n, 3) [m] evenly spaced in time."""
    where = np.linspace(0.0, len(path) - 1.0, SEGMENTS + 1)
    points = np.stack([np.interp(where, np.arange(len(path)), axis) for axis in path.T], axis=1)
    points = np.concatenate([points[:1], points, points[-1:]])
    points[:CLAMPED], points[-CLAMPED:] = path[0], path[-1]
    return points
