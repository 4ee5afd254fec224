# SPDX-License-Identifier: MIT
"""What surrounds the aircraft: obstacles, and the record of how near its hull came to them.

A collision is recorded, not simulated: the aircraft flies on. The ground is the plant's matter.
"""

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

from uav_sim.obstacle import Obstacle, Vector, load_obstacles


class Collision(NamedTuple):
    """One contact of the hull with an obstacle."""

    id: str
    t: float  # [s] of the least distance within the step in which the contact began
    clearance: float  # [m] hull to surface at that time, below zero


class _Watch:
    """How one obstacle has been approached."""

    def __init__(self, obstacle: Obstacle) -> None:
        self.obstacle = obstacle
        self.nearest = math.inf  # [m] least distance centre to surface so far
        self.bound = -math.inf  # [m] the present distance is at least this
        self.touching = False
        self.speed = math.hypot(*obstacle.velocity[:2], obstacle.velocity[2])


class World:
    """Obstacles around one aircraft whose hull is a sphere.

    Distances are exact between samples, from one to the next all move on straight lines.
    """

    def __init__(self, obstacles: Sequence[Obstacle], radius: float) -> None:
        self.obstacles = tuple(obstacles)
        self.radius = radius  # [m] of the hull
        self.reset()

    @classmethod
    def from_list(cls, data: Any, radius: float, source: str = "obstacles") -> "World":
        """Return the world of a scenario's ``obstacles``; raises ConfigError naming ``source``."""
        return cls(load_obstacles(data, source), radius)

    def reset(self) -> None:
        """Forget contacts, clearances and where the aircraft was."""
        self.collisions: List[Collision] = []
        self._watches = [_Watch(obstacle) for obstacle in self.obstacles]
        self._last: Optional[Tuple[float, Vector]] = None

    @property
    def clearance(self) -> Dict[str, float]:
        """Least distance [m] hull to surface so far, by obstacle id; inf without a sample."""
        return {watch.obstacle.id: watch.nearest - self.radius for watch in self._watches}

    def observe(self, t: float, position: Vector) -> List[Collision]:
        """Take the true position (3,) [m] at ``t`` [s]; return contacts begun since the last."""
        if not self._watches:
            return []
        t0, start = self._last or (t, position)
        self._last = (t, position)
        travelled = math.dist(start, position)
        begun = []
        for watch in self._watches:
            watch.bound -= travelled + watch.speed * (t - t0)
            if watch.bound > max(watch.nearest, self.radius):
                continue
            begun.extend(self._inspect(watch, t0, start, t, position))
        self.collisions.extend(begun)
        return begun

    def _inspect(
        self, watch: _Watch, t0: float, start: Vector, t: float, position: Vector
    ) -> List[Collision]:
        obstacle = watch.obstacle
        begin = _offset(start, obstacle.position_at(t0))
        end = _offset(position, obstacle.position_at(t))
        distance, where = obstacle.nearest(begin, end)
        watch.nearest = min(watch.nearest, distance)
        watch.bound = obstacle.distance(*end)
        begins = distance < self.radius and not watch.touching
        watch.touching = watch.bound < self.radius
        if not begins:
            return []
        return [Collision(obstacle.id, t0 + where * (t - t0), distance - self.radius)]


def _offset(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
