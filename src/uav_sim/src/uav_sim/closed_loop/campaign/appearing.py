# SPDX-License-Identifier: MIT
"""Suite ``appearing``: at 2 m/s a sphere is suddenly there, 3 m from the hull, straight ahead."""

import numpy as np

from uav_sim.closed_loop.campaign.draw import HULL, Sketch, Sphere, on_disc

LENGTH = 30.0  # [m]
SPEED = 2.0  # [m/s]
RADIUS = (0.3, 1.0)  # [m]
AHEAD = 3.0  # [m] hull to surface
WHERE = (12.0, 20.0)  # [m] from the start: the aircraft is at speed
CENTRED = 0.5  # share of the flights in which its centre is on the line; else
ASIDE = 0.5  # its centre is off the line by at most this part of its radius


def draw(rng: np.random.Generator) -> Sketch:
    """Return one flight."""
    radius = rng.uniform(*RADIUS)
    y, z = (0.0, 0.0) if rng.random() < CENTRED else on_disc(rng, ASIDE * radius)
    center = np.array([rng.uniform(*WHERE), y, z])
    return Sketch(LENGTH, SPEED, (Sphere(center, radius, appears_within=HULL + AHEAD),))
