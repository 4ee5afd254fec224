# SPDX-License-Identifier: MIT
"""Which obstacles fill the slots of the problem, and what the solver is told of them.

Those come in that the aircraft would meet first. One that stays keeps its slot, so that multipliers
of the last solution still belong to it.
"""

import copy
from dataclasses import replace
from typing import List, Optional, Sequence

import numpy as np

from nmpc_control import constraints
from nmpc_control.errors import ProblemError
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import FieldOf, ObstacleField
from nmpc_control.ocp import EMPTY_SLOT, SLOT_SIZE
from nmpc_control.solution import Guess

_EXPECTED = 0.75  # of the slots are for what is near the expected path
_LATER = 0.3  # [m/s] a conflict this much later weighs as much as a metre more of clearance


class Slots:
    """The obstacles of the last message as arrays, and who sits where."""

    def __init__(self, count: int) -> None:
        """Begin with ``count`` empty slots."""
        self.left_out = 0  # obstacles in reach of the paths that found no slot
        self.renewed: List[int] = []  # slots that were given to another obstacle last
        self.field = ObstacleField(())
        self.occupants: List[Optional[str]] = [None] * count
        self.field_of = FieldOf()

    def fill(
        self,
        obstacles: Sequence[Obstacle],
        times: np.ndarray,
        paths: Sequence[np.ndarray],
        margin: float,
        reach: float = 0.0,
        between: bool = True,
    ) -> np.ndarray:
        """Return slot data (slots, N + 1, 5), see ``ocp.SLOT_SIZE``.

        Between two stages that keep a distance s the straight way may come as near as the root of
        s^2 less the square of half the way; that is what the distances at the stages are raised by.

        Args:
            obstacles: any number.
            times: (N + 1,) [s] of the stages.
            paths: each (N + 1, 3) [m] where the aircraft may be at them, the expected one first.
            margin: [m] least distance of the centre from an obstacle's surface.
            reach: [m] beyond the margin within which an obstacle counts as in reach.
            between: whether the margin is to hold between the stages, too.

        Raises:
            ProblemError: an obstacle that is nowhere or has no size.
        """
        self.field = self.field_of(obstacles)
        if self.field.unusable:
            raise ProblemError(
                f"obstacle {self.field.unusable[0]}: expected numbers that are finite, and a size "
                "of more than 0"
            )
        self.left_out = 0
        data = np.tile(EMPTY_SLOT, (len(self.occupants), len(times), 1))
        if not len(self.field):
            self._seat([])
            return data
        distances = [self.field.distances(path, times) for path in paths]
        later = _LATER * (times - times[0])
        conflicts = np.array([(d + later).min(axis=1) for d in distances])
        order = _order(conflicts, int(_EXPECTED * len(self.occupants)))
        chosen, rest = order[: len(self.occupants)], order[len(self.occupants) :]
        nearest = np.min([d[rest].min(axis=1) for d in distances], axis=0)
        self.left_out = int(np.sum(nearest < margin + reach))
        self._seat([self.field.ids[i] for i in chosen])
        spheres = self.field.part(chosen).spheres(paths[0], times)
        half = _half_ways(paths[0], spheres.centres) if between else 0.0
        rows = [self.occupants.index(self.field.ids[i]) for i in chosen]
        data[rows, :, :3] = spheres.centres
        data[rows, :, 3] = spheres.vertical
        data[rows, :, 4] = 1.0 / np.hypot(spheres.radius + margin, half)
        return data

    def forgotten(self, guess: Guess) -> Guess:
        """Return the guess without the multipliers of obstacles that have left their slots."""
        if guess.multipliers is None or not self.renewed:
            return guess
        multipliers = guess.multipliers.copy()
        multipliers[:, [constraints.PILOT_BOUNDS + slot for slot in self.renewed]] = 0.0
        return replace(guess, multipliers=multipliers)

    def copy(self) -> "Slots":
        """Return the same obstacles in the same seats, to be filled on their own."""
        other = copy.copy(self)
        other.occupants = list(self.occupants)
        return other

    def _seat(self, chosen: List[str]) -> None:
        """Give the chosen ones a slot each; those that had one keep it."""
        staying, self.renewed = set(chosen), []
        seated = [name if name in staying else None for name in self.occupants]
        free = [i for i, name in enumerate(seated) if name is None]
        taken = set(seated)
        for name in chosen:
            if name not in taken:
                slot = free.pop(0)
                seated[slot] = name
                self.renewed.append(slot)
        self.occupants = seated


def _order(conflicts: np.ndarray, first: int) -> np.ndarray:
    """Return obstacles (n,) in the order of choice, given their conflicts (paths, n) [m].

    The first ones for the expected path: behind a wall of many, those on the reference would take
    all slots, and nothing would keep the way round from cutting the corner.
    """
    expected = np.argsort(conflicts[0], kind="stable")[:first]
    others = np.argsort(conflicts.min(axis=0), kind="stable")
    return np.concatenate([expected, others[~np.isin(others, expected)]])


def _half_ways(path: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return half of the longer way (n, M) [m] to the stages before and after."""
    ways = np.linalg.norm(np.diff(path - centres, axis=1), axis=2) / 2.0
    longest = np.zeros(centres.shape[:2])
    longest[:, 1:] = ways
    longest[:, :-1] = np.maximum(longest[:, :-1], ways)
    return longest


def clearance(slots: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return how far (n, M) [m] positions (M, 3) are from where the terms of slots begin.

    Args:
        slots: (n, M, SLOT_SIZE) data.
        positions: (M, 3) [m].
    """
    offset = (positions - slots[..., :3]) ** 2
    offset[..., 2] *= slots[..., 3]
    return np.sqrt(offset.sum(axis=-1)) - 1.0 / slots[..., SLOT_SIZE - 1]
