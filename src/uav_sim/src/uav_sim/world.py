# SPDX-License-Identifier: MIT
"""What surrounds one aircraft: the record of how near its hull came to obstacles and aircraft.

A collision is recorded, not simulated: the aircraft flies on. The ground is the plant's matter.

Interface: ``World(obstacles, radius)`` for one aircraft alone; for several,
``World(scene, radius, name)`` each on one ``scene.Scene``. ``observe`` once per step; then
``states()`` is what is there now, ``new_collisions`` what began in that step.
"""

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Union

from uav_sim.body import Body, BodyState, between
from uav_sim.motion import Vector
from uav_sim.obstacle import GROUND, Obstacle
from uav_sim.scene import Scene


class Collision(NamedTuple):
    """One contact of the hull with an obstacle, or a crash on the ground with clearance 0."""

    id: str
    t: float  # [s] of the least distance within the step in which the contact began
    clearance: float  # [m] hull to surface at that time, below zero


class _Watch:
    """How one obstacle has been approached."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.nearest = math.inf  # [m] least distance centre to surface so far
        self.bound = -math.inf  # [m] the present distance is at least this
        self.touching = False


class World:
    """Obstacles around one aircraft whose hull is a sphere.

    From one sample to the next the aircraft is taken to fly straight (at 20 m/s^2 it leaves the
    chord of a 5 ms step by 0.06 mm), and so are obstacles on straight paths, exactly. Curved ones
    are cut into chords within 0.5 mm of the path, and how far off they may be is subtracted from
    the clearance: no contact is missed, and one may be reported up to 1 mm too early.
    """

    def __init__(
        self,
        obstacles: Union[Scene, Sequence[Obstacle]],
        radius: float,
        name: str = "aircraft",
    ) -> None:
        self.name = name
        self.radius = radius  # [m] of the hull
        self.scene = obstacles if isinstance(obstacles, Scene) else Scene(obstacles)
        self.scene.join(self)
        self.reset()

    @classmethod
    def from_list(cls, data: Any, radius: float, source: str = "obstacles") -> "World":
        """Return the world of a scenario's ``obstacles``; raises ConfigError naming ``source``."""
        return cls(Scene.from_list(data, source), radius)

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """All obstacles of the scenario, also those that have not appeared."""
        return self.scene.obstacles

    @property
    def moves(self) -> bool:
        """Whether anything in it moves, appears or is another aircraft."""
        bodies = self.scene.bodies(self.name)
        return len(bodies) > len(self.obstacles) or any(
            body.max_speed > 0.0 or body.obstacle.appear is not None for body in bodies
        )

    def reset(self) -> None:
        """Forget contacts, clearances and where all aircraft were; obstacles begin anew."""
        self.collisions: List[Collision] = []
        self.new_collisions: List[Collision] = []  # begun in the last step
        self._watches: List[_Watch] = []  # in the order of the scene's bodies
        self.scene.reset()

    @property
    def clearance(self) -> Dict[str, float]:
        """Least distance [m] hull to surface so far, by obstacle id; inf without a sample."""
        result = {body.obstacle.id: math.inf for body in self.scene.bodies(self.name)}
        result.update((w.body.obstacle.id, w.nearest - self.radius) for w in self._watches)
        return result

    def states(self) -> List[BodyState]:
        """Return obstacles and other aircraft that are there, as of the last sample."""
        states = (body.state for body in self.scene.bodies(self.name))
        return [state for state in states if state is not None]

    def observe(self, t: float, position: Vector) -> List[Collision]:
        """Take the true position (3,) [m] at ``t`` [s].

        Returns the contacts begun since the last sample; where several aircraft share a scene they
        are known, in ``new_collisions``, only after the last one has been observed.
        """
        if self.new_collisions:
            self.new_collisions = []
        if self.scene.bodies(self.name):
            self.scene.report(self.name, t, position)
        return self.new_collisions

    def crash(self, t: float) -> None:
        """Take note of a crash on the ground at ``t`` [s], after ``observe`` of that time."""
        collision = Collision(GROUND, t, 0.0)
        self.new_collisions.append(collision)
        self.collisions.append(collision)

    def check(self, t0: float, start: Vector, t: float, end: Vector) -> None:
        """Judge the straight way from ``start`` to ``end`` (3,) [m] between two times [s]."""
        bodies, watches = self.scene.bodies(self.name), self._watches
        if len(watches) < len(bodies):
            watches.extend(_Watch(body) for body in bodies[len(watches) :])
        travelled, h = math.dist(start, end), t - t0
        for watch in watches:
            body = watch.body
            watch.bound -= travelled + body.max_speed * h
            if watch.bound > max(watch.nearest, self.radius) or not body.is_there:
                continue
            collision = self._inspect(watch, t0, start, t, end)
            if collision is not None:
                self.new_collisions.append(collision)
                self.collisions.append(collision)

    def _inspect(
        self, watch: _Watch, t0: float, start: Vector, t: float, end: Vector
    ) -> Optional[Collision]:
        obstacle, (samples, bend) = watch.body.obstacle, watch.body.track(t0)
        h = t - t0

        def offset(sample: Any) -> Vector:
            s, (x, y, z) = sample
            own = between(start, end, (s - t0) / h if h > 0.0 else 1.0)
            return (own[0] - x, own[1] - y, own[2] - z)

        least, when = math.inf, t0
        last = offset(samples[0])
        for a, b in zip(samples, samples[1:]):
            begin, last = last, offset(b)
            distance, where = obstacle.nearest(begin, last)
            if distance < least:
                least, when = distance, a[0] + where * (b[0] - a[0])
        least -= bend
        watch.nearest = min(watch.nearest, least)
        watch.bound = obstacle.distance(*last)
        begins = least < self.radius and not watch.touching
        watch.touching = watch.bound < self.radius
        return Collision(obstacle.id, when, least - self.radius) if begins else None
