# SPDX-License-Identifier: MIT
"""Surfaces of obstacles as grids of points, for drawing."""

import numpy as np

from nmpc_control.state import Obstacle


def surface(obstacle: Obstacle, centre: np.ndarray, margin: float) -> np.ndarray:
    """Return x, y, z (3, n, m) [m] of a sphere, cylinder or box grown by a margin [m]."""
    around, up = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(-1.0, 1.0, 13))
    if obstacle.shape == "sphere":
        level = np.sqrt(1.0 - np.sin(up * np.pi / 2.0) ** 2)
        half = np.full(3, obstacle.size[0] + margin)
        unit = [level * np.cos(around), level * np.sin(around), np.sin(up * np.pi / 2.0)]
    elif obstacle.shape == "cylinder":
        half = np.array([obstacle.size[0], obstacle.size[0], obstacle.size[1] / 2.0]) + margin
        unit = [np.cos(around), np.sin(around), up]
    else:
        half = obstacle.size / 2.0 + margin
        largest = np.maximum(np.abs(np.cos(around)), np.abs(np.sin(around)))
        unit = [np.cos(around) / largest, np.sin(around) / largest, up]
    return centre[:, None, None] + half[:, None, None] * np.array(unit)
