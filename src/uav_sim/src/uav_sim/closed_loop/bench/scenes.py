# SPDX-License-Identifier: MIT
"""Scenarios that only the bench flies."""

from dataclasses import replace
from typing import List

import numpy as np

from nmpc_control.scenario import Scenario
from nmpc_control.state import Obstacle

_RADIUS = (0.3, 0.6)  # [m]
_WIDTH = 1.5  # [m] surfaces lie at most this much farther from the path than they must
NARROW = 0.6  # [m] least distance of a surface from the path: a hull of 0.5 m just passes
WIDE = 1.3  # [m] the same: out of reach of the potential for who stays on the path
_SAMPLES = 2000


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
