# SPDX-License-Identifier: MIT
"""All suites by name, and flight number i of a seed: the same whatever else is flown."""

from typing import Callable, Dict
from zlib import crc32

import numpy as np

from uav_sim.closed_loop.campaign import appearing, head_on, moving, no_way, static_fields
from uav_sim.closed_loop.campaign.draw import Flight, Sketch

SUITES: Dict[str, Callable[[np.random.Generator], Sketch]] = {
    "static_fields": static_fields.draw,
    "moving": moving.draw,
    "appearing": appearing.draw,
    "head_on": head_on.draw,
    "no_way": no_way.draw,
}


def draw_flight(suite: str, seed: int, index: int) -> Flight:
    """Return flight number ``index`` of a campaign's seed.

    Raises:
        KeyError: no such suite.
    """
    draw = SUITES[suite]
    own, scene = np.random.SeedSequence([crc32(suite.encode()), seed, index]).spawn(2)
    rng = np.random.default_rng(scene)
    heading = float(rng.uniform(-np.pi, np.pi))
    return Flight(suite, index, int(own.generate_state(1)[0]), heading, draw(rng))
