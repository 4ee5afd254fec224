# SPDX-License-Identifier: MIT
"""Can the aircraft still stop before what is in its way? Asked of nobody but the guard itself.

The way to stop is, at a speed v, v times (dead time + control period + age of the plan + rise of
the tilt) + 1.5 v^2 / (2 a), or v / k where that is more: below a / k the brake is proportional to
velocity and takes that long a way, whatever its lags. The rise of the tilt is 2 zeta / omega of a
second-order attitude loop; that is its mean delay, for a first-order lag its time constant.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Optional

import numpy as np

from nmpc_control.approach import approach, is_clear_of
from nmpc_control.braking import MADE_UP, BrakeParameters
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Vehicle
from nmpc_control.state import GRAVITY, PITCH, POSITION, ROLL, VELOCITY, YAW

SPACING = 0.25  # [m] of the points of a way that are handed on; what is near is refined
LEAST_DECELERATION = 0.5  # [m/s^2] in whatever wind
NEARER = 0.02  # [m] by which a way must lead nearer to what is too near already


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _non_negative() -> float:
    return field(metadata={"min": 0.0})


@dataclass(frozen=True)
class StoppingParameters:
    """When the guard brakes because there would not be enough room later."""

    enabled: bool = field()
    factor: float = field(metadata={"min": 1.0})  # [1] on the braking distance v^2 / (2 a)
    margin: float = _non_negative()  # [m] hull to surface left at the end
    least_speed: float = _positive()  # [m/s] slower is not looked at
    advantage: float = _non_negative()  # [m] by which braking must keep farther off than the plan
    evasion: float = _non_negative()  # [m] a plan that leads past obstacles this far off is flown
    evasion_age: float = _non_negative()  # [s] for as long as it is not older
    release: float = _non_negative()  # [m] more room than needed before plans are flown again
    dwell: float = _non_negative()  # [s] least time of braking


@dataclass(frozen=True)
class Way:
    """Straight on and to a stop."""

    start: np.ndarray  # (3,) [m]
    direction: np.ndarray  # (3,) unit vector
    speed: float  # [m/s]
    reaction: float  # [s] at that speed before braking takes effect
    braking: float  # [m] after that

    @property
    def needed(self) -> float:
        """Distance [m] from start to stop."""
        return self.speed * self.reaction + self.braking

    @property
    def duration(self) -> float:
        """Time [s] from start to stop."""
        return self.reaction + (2.0 * self.braking / self.speed if self.speed > 0.0 else 0.0)

    def distance(self, after: np.ndarray) -> np.ndarray:
        """Return the distance (M,) [m] covered at times (M,) [s] after the start."""
        straight = self.speed * np.minimum(after, self.reaction)
        if self.braking <= 0.0:
            return straight
        rest = np.clip((after - self.reaction) * self.speed / (2.0 * self.braking), 0.0, 1.0)
        return straight + self.braking * (1.0 - (1.0 - rest) ** 2)

    def points(self, after: np.ndarray) -> np.ndarray:
        """Return the positions (M, 3) [m] at times (M,) [s] after the start."""
        return self.start + self.distance(after)[:, None] * self.direction


class Shortfall(NamedTuple):
    """What is in the way of a stop."""

    obstacle: str
    needed: float  # [m]
    has: float  # [m] of the way until it is too near

    def __str__(self) -> str:
        room = f"needs {self.needed:.1f} m, has {self.has:.1f} m"
        return f"cannot stop before obstacle {self.obstacle}: {room}"


def way_to_stop(
    state: np.ndarray,
    vehicle: Vehicle,
    brake: BrakeParameters,
    latency: float,
    factor: float,
) -> Way:
    """Return the way straight on that a stop takes.

    Args:
        state: (10,) position and velocity; a tilt that speeds it up counts until it has decayed.
        vehicle: for lags, and what the model lacks: more of a push along the way than the brake
            can make up for takes from its deceleration.
        brake: the weakest brake that may have to do it.
        latency: [s] from the state to the effect of a command: dead time, period, age of the plan.
        factor: [1] on the braking distance at full deceleration.
    """
    velocity = state[VELOCITY]
    speed = float(np.linalg.norm(velocity))
    direction = velocity / speed if speed > 0.0 else np.zeros(3)
    rise = max(vehicle.roll.time_constant, vehicle.pitch.time_constant)
    speed += max(0.0, float(direction @ _push(state))) * rise
    push = max(0.0, float(direction @ vehicle.disturbance) - MADE_UP)
    net = max(LEAST_DECELERATION, brake.deceleration - push)
    full = speed * rise + factor * speed**2 / (2.0 * net)
    total = max(full, speed / brake.velocity_gain)
    return Way(state[POSITION], direction, speed, latency + rise, total - speed * rise)


def shortfall(
    way: Way, t: float, obstacles: ObstacleField, radius: float, margin: float, room: float = 0.0
) -> Optional[Shortfall]:
    """Return what a stop does not fit before, None where it fits.

    What is beside the way does not count, nor what is near already and does not come nearer.

    Args:
        way: to stop.
        t: [s] at its start.
        obstacles: whose numbers are finite.
        radius: [m] of the hull.
        margin: [m] hull to surface to be left.
        room: [m] by which the way must fit even if it were longer.
    """
    way = Way(way.start, way.direction, way.speed, way.reaction, way.braking + room)
    after = _instants(way, way.duration)
    path = way.points(after), t + after, t, obstacles, radius, margin
    if is_clear_of(*path):
        return None
    near = approach(*path)
    limit = np.minimum(margin, near.grown[:, :1] - NEARER)
    too_near = near.grown < limit
    if not too_near.any():
        return None
    first = np.where(too_near.any(axis=1), too_near.argmax(axis=1), len(near.times))
    i = int(first.argmin())
    covered = float(np.linalg.norm(near.points[max(first[i] - 1, 0)] - way.start))
    return Shortfall(near.ids[i], way.needed - room, covered)


def clearance_of(
    way: Way, horizon: float, t: float, obstacles: ObstacleField, radius: float
) -> float:
    """Return the least clearance [m] over ``horizon`` [s] of a stop, and of staying there."""
    after = _instants(way, max(horizon, way.duration))
    near = approach(way.points(after), t + after, t, obstacles, radius, 0.0)
    return float(near.grown.min(initial=math.inf))


def _instants(way: Way, duration: float) -> np.ndarray:
    """Return times (M,) [s] after the start at which the way is looked at."""
    count = max(2, math.ceil(max(way.needed / SPACING, duration / 0.1)) + 1)
    return np.linspace(0.0, duration, count)


def _push(state: np.ndarray) -> np.ndarray:
    """Return the horizontal acceleration (3,) [m/s^2] that the tilt gives in hover thrust."""
    roll, pitch, yaw = state[ROLL], state[PITCH], state[YAW]
    forward, left = GRAVITY * math.tan(pitch), -GRAVITY * math.tan(roll)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array([cy * forward - sy * left, sy * forward + cy * left, 0.0])
