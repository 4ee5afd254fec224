# SPDX-License-Identifier: MIT
"""Suite ``static_fields``: 30 m through 10 to 40 spheres that stand, half of them on the line."""

import numpy as np

from uav_sim.closed_loop.campaign.draw import HULL, MARGIN, Sketch, Sphere, drawn_speed, on_disc

LENGTH = 30.0  # [m]
SPEED = (1.0, 2.5)  # [m/s]
COUNT = (10, 40)
RADIUS = (0.4, 1.5)  # [m]
NEAR = 1.0  # [m] centres of one half are this close to the line
ASIDE, ABOVE = 8.0, 4.0  # [m] centres of the other half, to both sides and up and down
ROOM_AT_START, ROOM_AT_END = 1.0, 0.5  # [m] beyond the margin


def draw(rng: np.random.Generator) -> Sketch:
    """Return one flight."""
    count = int(rng.integers(COUNT[0], COUNT[1] + 1))
    spheres = tuple(_sphere(rng, is_near=i < (count + 1) // 2) for i in range(count))
    return Sketch(LENGTH, drawn_speed(rng, *SPEED), spheres)


def _sphere(rng: np.random.Generator, is_near: bool) -> Sphere:
    """Return a sphere that leaves start and end free."""
    while True:
        radius, x = rng.uniform(*RADIUS), rng.uniform(0.0, LENGTH)
        if is_near:
            y, z = on_disc(rng, NEAR)
        else:
            y, z = rng.uniform(-ASIDE, ASIDE), rng.uniform(-ABOVE, ABOVE)
        center = np.array([x, y, z])
        at_start = np.linalg.norm(center) - radius - HULL - MARGIN
        at_end = np.linalg.norm(center - [LENGTH, 0.0, 0.0]) - radius - HULL - MARGIN
        apart = is_near or np.hypot(y, z) > NEAR
        if apart and at_start >= ROOM_AT_START and at_end >= ROOM_AT_END:
            return Sphere(center, radius)
