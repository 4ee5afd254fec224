# SPDX-License-Identifier: MIT
"""Which obstacles count where more are known than can be flown among."""

from typing import List, Sequence

import numpy as np

from nmpc_control.obstacle import MAX_GROWTH, Obstacle

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
    reach = np.array([_radius(o) for o in obstacles])
    for i, o in enumerate(obstacles):
        if o.stamp is None:
            continue
        age = max(0.0, t - o.stamp)
        reach[i] += min(o.growth * age, MAX_GROWTH)
        if o.path is not None and len(o.path):
            reach[i] += np.linalg.norm(o.path - o.position, axis=1).max()
        else:
            centres[i] += age * o.velocity
            reach[i] += HORIZON * np.linalg.norm(o.velocity)
    distances = np.linalg.norm(centres - place, axis=1) - reach
    return sorted(map(int, np.argsort(distances, kind="stable")[:count]))


def _radius(o: Obstacle) -> float:
    if o.shape == "sphere":
        return float(o.size[0])
    if o.shape == "cylinder":
        return float(np.hypot(o.size[0], o.size[1] / 2.0))
    return float(np.linalg.norm(o.size) / 2.0)
