# SPDX-License-Identifier: MIT
"""Where a point of limited speed can be when, on a grid in space and time: a start for the optimum.

A cell counts as free when its centre is: gaps narrower than a cell are missed, the optimum's other
starts look for those.
"""

from typing import Optional

import numpy as np
from scipy.ndimage import binary_dilation, generate_binary_structure

from uav_sim.closed_loop.campaign.way import Spheres

CELL = 0.4  # [m]
AROUND = 4.0  # [m] of grid beyond start, end and the spheres that stand
_MOST = 12.0  # [m] of grid to the side and above at most
_NEIGHBOURS = generate_binary_structure(3, 3)


def way_through(
    length: float, duration: float, spheres: Spheres, speed: float
) -> Optional[np.ndarray]:
    """Return a path (n, 3) [m], even in time, along the leg and around the spheres, or None.

    Args:
        length: [m] of the leg, from the origin along x.
        duration: [s] to be at the end.
        spheres: to be passed.
        speed: [m/s] along one axis at most.
    """
    cells = np.ceil(np.array([length + 2 * AROUND, 2 * _MOST, 2 * _MOST]) / CELL).astype(int)
    corner = np.array([-AROUND, -_MOST, -_MOST])
    # the end of the leg lies on a cell's centre as the start does
    axes = [low + CELL * np.arange(n) for low, n in zip(corner, cells)]
    start, end = (np.rint((point - corner) / CELL).astype(int) for point in _ends(length))
    steps = int(np.ceil(duration * speed / CELL))
    times = np.linspace(0.0, duration, steps + 1)
    is_static = not spheres.velocities.any()
    free = _free(axes, spheres, 0.0)
    reached = np.zeros(cells, dtype=bool)
    reached[tuple(start)] = True
    history = [reached]
    for t in times[1:]:
        if not is_static:
            free = _free(axes, spheres, t)
        grown = binary_dilation(reached, _NEIGHBOURS) & free
        if is_static and grown[tuple(end)]:
            history.append(grown)
            break
        reached = grown
        history.append(reached)
    if not history[-1][tuple(end)]:
        return None
    indices = _back(history, end, start)
    return np.concatenate(
        [_ends(length)[:1], corner + CELL * indices[1:-1], _ends(length)[1:]], axis=0
    )


def _ends(length: float) -> np.ndarray:
    return np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])


def _free(axes: list, spheres: Spheres, t: float) -> np.ndarray:
    """Return which cells are free at a time [s], looking only around each sphere."""
    free = np.ones([len(axis) for axis in axes], dtype=bool)
    for center, gap in zip(spheres.at(np.array([t]))[:, 0], spheres.gaps):
        low = [np.searchsorted(axis, c - gap) for axis, c in zip(axes, center)]
        high = [np.searchsorted(axis, c + gap, "right") for axis, c in zip(axes, center)]
        box = tuple(slice(a, b) for a, b in zip(low, high))
        x, y, z = (axis[part] - c for axis, part, c in zip(axes, box, center))
        free[box] &= x[:, None, None] ** 2 + y[None, :, None] ** 2 + z**2 > gap**2
    return free


def _back(history: list, end: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the cells (n, 3) from start to end, each step to the one nearest to the start."""
    index, path = end, [end]
    offsets = np.argwhere(_NEIGHBOURS) - 1
    for reached in reversed(history[:-1]):
        near = index + offsets
        near = near[((near >= 0) & (near < reached.shape)).all(axis=1)]
        near = near[reached[tuple(near.T)]]
        index = near[np.argmin(np.linalg.norm(near - start, axis=1))]
        path.append(index)
    return np.array(path[::-1])
