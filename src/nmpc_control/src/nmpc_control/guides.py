# SPDX-License-Identifier: MIT
"""Ways round what stands on the reference: to the right, the left, over, under, and between these.

A way is the reference pushed out of all obstacles in one direction. The solver starts from there,
because from a way that runs into an obstacle it cannot tell one side from the other.
"""

from typing import List, Optional

import numpy as np

from nmpc_control.obstacle_field import Spheres

SIDES = 8
_ROUNDS = 8  # of pushing and smoothing; a way that is not clear then is none
_PUSHES = 12  # spheres that may stand behind one another
_FARTHEST = 15.0  # [m] a way that leads farther off is none
_EASE = 1.0  # [s] in which the way leads from the aircraft to the reference
_BEYOND = 0.05  # [m] outside the surfaces


def sides(travel: np.ndarray) -> np.ndarray:
    """Return unit vectors (SIDES, 3) across a direction of travel (3,): right, left, over, ..."""
    length = float(np.linalg.norm(travel))
    ahead = travel / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    level = float(np.linalg.norm(right))
    right = right / level if level > 0.2 else np.array([0.0, -1.0, 0.0])
    over = np.cross(right, ahead)
    over /= np.linalg.norm(over)
    r = np.sqrt(0.5)
    mixed = [(r, r), (-r, r), (r, -r), (-r, -r)]
    return np.array([right, -right, over, -over, *[a * right + b * over for a, b in mixed]])


def eased(reference: np.ndarray, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the reference (M, 3) led smoothly away from a start (3,) [m] at times (M,) [s]."""
    fade = np.exp(-(times - times[0]) / _EASE)
    return reference + fade[:, None] * (start - reference[0])


def conflicts(spheres: Spheres, margin: float, path: np.ndarray) -> np.ndarray:
    """Return for each sphere whether (n,) a path (M, 3) [m] enters its margin [m]."""
    offset = path - spheres.centres
    squared = offset[..., 0] ** 2 + offset[..., 1] ** 2 + spheres.vertical * offset[..., 2] ** 2
    return (squared < (spheres.radius + margin) ** 2).any(axis=1)


def way_round(
    spheres: Spheres, margin: float, path: np.ndarray, side: np.ndarray, slope: float
) -> Optional[np.ndarray]:
    """Return a path (M, 3) [m] pushed out of all margins to one side; None where none is near.

    Args:
        spheres: n obstacles at the M times.
        margin: [m] to keep from their surfaces.
        path: (M, 3) [m].
        side: (3,) unit vector.
        slope: [m] by which the push may change from one time to the next.
    """
    steps = np.arange(len(path))
    apart = slope * np.abs(steps[:, None] - steps)
    push = np.zeros(len(path))
    reach = spheres.radius + margin + _BEYOND
    for _ in range(_ROUNDS):
        out = _pushed_out(spheres, reach, path, side, push)
        if not out.max() < _FARTHEST:
            return None
        smooth = (out - apart).max(axis=1)
        if np.all(smooth < push + _BEYOND / 2.0):  # never less: each round pushes on
            return path + smooth[:, None] * side
        push = smooth
    return None


def _pushed_out(
    spheres: Spheres, reach: np.ndarray, path: np.ndarray, side: np.ndarray, push: np.ndarray
) -> np.ndarray:
    """Return the least push (M,) [m] from the given one on that leaves all spheres."""
    offset = path - spheres.centres
    w = spheres.vertical
    a = side[0] ** 2 + side[1] ** 2 + w * side[2] ** 2
    b = offset[..., 0] * side[0] + offset[..., 1] * side[1] + w * offset[..., 2] * side[2]
    c = offset[..., 0] ** 2 + offset[..., 1] ** 2 + w * offset[..., 2] ** 2 - reach**2
    root = b**2 - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.sqrt(np.maximum(root, 0.0))
        enter, leave = (-b - half) / a, (-b + half) / a
    parallel = a < 1e-9  # an endless cylinder is not passed along its axis
    enter = np.where(parallel, np.where(c < 0.0, -np.inf, np.inf), enter)
    leave = np.where(parallel, np.where(c < 0.0, np.inf, -np.inf), leave)
    missed = (root <= 0.0) & ~parallel
    enter[missed], leave[missed] = np.inf, -np.inf
    push = push.copy()
    for _ in range(_PUSHES):
        inside = (enter < push - 1e-9) & (push + 1e-9 < leave) | (enter <= push) & (push < leave)
        if not inside.any():
            return push
        push = np.maximum(push, np.where(inside, leave, -np.inf).max(axis=0))
    return np.full(len(push), np.inf)


class Turns:
    """Which sides are tried in which tick, so that all have their turn."""

    def __init__(self) -> None:
        self._next = 0

    def take(self, count: int) -> List[int]:
        """Return the indices of the next sides."""
        chosen = [(self._next + i) % SIDES for i in range(min(count, SIDES))]
        self._next = (self._next + count) % SIDES
        return chosen
