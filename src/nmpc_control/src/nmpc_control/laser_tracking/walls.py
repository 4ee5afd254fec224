# SPDX-License-Identifier: MIT
"""A wide surface cut into straight pieces that stay in place while more of it comes in view."""

from typing import List, Optional, Tuple

import numpy as np

from nmpc_control.laser_tracking.parameters import ShapeParameters

Piece = Tuple[np.ndarray, np.ndarray]  # indices (k,) of points, tangent (2,)


def pieces(points: np.ndarray, shapes: ShapeParameters) -> List[Piece]:
    """Return the pieces of a row of points (m, 2) [m], each at most ``wall_piece`` long.

    Corners part it first (Douglas and Peucker, 1973); each straight part is then cut on a grid that
    is fixed in the world, not to what is in view, or its pieces would wander with the aircraft.
    """
    found: List[Piece] = []
    todo = [np.arange(len(points))]
    while todo:
        part = todo.pop()
        corner = _corner(points[part], shapes.wall_bend)
        if corner is None:
            found += _cut(points, part, shapes)
        else:
            todo += [part[corner:], part[: corner + 1]]
    return found


def _corner(points: np.ndarray, bend: float) -> Optional[int]:
    chord = points[-1] - points[0]
    length = float(np.hypot(*chord))
    if len(points) < 3 or length < 1e-6:
        return None
    off = points - points[0]
    distance = np.abs(off[:, 0] * chord[1] - off[:, 1] * chord[0]) / length
    farthest = int(np.argmax(distance))
    return farthest if distance[farthest] > bend and 0 < farthest < len(points) - 1 else None


def _cut(points: np.ndarray, part: np.ndarray, shapes: ShapeParameters) -> List[Piece]:
    chosen = points[part]
    centred = chosen - chosen.mean(axis=0)
    tangent = np.linalg.svd(centred, full_matrices=False)[2][0]
    tangent = tangent if tuple(tangent) > (0.0, 0.0) else -tangent
    cells = np.floor(chosen @ tangent / shapes.wall_piece).astype(int)
    found = []
    for cell in np.unique(cells):
        members = part[cells == cell]
        if len(members) >= 2:
            found.append((members, tangent))
    return found
