# SPDX-License-Identifier: MIT
"""Surfaces of obstacles as grids of points, for drawing."""

from typing import Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle

_WITH_ENDS = 1.1  # stretches the heights so that two rows lie at each end


def surface(
    obstacle: Obstacle, centre: np.ndarray, margin: float, points: Tuple[int, int] = (25, 13)
) -> np.ndarray:
    """Return x, y, z (3, n, m) [m] of a sphere, cylinder or box grown by a margin [m].

    ``points`` are the numbers of points around it and from its bottom to its top.
    """
    heights = np.clip(np.linspace(-1.0, 1.0, points[1]) * _WITH_ENDS, -1.0, 1.0)
    around, up = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, points[0]), heights)
    closed = np.ones_like(up)
    closed[[0, -1]] = 0.0  # the first and last rows close bottom and top
    if obstacle.shape == "sphere":
        level = np.sqrt(1.0 - np.sin(up * np.pi / 2.0) ** 2)
        half = np.full(3, obstacle.size[0] + margin)
        unit = [level * np.cos(around), level * np.sin(around), np.sin(up * np.pi / 2.0)]
    elif obstacle.shape == "cylinder":
        half = np.array([obstacle.size[0], obstacle.size[0], obstacle.size[1] / 2.0]) + margin
        unit = [closed * np.cos(around), closed * np.sin(around), up]
    else:
        half = obstacle.size / 2.0 + margin
        largest = np.maximum(np.abs(np.cos(around)), np.abs(np.sin(around)))
        unit = [closed * np.cos(around) / largest, closed * np.sin(around) / largest, up]
    return centre[:, None, None] + half[:, None, None] * np.array(unit)
