# SPDX-License-Identifier: MIT
"""Echoes of one surface: neighbours no farther apart than their range explains.

The gap grows with range as in Borges and Aldon, "Line extraction in 2D range images for mobile
robotics", Journal of Intelligent and Robotic Systems 40, 2004 (adaptive breakpoint detector). A
beam that an edge cuts in two may show a point between foreground and background: farther from both
than that gap, it belongs to neither, and alone it is no cluster.
"""

from typing import List

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from nmpc_control.laser_tracking.parameters import ShapeParameters
from nmpc_control.laser_tracking.scan import Beam
from nmpc_control.laser_tracking.view import View


def clusters(view: View, shapes: ShapeParameters) -> List[np.ndarray]:
    """Return the beams of each surface, counter-clockwise; too small ones are left out."""
    n = len(view.kinds)
    is_echo = view.kinds == Beam.ECHO
    first, second = [], []
    for skip in range(1, shapes.max_skip + 1):
        a = np.arange(n if view.is_closed else n - skip)
        b = (a + skip) % n
        gap = np.linalg.norm(view.points[a, :2] - view.points[b, :2], axis=1)
        between = skip * view.increment * np.minimum(view.reach[a], view.reach[b])
        near = is_echo[a] & is_echo[b] & (gap <= shapes.jump + shapes.jump_slope * between)
        first.append(a[near])
        second.append(b[near])
    a, b = np.concatenate(first), np.concatenate(second)
    _, labels = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), False)
    beams = np.flatnonzero(is_echo)
    beams = beams[np.argsort(labels[beams], kind="stable")]
    parts = np.split(beams, np.flatnonzero(np.diff(labels[beams])) + 1)
    return [_in_order(part, n) for part in parts if len(part) >= shapes.min_points]


def _in_order(beams: np.ndarray, n: int) -> np.ndarray:
    """Return beams from the right edge to the left one, also where they pass the last beam."""
    gaps = np.diff(beams, append=beams[0] + n)
    return np.roll(beams, -1 - int(np.argmax(gaps)))
