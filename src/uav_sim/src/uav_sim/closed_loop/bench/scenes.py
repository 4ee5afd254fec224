# SPDX-License-Identifier: MIT
"""Scenarios that only the bench flies."""

from dataclasses import replace
from typing import List

import numpy as np

from nmpc_control.scenario import Scenario
from nmpc_control.state import Obstacle

_RADIUS = (0.3, 0.6)  # [m]
_ASIDE = (1.0, 2.5)  # [m] centre to a point of the path
_GAP = 0.6  # [m] least distance of a surface from the path: a hull of 0.5 m passes
_SAMPLES = 2000


def scatter(scenario: Scenario, count: int, seed: int) -> Scenario:
    """Return the scenario with ``count`` spheres beside its path instead of its obstacles."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, scenario.trajectory.duration, _SAMPLES)
    path = scenario.trajectory.sample(times).position
    spheres: List[Obstacle] = []
    while len(spheres) < count:
        radius, aside = rng.uniform(*_RADIUS), rng.uniform(*_ASIDE)
        direction = rng.normal(size=3)
        centre = path[rng.integers(_SAMPLES)] + aside * direction / np.linalg.norm(direction)
        if np.min(np.linalg.norm(path - centre, axis=1)) >= radius + _GAP:
            spheres.append(Obstacle(f"s{len(spheres)}", centre, np.array([radius])))
    return replace(scenario, name=f"{scenario.name}_{count}", obstacles=tuple(spheres))
