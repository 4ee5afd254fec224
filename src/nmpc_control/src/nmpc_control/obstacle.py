# SPDX-License-Identifier: MIT
"""What must not be touched: one obstacle, where it is expected when, and how surely."""

from dataclasses import dataclass, field
from typing import Optional

import numpy as np

MIN_PATH_DT = 1e-3  # [s] closer points say nothing more
MAX_GROWTH = 3.0  # [m] an obstacle's radius never grows by more than this


@dataclass(frozen=True)
class Obstacle:
    """A sphere, vertical cylinder or axis-aligned box; the hull that must not be touched."""

    id: str
    position: np.ndarray  # (3,) [m] centre at ``stamp``, world frame
    size: np.ndarray  # [m] sphere: (radius,), cylinder: (radius, height), box: (3,) edge lengths
    shape: str = "sphere"
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) [m/s]
    stamp: Optional[float] = None  # [s] time of the position; None: it stands still for ever
    path: Optional[np.ndarray] = None  # (M, 3) [m] centre at stamp + (i + 1) * path_dt
    path_dt: float = 0.0  # [s] spacing of the path, at least MIN_PATH_DT
    growth: float = 0.0  # [m/s] of the radius with the age of the information

    def position_at(self, t: np.ndarray) -> np.ndarray:
        """Return the centre (..., 3) [m] at times (...) [s].

        Along the path where there is one and beyond its end as it went last; before the stamp and
        without a path at constant velocity.
        """
        if self.stamp is None:
            return np.broadcast_to(self.position, (*np.shape(t), 3))
        age = np.asarray(t, dtype=float) - self.stamp
        straight = self.position + age[..., None] * self.velocity
        if self.path is None or not len(self.path):
            return straight
        points = np.concatenate([self.position[None], self.path])
        s = np.maximum(age / self.path_dt, 0.0)
        i = np.minimum(s, len(points) - 2).astype(int)  # as a float first: it may not fit an int
        along = points[i] + (s - i)[..., None] * (points[i + 1] - points[i])
        return np.where((age >= 0.0)[..., None], along, straight)

    def growth_at(self, t: np.ndarray) -> np.ndarray:
        """Return by how much (...) [m] its surface may be farther out at times (...) [s]."""
        if self.stamp is None:
            return np.zeros(np.shape(t))
        age = np.asarray(t, dtype=float) - self.stamp
        return np.clip(self.growth * age, 0.0, MAX_GROWTH)

    def distance(self, points: np.ndarray, t: Optional[np.ndarray] = None) -> np.ndarray:
        """Return the distance [m] from points (..., 3) to the surface, negative inside.

        With times (...) [s] to where it is expected then, as far out as it may be.
        """
        if t is None:
            return surface_distance(np.asarray(points) - self.position, self.shape, self.size)
        offset = np.asarray(points) - self.position_at(t)
        return surface_distance(offset, self.shape, self.size) - self.growth_at(t)


def surface_distance(offset: np.ndarray, shape: str, size: np.ndarray) -> np.ndarray:
    """Return the distance (...) [m] to a surface at offsets (..., 3) [m] from the centre.

    Args:
        offset: (..., 3) [m].
        shape: sphere, cylinder or box.
        size: (..., k) [m] as of ``Obstacle``, may be one row for each offset.
    """
    size = np.asarray(size)
    if shape == "sphere":
        return np.linalg.norm(offset, axis=-1) - size[..., 0]
    if shape == "cylinder":
        beside = np.linalg.norm(offset[..., :2], axis=-1) - size[..., 0]
        q = np.stack([beside, np.abs(offset[..., 2]) - size[..., 1] / 2], axis=-1)
    else:
        q = np.abs(offset) - size / 2
    return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(axis=-1), 0.0)
