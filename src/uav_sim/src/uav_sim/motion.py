# SPDX-License-Identifier: MIT
"""How obstacles move: paths that depend on time only, pursuit of an aircraft, sudden appearance.

Interface: a path has ``position(t)``, ``velocity(t)`` (t [s] since the motion began), the bounds
``max_speed`` and ``max_acceleration``, and ``kinks(t0, t1)``: times in between at which the
velocity jumps. Between kinks a path leaves the chord of an interval h by at most
``max_acceleration * h^2 / 8``, which the collision check uses. ``Chase`` and ``Appear`` depend on
the aircraft; ``scene.py`` keeps their state. Positions [m] in the world frame, ENU.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Sequence, Tuple, Union

from scipy.interpolate import CubicSpline

Vector = Tuple[float, float, float]

STILL: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Line:
    """Straight at constant velocity; after ``distance`` it stops there or bounces to and fro."""

    start: Vector  # [m]
    step: Vector = STILL  # [m/s] velocity at the beginning
    distance: float = math.inf  # [m] > 0
    end: str = "stop"  # stop or bounce

    max_acceleration = 0.0  # [m/s^2] between kinks

    @property
    def max_speed(self) -> float:
        """Speed [m/s]."""
        return math.sqrt(sum(v * v for v in self.step))

    def position(self, t: float) -> Vector:
        """Return the position (3,) [m] at ``t`` [s]."""
        s, _ = self._leg(t)
        (x, y, z), (vx, vy, vz) = self.start, self.step
        return (x + s * vx, y + s * vy, z + s * vz)

    def velocity(self, t: float) -> Vector:
        """Return the velocity (3,) [m/s] at ``t`` [s], after a kink at that time."""
        _, sign = self._leg(t)
        return (sign * self.step[0], sign * self.step[1], sign * self.step[2])

    def kinks(self, t0: float, t1: float) -> Tuple[float, ...]:
        """Return the times in (t0, t1) [s] at which it stops or turns round."""
        leg = self._leg_time
        if leg == math.inf:
            return ()
        if self.end == "stop":
            return (leg,) if t0 < leg < t1 else ()
        first, last = math.floor(t0 / leg) + 1, math.ceil(t1 / leg) - 1
        return tuple(k * leg for k in range(max(first, 1), last + 1))

    @property
    def _leg_time(self) -> float:
        speed = self.max_speed
        return self.distance / speed if speed > 0.0 else math.inf

    def _leg(self, t: float) -> Tuple[float, float]:
        """Return the time [s] at which the line alone would be here, and the sense of travel."""
        leg = self._leg_time
        if t < leg:
            return t, 1.0
        if self.end == "stop":
            return leg, 0.0
        phase = t % (2.0 * leg)
        return (phase, 1.0) if phase < leg else (2.0 * leg - phase, -1.0)


@dataclass(frozen=True)
class Circle:
    """Level circle through ``start`` about ``center``; speed > 0 turns to the left."""

    start: Vector  # [m]
    center: Tuple[float, float]  # [m] x, y
    speed: float  # [m/s]

    @property
    def radius(self) -> float:
        """Radius [m]."""
        return math.dist(self.start[:2], self.center)

    @property
    def max_speed(self) -> float:
        """Speed [m/s]."""
        return abs(self.speed)

    @property
    def max_acceleration(self) -> float:
        """Centripetal acceleration [m/s^2]."""
        return self.speed * self.speed / self.radius

    def position(self, t: float) -> Vector:
        """Return the position (3,) [m] at ``t`` [s]."""
        cos, sin, dx, dy = self._turn(t)
        return (
            self.center[0] + cos * dx - sin * dy,
            self.center[1] + sin * dx + cos * dy,
            self.start[2],
        )

    def velocity(self, t: float) -> Vector:
        """Return the velocity (3,) [m/s] at ``t`` [s]."""
        cos, sin, dx, dy = self._turn(t)
        rate = self.speed / self.radius
        return (-rate * (sin * dx + cos * dy), rate * (cos * dx - sin * dy), 0.0)

    def kinks(self, t0: float, t1: float) -> Tuple[float, ...]:
        """Return (): there are none."""
        return ()

    def _turn(self, t: float) -> Tuple[float, float, float, float]:
        dx, dy = self.start[0] - self.center[0], self.start[1] - self.center[1]
        angle = t * self.speed / self.radius
        return math.cos(angle), math.sin(angle), dx, dy


@dataclass(frozen=True)
class Spline:
    """Cubic spline through points, spaced in time by their distance over ``speed``.

    ``stop`` and ``bounce`` begin and end at rest, ``loop`` closes to the first point; the
    acceleration is continuous but for the two ends, so that there are no kinks.
    """

    points: Tuple[Vector, ...]  # [m]
    speed: float  # [m/s] mean along the chords
    end: str = "stop"  # stop, bounce or loop
    _knots: Tuple[float, ...] = field(init=False, repr=False)
    _pieces: tuple = field(init=False, repr=False)  # per piece, per axis: cubic .. constant

    def __post_init__(self) -> None:
        points = list(self.points) + [self.points[0]] * (self.end == "loop")
        knots = [0.0]
        for a, b in zip(points, points[1:]):
            knots.append(knots[-1] + math.dist(a, b) / self.speed)
        ends = "periodic" if self.end == "loop" else "clamped"
        c = CubicSpline(knots, points, bc_type=ends).c  # (4, pieces, 3)
        pieces = tuple(tuple(map(tuple, c[:, k, :].T.tolist())) for k in range(c.shape[1]))
        object.__setattr__(self, "_knots", tuple(knots))
        object.__setattr__(self, "_pieces", pieces)

    @property
    def duration(self) -> float:
        """Time [s] from the first point to the last."""
        return self._knots[-1]

    @property
    def max_speed(self) -> float:
        """Upper bound of the speed [m/s]: the hull of each piece's quadratic velocity."""
        bound = 0.0
        for piece, a, b in zip(self._pieces, self._knots, self._knots[1:]):
            h = b - a
            hull = (
                [c for _, _, c, _ in piece],
                [c + h * q for _, q, c, _ in piece],
                [c + h * (2.0 * q + 3.0 * h * k) for k, q, c, _ in piece],
            )
            bound = max(bound, *(_norm(v) for v in hull))
        return bound

    @property
    def max_acceleration(self) -> float:
        """Greatest acceleration [m/s^2]: it is linear in each piece, so at a knot."""
        bound = 0.0
        for piece, a, b in zip(self._pieces, self._knots, self._knots[1:]):
            h = b - a
            bound = max(bound, _norm([2.0 * q for _, q, _, _ in piece]))
            bound = max(bound, _norm([2.0 * q + 6.0 * h * k for k, q, _, _ in piece]))
        return bound

    def position(self, t: float) -> Vector:
        """Return the position (3,) [m] at ``t`` [s]."""
        s, _ = self._phase(t)
        k, s = self._locate(s)
        x, y, z = (((a * s + b) * s + c) * s + d for a, b, c, d in self._pieces[k])
        return (x, y, z)

    def velocity(self, t: float) -> Vector:
        """Return the velocity (3,) [m/s] at ``t`` [s]."""
        s, sign = self._phase(t)
        k, s = self._locate(s)
        x, y, z = (sign * ((3.0 * a * s + 2.0 * b) * s + c) for a, b, c, _ in self._pieces[k])
        return (x, y, z)

    def kinks(self, t0: float, t1: float) -> Tuple[float, ...]:
        """Return (): there are none."""
        return ()

    def _phase(self, t: float) -> Tuple[float, float]:
        duration = self.duration
        if self.end == "loop":
            return t % duration, 1.0
        if self.end == "stop":
            return (t, 1.0) if t < duration else (duration, 0.0)
        phase = t % (2.0 * duration)
        return (phase, 1.0) if phase < duration else (2.0 * duration - phase, -1.0)

    def _locate(self, s: float) -> Tuple[int, float]:
        k = min(bisect_right(self._knots, s), len(self._pieces)) - 1
        return k, s - self._knots[k]


@dataclass(frozen=True)
class Chase:
    """Pursuit of the nearest aircraft: full speed towards it, as fast as acceleration allows."""

    speed: float  # [m/s]
    acceleration: float  # [m/s^2]

    def advance(
        self, position: Vector, velocity: Vector, target: Vector, h: float
    ) -> Tuple[Vector, Vector]:
        """Return position and velocity (3,) after ``h`` [s]; constant acceleration within it."""
        dx, dy, dz = target[0] - position[0], target[1] - position[1], target[2] - position[2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        scale = self.speed / distance if distance > 0.0 else 0.0
        vx, vy, vz = velocity
        ax, ay, az = scale * dx - vx, scale * dy - vy, scale * dz - vz
        change, most = math.sqrt(ax * ax + ay * ay + az * az), self.acceleration * h
        share = most / change if change > most else 1.0
        wx, wy, wz = vx + share * ax, vy + share * ay, vz + share * az
        x, y, z = position
        half = 0.5 * h
        return (x + half * (vx + wx), y + half * (vy + wy), z + half * (vz + wz)), (wx, wy, wz)


@dataclass(frozen=True)
class Appear:
    """An obstacle that is not there at first; its motion begins when it appears."""

    at: float = math.inf  # [s] of simulated time
    within: float = -math.inf  # [m] from an aircraft's centre to the surface; whichever comes first


Path = Union[Line, Circle, Spline]
Motion = Union[Line, Circle, Spline, Chase]


def _norm(v: Sequence[float]) -> float:
    return math.sqrt(sum(x * x for x in v))
