# SPDX-License-Identifier: MIT
"""Everything that aircraft can hit, on one clock: obstacles in motion, and the other aircraft.

Interface: one ``Scene`` for all aircraft of a simulation; each has a ``world.World`` on it, which
reports the aircraft's true position once per step. With the last report of a step the obstacles
move on to that time and every world is checked, so that several aircraft step in any order.
"""

from typing import Any, Dict, List, Protocol, Sequence, Tuple

from uav_sim.body import AircraftBody, Body, make_body
from uav_sim.motion import Vector
from uav_sim.obstacle import Obstacle, load_obstacles


class Observer(Protocol):
    """What a scene asks of an aircraft's world."""

    name: str
    radius: float  # [m]

    def check(self, t0: float, start: Vector, t: float, end: Vector) -> None:
        """Judge the straight way from ``start`` to ``end`` (3,) [m] between two times [s]."""


class Scene:
    """Obstacles and aircraft; the aircraft are obstacles of each other."""

    def __init__(self, obstacles: Sequence[Obstacle] = ()) -> None:
        self.obstacles = tuple(obstacles)
        self._bodies = [make_body(obstacle) for obstacle in self.obstacles]
        self._heeding = [body for body in self._bodies if body.heeds_aircraft]
        self._others = [body for body in self._bodies if not body.heeds_aircraft]
        self._observers: List[Observer] = []
        self._aircraft: Dict[str, AircraftBody] = {}
        self._around: Dict[str, Tuple[Body, ...]] = {}
        self._last: Dict[str, Tuple[float, Vector]] = {}
        self._now: Dict[str, Tuple[float, Vector]] = {}

    @classmethod
    def from_list(cls, data: Any, source: str = "obstacles") -> "Scene":
        """Return the scene of a scenario's ``obstacles``; raises ConfigError naming ``source``."""
        return cls(load_obstacles(data, source))

    def join(self, observer: Observer) -> None:
        """Add an aircraft; raises ValueError if its name is taken."""
        if observer.name in self._aircraft or observer.name in [o.id for o in self.obstacles]:
            raise ValueError(f"aircraft {observer.name!r}: that name is taken")
        self._observers.append(observer)
        self._aircraft[observer.name] = AircraftBody(observer.name, observer.radius)
        self._around = {
            name: (*self._bodies, *(b for other, b in self._aircraft.items() if other != name))
            for name in self._aircraft
        }

    def bodies(self, name: str) -> Tuple[Body, ...]:
        """Return what the aircraft of that name can hit."""
        return self._around[name]

    def reset(self) -> None:
        """Begin anew at t = 0: obstacles at their places, aircraft unknown."""
        self._last, self._now = {}, {}
        for body in (*self._bodies, *self._aircraft.values()):
            body.reset()

    def report(self, name: str, t: float, position: Vector) -> None:
        """Take an aircraft's true position (3,) [m] at ``t`` [s]; the last of a step checks all.

        Raises:
            RuntimeError: the aircraft reports twice before another one did once.
        """
        if name in self._now:
            missing = [o.name for o in self._observers if o.name not in self._now]
            raise RuntimeError(f"no position of aircraft {missing} for t = {self._now[name][0]} s")
        self._now[name] = (t, position)
        if len(self._now) == len(self._observers):
            self._advance(t)

    def _advance(self, t: float) -> None:
        last, now = self._last, self._now
        self._last, self._now = now, {}
        for body in self._others:
            body.t = t
        if self._heeding:
            starts = [last.get(name, sample)[1] for name, sample in now.items()]
            ends = [position for _, position in now.values()]
            for body in self._heeding:
                body.advance(t, starts, ends)
        if len(now) > 1:
            for name, sample in now.items():
                self._aircraft[name].move(*sample)
        for observer in self._observers:
            t1, end = now[observer.name]
            t0, start = last.get(observer.name, (t1, end))
            observer.check(t0, start, t1, end)
