# SPDX-License-Identifier: MIT
"""One drawn flight: a straight leg among spheres, as scenario and as world of the simulator.

Suites draw in the frame of the leg: origin at its start, x along it, y to the left, z up [m].
"""

from dataclasses import dataclass
from typing import Any, Dict, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle
from nmpc_control.scenario import Scenario
from nmpc_control.trajectory import line
from uav_sim.world import World

HULL = 0.5  # [m] radius of the aircraft's sphere
MARGIN = 0.5  # [m] from the hull
HEIGHT = 12.0  # [m] of every leg: what is drawn leaves the air below free
CLOCK_START = 1.5  # [s] simulated time at which the reference's clock begins
WEIGHTS = "outdoor"


@dataclass(frozen=True)
class Sphere:
    """One obstacle, in the frame of the leg."""

    center: np.ndarray  # (3,) [m] at t = 0 of the simulation, or where it appears
    radius: float  # [m]
    velocity: Optional[np.ndarray] = None  # (3,) [m/s]; None: it stands still
    appears_within: Optional[float] = None  # [m] centre of the aircraft to surface


@dataclass(frozen=True)
class Sketch:
    """What a suite draws."""

    length: float  # [m] of the leg
    speed: float  # [m/s] of the reference
    spheres: Tuple[Sphere, ...]
    is_closed: bool = False  # there is no way: to stop and hover outside the margin is right

    @property
    def changes(self) -> bool:
        """Whether any obstacle moves or appears, so that all of them must be sensed."""
        return any(s.velocity is not None or s.appears_within is not None for s in self.spheres)


@dataclass(frozen=True)
class Flight:
    """A sketch with its place in a campaign."""

    suite: str
    index: int
    seed: int  # of this flight alone: disturbance and random aircraft
    heading: float  # [rad] of the leg
    sketch: Sketch

    @property
    def start(self) -> np.ndarray:
        """First point (3,) [m] of the leg, in the world frame."""
        return self._place(np.zeros(3))

    @property
    def end(self) -> np.ndarray:
        """Last point (3,) [m] of the leg, in the world frame."""
        return self._place(np.array([self.sketch.length, 0.0, 0.0]))

    def scenario(self) -> Scenario:
        """Return what is flown; obstacles that stand still are known from the beginning."""
        known = () if self.sketch.changes else self.obstacles()
        return leg_scenario(self.suite, self.start, self.end, self.sketch.speed, known)

    def obstacles(self) -> Tuple[Obstacle, ...]:
        """Return the spheres in the world frame, moving ones as of t = 0."""
        return tuple(
            Obstacle(
                f"sphere{i}",
                self._place(s.center),
                np.array([s.radius]),
                velocity=self._turn(np.zeros(3) if s.velocity is None else s.velocity),
                stamp=None if s.velocity is None else 0.0,
            )
            for i, s in enumerate(self.sketch.spheres)
        )

    def entries(self) -> Sequence[Dict[str, Any]]:
        """Return the spheres as a scenario file has them."""
        entries = []
        for obstacle, sphere in zip(self.obstacles(), self.sketch.spheres):
            entry: Dict[str, Any] = {
                "id": obstacle.id,
                "position": obstacle.position.tolist(),
                "radius": sphere.radius,
            }
            if sphere.velocity is not None:
                entry["velocity"] = obstacle.velocity.tolist()
            if sphere.appears_within is not None:
                entry["appear"] = {"within": sphere.appears_within}
            entries.append(entry)
        return entries

    def world(self, radius: float = HULL) -> World:
        """Return the simulator's world for a hull of a radius [m]."""
        return World.from_list(self.entries(), radius, f"{self.suite} {self.index}")

    def _place(self, point: np.ndarray) -> np.ndarray:
        return self._turn(point) + np.array([0.0, 0.0, HEIGHT])

    def _turn(self, vector: np.ndarray) -> np.ndarray:
        c, s = np.cos(self.heading), np.sin(self.heading)
        x, y, z = vector
        return np.array([c * x - s * y, s * x + c * y, z])


def leg_scenario(
    name: str,
    start: np.ndarray,
    end: np.ndarray,
    speed: float,
    obstacles: Tuple[Obstacle, ...] = (),
) -> Scenario:
    """Return flying straight from a point (3,) [m] to another at a speed [m/s], from rest."""
    trajectory = line(start, end, speed)
    return Scenario(
        name=name,
        description="drawn for a campaign",
        trajectory=trajectory,
        obstacles=obstacles,
        room=None,
        weights=WEIGHTS,
        initial_position=trajectory.start,
        spawn=np.zeros(3),
    )


def drawn_speed(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a speed [m/s] in steps of 0.1, so that flights share their free flights."""
    return float(rng.integers(round(10 * low), round(10 * high) + 1)) / 10.0


def on_disc(rng: np.random.Generator, radius: float) -> np.ndarray:
    """Return a point (2,) drawn evenly from a disc."""
    angle, distance = rng.uniform(0.0, 2.0 * np.pi), radius * np.sqrt(rng.uniform())
    return distance * np.array([np.cos(angle), np.sin(angle)])
