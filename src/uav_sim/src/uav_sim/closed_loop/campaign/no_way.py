# SPDX-License-Identifier: MIT
"""Suite ``no_way``: the end of the leg cannot be reached; to stop before the margin is right."""

import numpy as np
from scipy.spatial import cKDTree

from uav_sim.closed_loop.campaign.draw import Sketch, Sphere, drawn_speed

LENGTH = 20.0  # [m]
SPEED = (1.0, 2.5)  # [m/s]
KINDS = ("goal_inside", "wall", "small_gap")
INSIDE_RADIUS = (0.8, 2.0)  # [m] of the sphere around the end of the leg
OFF_CENTRE = 0.5  # the end is off its centre by at most this part of the radius
SHELL = (3.0, 4.0)  # [m] distance from the end of the spheres that enclose it
SHELL_COUNT = (50, 70)
OVERLAP = 0.1  # [m] of the spheres of a wall
HOLE = (0.15, 0.45)  # [m] radius of what passes through the widest gap: less than the hull
_DIRECTIONS = 20000  # in which gaps are looked for


def draw(rng: np.random.Generator) -> Sketch:
    """Return one flight."""
    kind, speed = KINDS[rng.integers(len(KINDS))], drawn_speed(rng, *SPEED)
    end = np.array([LENGTH, 0.0, 0.0])
    if kind == "goal_inside":
        radius = rng.uniform(*INSIDE_RADIUS)
        off = rng.uniform(0.0, OFF_CENTRE * radius) * _direction(rng)
        return Sketch(LENGTH, speed, (Sphere(end + off, radius),), is_closed=True)
    shell, count = rng.uniform(*SHELL), int(rng.integers(SHELL_COUNT[0], SHELL_COUNT[1] + 1))
    centers = shell * directions(count, rng.uniform(0.0, 2.0 * np.pi))
    radius = widest_gap(centers, shell)
    radius += OVERLAP if kind == "wall" else -rng.uniform(*HOLE)
    spheres = tuple(Sphere(end + center, radius) for center in centers)
    return Sketch(LENGTH, speed, spheres, is_closed=True)


def directions(count: int, turn: float = 0.0) -> np.ndarray:
    """Return unit vectors (count, 3) spread evenly, on a golden spiral turned by an angle [rad]."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = turn + np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    level = np.sqrt(1.0 - z**2)
    return np.stack([level * np.cos(angle), level * np.sin(angle), z], axis=1)


def widest_gap(centers: np.ndarray, shell: float) -> float:
    """Return the radius [m] of spheres at centres (n, 3) [m] that just closes the shell."""
    distances, _ = cKDTree(centers).query(shell * directions(_DIRECTIONS))
    return float(distances.max())


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)
