# SPDX-License-Identifier: MIT
"""Inequalities g(x) <= 0 of the problem beside the bounds of the inputs, each softened exactly.

The problem's penalty on them is rho max(0, g), an L1 penalty: exact, so g <= 0 holds at the
solution where it can
hold at all, and the solution is the nearest one where it cannot (e.g. pushed outside the fence by a
gust). The compiled solver reaches it by
an augmented Lagrangian with multipliers bounded by rho; IPOPT by slack variables.
"""

from typing import Dict, List

import casadi as ca
import numpy as np

SPEED, FENCE, OBSTACLE = "speed", "fence", "obstacle"
# curvature of the augmented Lagrangian per row: about a hundred times that of the tracking cost
_CURVATURE = {SPEED: 500.0, FENCE: 2000.0, OBSTACLE: 20000.0}


PILOT_BOUNDS = 7  # rows of speed and fence, before those of the obstacles


def rows(obstacle_slots: int) -> List[str]:
    """Return the kind of every inequality of a stage, in order."""
    return [SPEED] + [FENCE] * 6 + [OBSTACLE] * obstacle_slots


def curvature(obstacle_slots: int) -> np.ndarray:
    """Return the curvature of the augmented Lagrangian of every inequality."""
    return np.array([_CURVATURE[kind] for kind in rows(obstacle_slots)])


def pilot_bounds(position: ca.SX, velocity: ca.SX, bounds: Dict[str, ca.SX]) -> ca.SX:
    """Return g (7,) of speed [m/s] and fence [m].

    Args:
        position: (3,) [m].
        velocity: (3,) [m/s].
        bounds: ``speed``, ``fence_min`` (3,), ``fence_max`` (3,).
    """
    # of second order in the excess, but smooth at rest, unlike the norm
    speed = (ca.dot(velocity, velocity) - bounds["speed"] ** 2) / (2 * bounds["speed"])
    return ca.vertcat(speed, position - bounds["fence_max"], bounds["fence_min"] - position)


def obstacle(d: ca.SX, slot: ca.SX, selected: ca.SX) -> ca.SX:
    """Return g [m] of Eq. 7 at a distance d from a slot's centre; 0 where it is not selected."""
    return selected * (1 / slot[4] - d)
