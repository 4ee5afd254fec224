# SPDX-License-Identifier: MIT
"""Scenarios that only the bench flies."""

from dataclasses import replace
from typing import List

import numpy as np

from nmpc_control.obstacle import Obstacle
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.trajectory import polyline

_RADIUS = (0.3, 0.6)  # [m]
_WIDTH = 1.5  # [m] surfaces lie at most this much farther from the path than they must
NARROW = 0.6  # [m] least distance of a surface from the path: a hull of 0.5 m just passes
WIDE = 1.3  # [m] the same: out of reach of the potential for who stays on the path
_SAMPLES = 2000
_SIDE, _HEIGHT, _SPEED = 20.0, 3.0, 4.0  # [m], [m], [m/s] of the circuit
_BALL, _INSIDE = 1.5, 0.3  # [m] radius, and how far inside the path its centre is


def scatter(scenario: Scenario, count: int, seed: int, gap: float = NARROW) -> Scenario:
    """Return the scenario with ``count`` spheres beside its path instead of its obstacles.

    Their surfaces are at least ``gap`` [m] from the path.
    """
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, scenario.trajectory.duration, _SAMPLES)
    path = scenario.trajectory.sample(times).position
    spheres: List[Obstacle] = []
    while len(spheres) < count:
        radius = rng.uniform(*_RADIUS)
        aside = radius + gap + _WIDTH * rng.random()
        direction = rng.normal(size=3)
        centre = path[rng.integers(_SAMPLES)] + aside * direction / np.linalg.norm(direction)
        if np.min(np.linalg.norm(path - centre, axis=1)) >= radius + gap:
            spheres.append(Obstacle(f"s{len(spheres)}", centre, np.array([radius])))
    return replace(scenario, name=f"{scenario.name}_{count}", obstacles=tuple(spheres))


def circuit() -> Scenario:
    """Return a fast lap with four sharp corners and a great sphere on the path between each two.

    The aircraft must leave the path by 2.3 m for each of them: it does well to see them early.
    """
    middle, far = _SIDE / 2.0, _SIDE
    corners = np.array([[0, 0], [far, 0], [far, far], [0, far]])
    centres = [
        [middle, _INSIDE],
        [far - _INSIDE, middle],
        [middle, far - _INSIDE],
        [_INSIDE, middle],
    ]
    path = polyline(np.c_[corners, np.full(4, _HEIGHT)], speed=_SPEED, closed=True)
    spheres = [
        Obstacle(f"s{i}", np.array([*centre, _HEIGHT]), np.array([_BALL]))
        for i, centre in enumerate(centres)
    ]
    return replace(
        load_scenario("rectangle"),
        name="circuit",
        trajectory=path,
        obstacles=tuple(spheres),
        weights="outdoor",
        initial_position=np.array([0.0, 0.0, _HEIGHT]),
    )
