# SPDX-License-Identifier: MIT
"""Many obstacles as arrays: where all of them are expected, and how far points are from them.

Converted once for each list; hundreds cost little more than one.
"""

import copy
from functools import cached_property
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.obstacle import MAX_GROWTH, MIN_PATH_DT, Obstacle, surface_distance

SHAPES = ("sphere", "cylinder", "box")
ROUND = 1.0  # [m] least radius of a sphere that stands for a flat surface


_ROWS = ("_position", "_velocity", "_stamp", "_growth", "_shape", "_size", "bounding", "inscribed")


class Spheres(NamedTuple):
    """What the solver sees of n obstacles at M times: spheres, or upright lines with a radius."""

    centres: np.ndarray  # (n, M, 3) [m]
    vertical: np.ndarray  # (n, M) weight of the vertical distance: 1 sphere, 0 endless cylinder
    radius: np.ndarray  # (n, M) [m]


class ObstacleField:
    """Obstacles, and their distances from paths in time."""

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        self.obstacles = tuple(obstacles)
        self.ids = tuple(o.id for o in obstacles)
        moving = [o.stamp is not None for o in obstacles]
        self._position = _rows([o.position for o in obstacles])
        self._velocity = _rows(
            [o.velocity if m else np.zeros(3) for o, m in zip(obstacles, moving)]
        )
        self._stamp = np.array([o.stamp if m else 0.0 for o, m in zip(obstacles, moving)])
        self._growth = np.array([o.growth if m else 0.0 for o, m in zip(obstacles, moving)])
        self._paths = [i for i, o in enumerate(obstacles) if moving[i] and o.path is not None]
        self._shape = np.array([SHAPES.index(o.shape) for o in obstacles], dtype=int)
        self._size = np.ones((len(obstacles), 3))
        for row, o in zip(self._size, obstacles):
            row[: len(o.size)] = o.size
        self.bounding = np.array(
            [bounding_radius(o) for o in obstacles]
        )  # (n,) [m] sphere around each
        self.inscribed = np.array([_inscribed(o) for o in obstacles])  # (n,) [m] sphere within each

    def __len__(self) -> int:
        """Return the number of obstacles n."""
        return len(self.ids)

    def part(self, which: np.ndarray) -> "ObstacleField":
        """Return some of them, by their indices (k,), in that order."""
        some = copy.copy(self)
        some.__dict__.pop("unusable", None)
        some.obstacles = tuple(self.obstacles[i] for i in which)
        some.ids = tuple(o.id for o in some.obstacles)
        for name in _ROWS:
            setattr(some, name, getattr(self, name)[which])
        some._paths = [k for k, i in enumerate(which) if i in self._paths]
        return some

    @cached_property
    def unusable(self) -> Tuple[str, ...]:
        """Ids of those that are nowhere, have no size, or a path without a spacing."""
        numbers = np.hstack([self._position, self._velocity, self._size])
        good = np.isfinite(numbers).all(axis=1) & (self._size > 0.0).all(axis=1)
        good &= np.isfinite(self._stamp) & np.isfinite(self._growth)
        for i in self._paths:
            o = self.obstacles[i]
            good[i] &= bool(np.isfinite(o.path).all()) and o.path_dt >= MIN_PATH_DT
        return tuple(name for name, ok in zip(self.ids, good) if not ok)

    @property
    def has_path(self) -> np.ndarray:
        """Which of them (n,) follow a path."""
        result = np.zeros(len(self.ids), dtype=bool)
        result[self._paths] = True
        return result

    @property
    def fastest(self) -> float:
        """The greatest speed [m/s] of any; 0 without obstacles."""
        return float(np.linalg.norm(self._velocity, axis=1).max(initial=0.0))

    def centres(self, times: np.ndarray) -> np.ndarray:
        """Return the centres (n, M, 3) [m] at times (M,) [s]."""
        age = times - self._stamp[:, None]
        result = self._position[:, None] + age[..., None] * self._velocity[:, None]
        for i in self._paths:
            result[i] = self.obstacles[i].position_at(times)
        return result

    def growth(self, times: np.ndarray) -> np.ndarray:
        """Return by how much (n, M) [m] surfaces may be farther out at times (M,) [s]."""
        age = times - self._stamp[:, None]
        return np.clip(self._growth[:, None] * age, 0.0, MAX_GROWTH)

    def distances(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the distances (n, M) [m] of points from surfaces as far out as they may be then.

        Args:
            points: (M, 3) [m].
            times: (M,) [s].
        """
        return self.surface_distances(points, times) - self.growth(times)

    def surface_distances(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the same from the surfaces where they are expected."""
        offset = points - self.centres(times)
        result = np.empty(offset.shape[:2])
        for index, shape in enumerate(SHAPES):
            rows = self._shape == index
            if rows.any():
                result[rows] = surface_distance(offset[rows], shape, self._size[rows, None])
        return result

    def spheres(self, points: np.ndarray, times: np.ndarray) -> Spheres:
        """Return spheres that touch the surfaces where they are nearest to points (M, 3) [m].

        A sphere is itself; beside a cylinder it is the endless one; a flat surface is met by a
        sphere as large as the body behind the nearest point: nearly flat in the middle, and
        passed at the edges.
        """
        centres = self.centres(times)
        radius = self.growth(times) + self._size[:, :1]
        vertical = np.ones(radius.shape)
        offset = points - centres
        beside = self._shape[:, None] == SHAPES.index("cylinder")
        beside = beside & (np.abs(offset[..., 2]) <= self._size[:, 1:2] / 2)
        vertical[beside] = 0.0
        flat = (self._shape[:, None] != SHAPES.index("sphere")) & ~beside
        if flat.any():
            which = np.nonzero(flat)[0]
            nearest, normal = _nearest(offset[flat], self._shape[which], self._size[which])
            extent = np.where(self._shape[which] == SHAPES.index("box"), 0.5, [1.0])
            across = np.maximum(extent * self._size[which].max(axis=1), ROUND)
            centres[flat] += nearest - across[:, None] * normal
            radius[flat] += across - self._size[which, 0]
        return Spheres(centres, vertical, radius)


class FieldOf:
    """Obstacles as arrays, converted once for each tuple of them."""

    def __init__(self) -> None:
        self._given: Optional[Sequence[Obstacle]] = None
        self._field = ObstacleField(())

    def __call__(self, obstacles: Sequence[Obstacle]) -> ObstacleField:
        """Return the arrays of some obstacles."""
        if obstacles is not self._given or not isinstance(obstacles, tuple):
            self._field, self._given = ObstacleField(obstacles), obstacles
        return self._field


def _nearest(
    offset: np.ndarray, shape: np.ndarray, size: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the nearest points (m, 3) on the surfaces of cylinders and boxes, and the normals."""
    half = size / 2
    level = np.linalg.norm(offset[:, :2], axis=1)
    is_box = shape == SHAPES.index("box")
    inside_ring = size[:, 0] / np.maximum(level, size[:, 0])
    nearest = np.where(is_box[:, None], np.clip(offset, -half, half), 0.0)
    ring = ~is_box
    nearest[ring, :2] = offset[ring, :2] * inside_ring[ring, None]
    nearest[ring, 2] = np.clip(offset[ring, 2], -size[ring, 1] / 2, size[ring, 1] / 2)
    away = offset - nearest
    length = np.linalg.norm(away, axis=1)
    normal = away / np.maximum(length, 1e-9)[:, None]
    within = np.nonzero(length < 1e-9)[0]  # of a body: out by the nearest face
    for i in within:
        reach = half[i] if is_box[i] else np.array([np.inf, np.inf, size[i, 1] / 2])
        axis = int(np.argmin(reach - np.abs(offset[i])))
        normal[i] = 0.0
        normal[i, axis] = 1.0 if offset[i, axis] >= 0.0 else -1.0
        nearest[i, axis] = normal[i, axis] * reach[axis]
    return nearest, normal


def bounding_radius(o: Obstacle) -> float:
    """Return the radius [m] of the sphere around an obstacle."""
    if o.shape == "sphere":
        return float(o.size[0])
    return float(
        np.linalg.norm(o.size) / 2 if o.shape == "box" else np.hypot(o.size[0], o.size[1] / 2)
    )


def _inscribed(o: Obstacle) -> float:
    if o.shape == "sphere":
        return float(o.size[0])
    return float(min(o.size) / 2 if o.shape == "box" else min(o.size[0], o.size[1] / 2))


def _rows(vectors: List[np.ndarray]) -> np.ndarray:
    return np.array(vectors, dtype=float).reshape(-1, 3)
