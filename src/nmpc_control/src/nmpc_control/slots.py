# SPDX-License-Identifier: MIT
"""Which obstacles fill the slots of the problem: those that come nearest to the expected path."""

from typing import List, Optional, Sequence

import numpy as np

from nmpc_control.errors import ProblemError
from nmpc_control.obstacle import Obstacle
from nmpc_control.ocp import SLOT_SIZE


class Slots:
    """Obstacles as arrays; a message of hundreds is converted once and used for many solves."""

    def __init__(self) -> None:
        self._obstacles: Optional[Sequence[Obstacle]] = None
        self.left_out = 0  # obstacles in reach of the path that found no slot

    def fill(
        self,
        obstacles: Sequence[Obstacle],
        times: np.ndarray,
        path: np.ndarray,
        margin: float,
        count: int,
    ) -> np.ndarray:
        """Return slot data (at most count, N + 1, 5), see ``ocp.SLOT_SIZE``, nearest first.

        Args:
            obstacles: any number; a box counts as the sphere around it.
            times: (N + 1,) [s] of the stages.
            path: (N + 1, 3) [m] where the aircraft is expected at them.
            margin: [m] least distance from an obstacle's surface.
            count: number of slots.

        Raises:
            ProblemError: an obstacle that is nowhere or has no size.
        """
        if obstacles is not self._obstacles or not isinstance(obstacles, tuple):
            self._convert(obstacles)
        self.left_out = 0
        if not len(obstacles):
            return np.empty((0, len(times), SLOT_SIZE))
        age = times - self._stamp[:, None]
        centres = self._position[:, None] + age[..., None] * self._velocity[:, None]
        offset = path - centres
        offset[..., 2] *= self._vertical[:, None]
        nearest = np.sqrt(np.einsum("ijk,ijk->ij", offset, offset).min(axis=1)) - self._radius
        order = np.argsort(nearest, kind="stable")
        chosen = order[:count]
        self.left_out = int(np.sum(nearest[order[count:]] < margin))
        data = np.empty((len(chosen), len(times), SLOT_SIZE))
        data[..., :3] = centres[chosen]
        data[..., 3] = self._vertical[chosen, None]
        data[..., 4] = 1.0 / (self._radius[chosen, None] + margin)
        return data

    def _convert(self, obstacles: Sequence[Obstacle]) -> None:
        self._obstacles = None
        for o in obstacles:
            numbers = np.concatenate([o.position, o.velocity, o.size])
            if not np.all(np.isfinite(numbers)) or not np.all(np.asarray(o.size) > 0.0):
                raise ProblemError(
                    f"obstacle {o.id}: got position {o.position}, velocity {o.velocity}, size "
                    f"{o.size}, expected numbers that are finite, and a size of more than 0"
                )
        self._obstacles = obstacles
        moving = [o.stamp is not None for o in obstacles]
        zero = np.zeros(3)
        self._position = _rows([o.position for o in obstacles])
        self._velocity = _rows([o.velocity if m else zero for o, m in zip(obstacles, moving)])
        self._stamp = np.array([o.stamp if m else 0.0 for o, m in zip(obstacles, moving)])
        self._vertical = np.array([o.shape != "cylinder" for o in obstacles], dtype=float)
        self._radius = np.array(
            [
                0.5 * float(np.linalg.norm(o.size)) if o.shape == "box" else float(o.size[0])
                for o in obstacles
            ]
        )


def clearance(slots: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return how far (n,) [m] a position (3,) is from where the terms of slots (n, 5) begin."""
    offset = (position - slots[:, :3]) ** 2
    offset[:, 2] *= slots[:, 3]
    return np.sqrt(offset.sum(axis=1)) - 1.0 / slots[:, 4]


def _rows(vectors: List[np.ndarray]) -> np.ndarray:
    return np.array(vectors, dtype=float).reshape(-1, 3)
