# SPDX-License-Identifier: MIT
"""Obstacles in motion: where each is now, and how it moved over the last step.

Interface: ``make_body(obstacle)``; ``advance`` once per step, then ``state`` (None while it has not
appeared) and ``track``. An aircraft is an obstacle of the others by ``AircraftBody``.
"""

import math
from typing import NamedTuple, Optional, Sequence, Tuple

from uav_sim.motion import STILL, Chase, Vector
from uav_sim.obstacle import Obstacle

CHORD_TOLERANCE = 5e-4  # [m] a curved path leaves the chords that stand for it by no more than this
_CHASE_STEP = 0.02  # [s] longest step of a pursuit

Sample = Tuple[float, Vector]  # [s], [m]


class BodyState(NamedTuple):
    """An obstacle that is there, at one time."""

    obstacle: Obstacle
    position: Vector  # [m]
    velocity: Vector  # [m/s]


class Track(NamedTuple):
    """How a body moved: straight from sample to sample, but for ``bend``."""

    samples: Tuple[Sample, ...]
    bend: float  # [m] at most so far was it from those straight lines


class Body:
    """One obstacle that may appear late; by itself it stands still."""

    def __init__(self, obstacle: Obstacle) -> None:
        self.obstacle = obstacle
        self.max_speed = 0.0  # [m/s] bound
        self.heeds_aircraft = obstacle.appear is not None  # else ``t`` is all it has to be told
        self.reset()

    def reset(self) -> None:
        """Begin anew at t = 0."""
        self.t = 0.0  # [s]
        self.since = 0.0 if self.obstacle.appear is None else math.inf  # [s] when motion began

    @property
    def is_there(self) -> bool:
        """Whether it has appeared."""
        return self.since <= self.t

    @property
    def state(self) -> Optional[BodyState]:
        """Where it is; None before it appears."""
        return BodyState(self.obstacle, *self._motion()) if self.is_there else None

    def advance(self, t: float, starts: Sequence[Vector], ends: Sequence[Vector]) -> None:
        """Go on to ``t`` [s] while aircraft fly straight from their starts to their ends (3,)."""
        self.t = t
        if self.since > t:
            self._appear(ends)

    def track(self, t0: float) -> Track:
        """Return how it moved since ``t0`` [s], within the last step, or since it appeared."""
        return Track((), 0.0)

    def _motion(self) -> Tuple[Vector, Vector]:
        """Return position [m] and velocity [m/s]."""
        return self.obstacle.position, STILL

    def _appear(self, aircraft: Sequence[Vector]) -> None:
        appear, (x, y, z) = self.obstacle.appear, self.obstacle.position
        if appear.at <= self.t:
            self.since = appear.at
            return
        distance = self.obstacle.distance
        if any(distance(p[0] - x, p[1] - y, p[2] - z) < appear.within for p in aircraft):
            self.since = self.t


class PathBody(Body):
    """An obstacle whose place depends on time only."""

    def __init__(self, obstacle: Obstacle) -> None:
        super().__init__(obstacle)
        self._path = obstacle.path
        self._bend = 0.125 * self._path.max_acceleration
        self.max_speed = self._path.max_speed

    def track(self, t0: float) -> Track:
        """Return the samples between which it was straight to within ``CHORD_TOLERANCE``."""
        path, since = self._path, self.since
        if self.max_speed == 0.0:  # most obstacles, at every step that comes nearer
            place = self.obstacle.position
            return Track(((max(t0, since), place), (self.t, place)), 0.0)
        begin, end, bend = max(t0 - since, 0.0), self.t - since, 0.0
        times = [begin, *path.kinks(begin, end), end]
        if self._bend > 0.0:
            parts = max(1, math.ceil((end - begin) * math.sqrt(self._bend / CHORD_TOLERANCE)))
            h = (end - begin) / parts
            times = [begin + k * h for k in range(parts)] + [end]
            bend = self._bend * h * h
        return Track(tuple((since + s, path.position(s)) for s in times), bend)

    def _motion(self) -> Tuple[Vector, Vector]:
        s = self.t - self.since
        return self._path.position(s), self._path.velocity(s)


class ChaseBody(Body):
    """An obstacle that pursues the nearest aircraft."""

    def __init__(self, obstacle: Obstacle, chase: Chase) -> None:
        self._chase = chase
        super().__init__(obstacle)
        self.max_speed, self.heeds_aircraft = chase.speed, True

    def reset(self) -> None:
        """Begin anew at t = 0, at rest."""
        super().reset()
        self._velocity = STILL
        self._track = Track(((0.0, self.obstacle.position),), 0.0)

    def advance(self, t: float, starts: Sequence[Vector], ends: Sequence[Vector]) -> None:
        """Go on to ``t`` [s], in steps short enough for pursuit."""
        t0, was_there = self.t, self.is_there
        super().advance(t, starts, ends)
        if not was_there:
            place = self.obstacle.position
            self._track = Track(((self.since, place), (t, place)), 0.0)
        elif ends and t > t0:
            self._pursue(t0, t, starts, ends)

    def track(self, t0: float) -> Track:
        """Return the steps of the pursuit."""
        return self._track

    def _motion(self) -> Tuple[Vector, Vector]:
        return self._track.samples[-1][1], self._velocity

    def _pursue(
        self, t0: float, t: float, starts: Sequence[Vector], ends: Sequence[Vector]
    ) -> None:
        position, velocity = self._motion()
        nearest = min(range(len(ends)), key=lambda i: math.dist(position, ends[i]))
        parts = max(1, math.ceil((t - t0) / _CHASE_STEP - 1e-9))
        h = (t - t0) / parts
        samples = [(t0, position)]
        for k in range(1, parts + 1):
            target = between(starts[nearest], ends[nearest], k / parts)
            position, velocity = self._chase.advance(position, velocity, target, h)
            samples.append((t0 + k * h, position))
        self._velocity = velocity
        self._track = Track(tuple(samples), 0.125 * self._chase.acceleration * h * h)


class AircraftBody(Body):
    """An aircraft as the others see it: a sphere that is moved from outside."""

    def __init__(self, name: str, radius: float) -> None:
        super().__init__(Obstacle(name, "sphere", (radius,), STILL))

    def reset(self) -> None:
        """Forget where it was."""
        super().reset()
        self._last: Optional[Sample] = None
        self._now: Optional[Sample] = None

    @property
    def is_there(self) -> bool:
        """Whether its place is known."""
        return self._now is not None

    def move(self, t: float, position: Vector) -> None:
        """Take its true position (3,) [m] at ``t`` [s]."""
        self._last, self._now, self.t = self._now or (t, position), (t, position), t
        h = t - self._last[0]
        # a bound for the step just made; the next one sets its own
        self.max_speed = math.dist(self._last[1], position) / h if h > 0.0 else 0.0

    def advance(self, t: float, starts: Sequence[Vector], ends: Sequence[Vector]) -> None:
        """Nothing: ``move`` has done it."""

    def track(self, t0: float) -> Track:
        """Return its last step."""
        return Track((self._last, self._now), 0.0)

    def _motion(self) -> Tuple[Vector, Vector]:
        (t0, a), (t, b) = self._last, self._now
        h = t - t0
        velocity = tuple((q - p) / h for p, q in zip(a, b)) if h > 0.0 else STILL
        return b, velocity


def make_body(obstacle: Obstacle) -> Body:
    """Return the body of an obstacle."""
    motion = obstacle.path
    return ChaseBody(obstacle, motion) if isinstance(motion, Chase) else PathBody(obstacle)


def between(a: Vector, b: Vector, share: float) -> Vector:
    """Return the point (3,) at a share 0..1 of the way from ``a`` to ``b``."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )
