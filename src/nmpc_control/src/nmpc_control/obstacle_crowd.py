# SPDX-License-Identifier: MIT
"""Which obstacles count where more are known than can be flown among."""

from typing import List, Sequence

import numpy as np

from nmpc_control.obstacle import MAX_GROWTH, Obstacle
from nmpc_control.obstacle_field import bounding_radius

HORIZON = 1.0  # [s] for which one that moves may come straight on


def nearest(obstacles: Sequence[Obstacle], count: int, place: np.ndarray, t: float) -> List[int]:
    """Return which of the obstacles are nearest to a place, in their order.

    None counts as farther than it is: each is the ball around it, with what it has grown to and
    the way that it makes in a second; one with a path may be anywhere on it.

    Args:
        obstacles: with finite numbers.
        count: [1] how many, at most.
        place: (3,) [m] of the aircraft.
        t: [s] now.
    """
    centres = np.array([o.position for o in obstacles])
    ages = np.array([0.0 if o.stamp is None else max(0.0, t - o.stamp) for o in obstacles])
    moves = np.array([o.stamp is not None for o in obstacles])
    velocities = np.array([o.velocity for o in obstacles]) * moves[:, None]
    growths = np.array([o.growth for o in obstacles])
    reach = np.array([bounding_radius(o) for o in obstacles])
    reach += np.minimum(growths * ages, MAX_GROWTH) + _ways(obstacles, centres)
    has_path = np.array([o.path is not None and len(o.path) > 0 for o in obstacles])
    velocities[has_path] = 0.0
    centres += ages[:, None] * velocities
    reach += HORIZON * np.linalg.norm(velocities, axis=1)
    distances = np.linalg.norm(centres - place, axis=1) - reach
    return sorted(map(int, np.argsort(distances, kind="stable")[:count]))


def _ways(obstacles: Sequence[Obstacle], centres: np.ndarray) -> np.ndarray:
    """Return how far (K,) [m] from where it was each path leads; 0 without one."""
    result = np.zeros(len(obstacles))
    found = [(i, o.path) for i, o in enumerate(obstacles) if o.path is not None and len(o.path)]
    if found:
        which, paths = zip(*found)
        counts = [len(path) for path in paths]
        offsets = np.concatenate(paths) - np.repeat(centres[list(which)], counts, axis=0)
        far = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
        result[list(which)] = np.maximum.reduceat(far, np.cumsum([0, *counts[:-1]]))
    return result
