# SPDX-License-Identifier: MIT
"""Suite ``head_on``: one sphere or a group, exactly symmetric about the line, no side is better."""

from typing import List

import numpy as np

from uav_sim.closed_loop.campaign.draw import HULL, Sketch, Sphere, drawn_speed

LENGTH = 40.0  # [m]
SPEED = (1.0, 4.0)  # [m/s]
RADIUS = (0.5, 2.0)  # [m]
FROM_REST = (1.5, 4.0)  # [m] hull to the nearest surface where the aircraft starts before it
AT_SPEED = (18.0, 24.0)  # [m] from the start where it comes at speed
GAP = (0.0, 0.8)  # [m] between two surfaces with the line in the middle: the hull needs 1.0
KINDS = ("one", "two", "three", "four")


def draw(rng: np.random.Generator) -> Sketch:
    """Return one flight."""
    kind, radius = KINDS[rng.integers(len(KINDS))], rng.uniform(*RADIUS)
    gap = rng.uniform(*GAP)
    from_rest = rng.random() < 0.5
    x = HULL + radius + rng.uniform(*FROM_REST) if from_rest else rng.uniform(*AT_SPEED)
    centers = [np.array([x, *aside]) for aside in _group(kind, radius, gap, rng.random() < 0.5)]
    spheres = tuple(Sphere(center, radius) for center in centers)
    return Sketch(LENGTH, drawn_speed(rng, *SPEED), spheres)


def _group(kind: str, radius: float, gap: float, upright: bool) -> List[np.ndarray]:
    """Return where the centres are (2,) [m] beside and above the line."""
    axis = np.array([0.0, 1.0]) if upright else np.array([1.0, 0.0])
    off = radius + gap / 2.0
    if kind == "one":
        return [np.zeros(2)]
    if kind == "two":
        return [off * axis, -off * axis]
    if kind == "three":
        return [np.zeros(2), 2.0 * off * axis, -2.0 * off * axis]
    return [off * axis, -off * axis, off * axis[::-1], -off * axis[::-1]]
