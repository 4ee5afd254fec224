# SPDX-License-Identifier: MIT
"""Getting out of the way of what comes, while there is no plan that could.

Who has no plan brakes and holds; what moves may come at that place. Then a velocity to one of ten
sides is flown that keeps farthest off, and given up as soon as holding is good enough. What the
obstacles may have grown to with the age of what is known of them is left out: that comes from
everywhere.
"""

import math
from dataclasses import dataclass, field
from typing import List, NamedTuple, Optional

import numpy as np

from nmpc_control.approach import approach
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Limits, Vehicle
from nmpc_control.state import POSITION, VELOCITY

SIDES = 8
POINTS = 31  # [1] of a way that is looked at
NEARER = 0.05  # [m] by which something must come nearer, or it does not come
BETTER = 0.2  # [m] by which another side must be better than the one that is flown
LEVEL = 0.5  # [m] by which a way up or down must be better than any to a side


def _positive() -> float:
    return field(metadata={"min": 1e-3})


@dataclass(frozen=True)
class EvasionParameters:
    """When the guard gets out of the way, and how fast."""

    enabled: bool = field()
    nearest: float = _positive()  # [m] hull to surface: what comes nearer to who holds is evaded
    release: float = field(metadata={"min": 0.0})  # [m] more than that, and it holds again
    speed: float = _positive()  # [m/s] to a side
    climb: float = _positive()  # [m/s] up or down
    from_speed: float = _positive()  # [m/s] who is faster brakes first
    horizon: float = _positive()  # [s] looked ahead
    response: float = _positive()  # [s] after which two thirds of another velocity are reached


class _Look(NamedTuple):
    least: float  # [m] clearance on a way
    now: float  # [m] from the same obstacle, at its beginning
    name: str


class Evasion:
    """Remembers to which side it flies; ``look`` once per tick of a brake."""

    def __init__(self, params: EvasionParameters, vehicle: Vehicle, limits: Limits) -> None:
        """Begin holding.

        Args:
            params: when and how fast.
            vehicle: for the hull.
            limits: for the fence, which is not left.
        """
        self.params = params
        self.vehicle = vehicle
        self.limits = limits
        self._sides = self._velocities(params)
        self.forget()

    def forget(self) -> None:
        """Hold again."""
        self.velocity: Optional[np.ndarray] = None  # (3,) [m/s] to fly with; None: hold
        self.obstacle = ""  # what is evaded

    def look(self, state: np.ndarray, t: float, obstacles: ObstacleField) -> Optional[np.ndarray]:
        """Return the velocity (3,) [m/s] to fly with; None: brake and hold.

        Args:
            state: (10,) when a command sent now takes effect.
            t: [s] of that.
            obstacles: as known now.
        """
        p = self.params
        is_fast = float(np.linalg.norm(state[VELOCITY])) > p.from_speed
        is_new = self.velocity is None
        if not p.enabled or not len(obstacles) or obstacles.unusable or (is_new and is_fast):
            self.forget()
            return None
        held = self._look(np.zeros(3), state, t, obstacles)
        enough = p.nearest + (0.0 if is_new else p.release)
        if held.least >= enough or held.least > held.now - NEARER:
            self.forget()
            return None
        best, kept = None, held.least + (BETTER if is_new else 0.0)
        if not is_new:
            kept = self._look(self.velocity, state, t, obstacles).least + BETTER
        for velocity in self._sides:
            end = state[POSITION] + p.horizon * velocity
            if not self.limits.encloses(end):
                continue
            least = self._look(velocity, state, t, obstacles).least
            least = min(least, enough + p.release) - (LEVEL if velocity[2] else 0.0)
            if least > kept:
                best, kept = velocity, least
        if best is not None:
            self.velocity = best
        self.obstacle = held.name if self.velocity is not None else ""
        return self.velocity

    @staticmethod
    def _velocities(p: EvasionParameters) -> List[np.ndarray]:
        """Return the velocities (3,) [m/s] that are tried."""
        angles = 2.0 * math.pi * np.arange(SIDES) / SIDES
        level = [np.array([p.speed * math.cos(a), p.speed * math.sin(a), 0.0]) for a in angles]
        return [*level, np.array([0.0, 0.0, p.climb]), np.array([0.0, 0.0, -p.climb])]

    def _look(
        self, velocity: np.ndarray, state: np.ndarray, t: float, obstacles: ObstacleField
    ) -> _Look:
        """Return how near a way comes on which a velocity is reached as by a first-order lag.

        For as long again it stays where that leads: or it would be chased by what it runs ahead of.
        """
        p = self.params
        after = np.linspace(0.0, 2.0 * p.horizon if velocity.any() else p.horizon, POINTS)
        flown = np.minimum(after, p.horizon)[:, None]
        begun = p.response * -np.expm1(-flown / p.response)
        way = state[POSITION] + flown * velocity + begun * (state[VELOCITY] - velocity)
        reach = p.nearest + 2.0 * p.release
        near = approach(way, t + after, t, obstacles, self.vehicle.radius, reach)
        i = int(near.clearance.min(axis=1).argmin())
        row = near.clearance[i]
        return _Look(float(row.min()), float(row[0]), near.ids[i])
