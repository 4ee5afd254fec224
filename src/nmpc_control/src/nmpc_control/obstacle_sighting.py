# SPDX-License-Identifier: MIT
"""One entry of a list of obstacles as it was received, and what may be wrong with it.

Plain numbers: entries are compared and judged by the hundred beside a 50 Hz loop.
"""

import math
from typing import NamedTuple, Sequence, Tuple

import numpy as np

from nmpc_control.obstacle import MIN_PATH_DT, Obstacle

MAX_OBSTACLES = 256  # [1] in one list, and known at a time
MAX_ID = 64  # [1] characters
MAX_REACH = 1e5  # [m] from the origin
MAX_SIZE = 1e4  # [m]
MAX_SPEED = 50.0  # [m/s]
MAX_GROWTH_RATE = 50.0  # [m/s]
MAX_PATH = 200  # [1] points
LENGTHS = {"sphere": 1, "cylinder": 2, "box": 3}  # of size


class Sighting(NamedTuple):
    """What a sender says of one obstacle; nothing is believed yet."""

    id: str
    shape: str  # sphere, cylinder or box; anything else is unknown
    size: Tuple[float, ...]  # [m] as of ``Obstacle``
    position: Tuple[float, ...]  # (3,) [m] at ``stamp``
    velocity: Tuple[float, ...] = (0.0, 0.0, 0.0)  # (3,) [m/s]
    path: Tuple[float, ...] = ()  # (3 M,) [m] x, y, z of centres at stamp + (i + 1) * path_dt
    path_dt: float = 0.0  # [s]
    growth: float = 0.0  # [m/s]
    stamp: float = 0.0  # [s]

    @property
    def moves(self) -> bool:
        """Whether it has a velocity or a path; one that has neither never ages."""
        return bool(self.path) or any(self.velocity)


def fault(s: Sighting) -> str:
    """Return in a word or two what makes an entry unusable, times apart; empty if nothing does."""
    if not s.id or len(s.id) > MAX_ID or not s.id.isprintable():
        return "id"
    if s.shape not in LENGTHS:
        return "shape"
    if not all(map(math.isfinite, (*s.position, *s.velocity, *s.size, s.path_dt, s.growth))):
        return "not finite"
    if len(s.size) != LENGTHS[s.shape] or not all(0.0 < length <= MAX_SIZE for length in s.size):
        return "size"
    if not all(-MAX_REACH <= x <= MAX_REACH for x in s.position):
        return "position"
    if math.hypot(*s.velocity) > MAX_SPEED:
        return "speed"
    if not 0.0 <= s.growth <= MAX_GROWTH_RATE:
        return "growth"
    return "path" if s.path and not _path_is_sound(s) else ""


def _path_is_sound(s: Sighting) -> bool:
    if len(s.path) > 3 * MAX_PATH or len(s.path) % 3 or s.path_dt < MIN_PATH_DT:
        return False
    points = np.array((*s.position, *s.path)).reshape(-1, 3)
    if not (np.abs(points) <= MAX_REACH).all():  # NaN is not either
        return False
    steps = np.diff(points, axis=0)
    longest = MAX_SPEED * s.path_dt
    return bool((np.einsum("ij,ij->i", steps, steps) <= longest * longest).all())


def to_obstacle(s: Sighting, name: str) -> Obstacle:
    """Return a sound entry as an obstacle of a name; one that stands still carries no time."""
    if not s.moves:
        return Obstacle(name, np.array(s.position), np.array(s.size), s.shape)
    return Obstacle(
        id=name,
        position=np.array(s.position),
        size=np.array(s.size),
        shape=s.shape,
        velocity=np.array(s.velocity),
        stamp=s.stamp,
        path=np.array(s.path).reshape(-1, 3) if s.path else None,
        path_dt=s.path_dt,
        growth=s.growth,
    )


def moved(s: Sighting, R: np.ndarray, offset: Sequence[float]) -> Sighting:
    """Return a sound entry in another frame.

    A box becomes the axis-aligned one around it, a cylinder the upright one around it.

    Args:
        s: as received.
        R: (3, 3) rotation from its frame to the other one.
        offset: (3,) [m] origin of its frame in the other one.
    """
    size = s.size
    if s.shape == "box":
        size = tuple(map(float, np.abs(R) @ s.size))
    elif s.shape == "cylinder":
        upright, tilt = abs(R[2, 2]), math.hypot(R[0, 2], R[1, 2])
        radius, height = s.size
        size = (radius + height / 2 * tilt, float(height * upright + 2 * radius * tilt))
    path = np.array(s.path).reshape(-1, 3) @ R.T + offset
    return s._replace(
        size=size,
        position=tuple(map(float, R @ s.position + offset)),
        velocity=tuple(map(float, R @ s.velocity)),
        path=tuple(map(float, path.ravel())),
    )
