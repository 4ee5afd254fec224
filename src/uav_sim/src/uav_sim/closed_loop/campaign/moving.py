# SPDX-License-Identifier: MIT
"""Suite ``moving``: spheres that cross, come head-on, overtake or are overtaken.

Each is timed so that it would hit an aircraft that is where the reference is.
"""

from typing import Optional

import numpy as np

from uav_sim.closed_loop.campaign.draw import (
    CLOCK_START,
    HEIGHT,
    HULL,
    Sketch,
    Sphere,
    drawn_speed,
    on_disc,
)

LENGTHS = (20.0, 25.0, 30.0)  # [m]
SPEED = (1.0, 2.0)  # [m/s] of the aircraft
COUNT = (1, 6)
RADIUS = (0.3, 1.0)  # [m]
OBSTACLE_SPEED = (0.5, 3.0)  # [m/s]
KINDS = {  # [deg] between its course and the aircraft's
    "crossing": (45.0, 135.0),
    "head_on": (160.0, 180.0),
    "overtaking": (0.0, 15.0),
}
CLIMB = 15.0  # [deg] course above or below the horizon at most
FIRST, LAST = 4.0, 1.5  # [s] the conflict is this long after the start, and before the end
LEAST_CLOSING = 0.5  # [m/s] relative speed: less is no conflict but company
FREE_TIME, FREE_GAP = 2.5, 1.0  # so long after the start [s] it is this far [m] from the hull
_LOWEST = 2.0  # [m] height


def draw(rng: np.random.Generator) -> Sketch:
    """Return one flight."""
    length = LENGTHS[rng.integers(len(LENGTHS))]
    speed = drawn_speed(rng, *SPEED)
    count = int(rng.integers(COUNT[0], COUNT[1] + 1))
    spheres = tuple(_sphere(rng, length, speed) for _ in range(count))
    return Sketch(length, speed, spheres)


def _sphere(rng: np.random.Generator, length: float, speed: float) -> Sphere:
    while True:
        sphere = _candidate(rng, length, speed)
        if sphere is not None:
            return sphere


def _candidate(rng: np.random.Generator, length: float, speed: float) -> Optional[Sphere]:
    """Return a sphere that hits the reference, None where it is unfair at the start."""
    low, high = KINDS[list(KINDS)[rng.integers(len(KINDS))]]
    course = np.radians(rng.uniform(low, high)) * (1 if rng.random() < 0.5 else -1)
    climb = np.radians(rng.uniform(-CLIMB, CLIMB))
    v = rng.uniform(*OBSTACLE_SPEED)
    velocity = v * np.array(
        [np.cos(climb) * np.cos(course), np.cos(climb) * np.sin(course), np.sin(climb)]
    )
    radius = rng.uniform(*RADIUS)
    closing = velocity - [speed, 0.0, 0.0]
    if np.linalg.norm(closing) < LEAST_CLOSING:
        return None
    duration = length / speed
    conflict = rng.uniform(FIRST, duration - LAST)
    miss = _across(closing) @ on_disc(rng, radius + HULL)
    at_conflict = np.array([speed * conflict, 0.0, 0.0]) + miss
    sphere = Sphere(at_conflict - (conflict + CLOCK_START) * velocity, radius, velocity)
    ends = at_conflict[2] + velocity[2] * np.array([-conflict, duration - conflict])
    is_low = HEIGHT + ends.min() - radius < _LOWEST
    return None if is_low or gap_at_start(sphere, speed) < FREE_GAP else sphere


def gap_at_start(sphere: Sphere, speed: float) -> float:
    """Return the least gap [m] hull to surface in the first moments, at rest or on the way."""
    clock = np.arange(-CLOCK_START, FREE_TIME + 1e-9, 0.05)
    centers = sphere.center + (clock + CLOCK_START)[:, None] * sphere.velocity
    on_the_way = centers - np.maximum(speed * clock, 0.0)[:, None] * [1.0, 0.0, 0.0]
    nearest = min(np.linalg.norm(p, axis=1).min() for p in (centers, on_the_way))
    return float(nearest) - sphere.radius - HULL


def _across(direction: np.ndarray) -> np.ndarray:
    """Return two unit vectors (3, 2) across a direction (3,)."""
    n = direction / np.linalg.norm(direction)
    a = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [1.0, 0.0, 0.0])
    a /= np.linalg.norm(a)
    return np.stack([a, np.cross(n, a)], axis=1)
