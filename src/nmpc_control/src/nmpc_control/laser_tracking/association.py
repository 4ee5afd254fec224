# SPDX-License-Identifier: MIT
"""Which detection is which track: the assignment of least total cost, within gates."""

import math
from typing import Dict, List, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from nmpc_control.laser_tracking.detection import Detection
from nmpc_control.laser_tracking.parameters import TrackParameters
from nmpc_control.laser_tracking.track import Track

_WALL_COST = 4.0  # [1] of a wall for what was a cylinder, or the other way round
_NEVER = 1e6  # [1] outside the gate


def assign(
    tracks: Sequence[Track], found: Sequence[Detection], parameters: TrackParameters
) -> Dict[int, int]:
    """Return the index of a track by the index of its detection; confirmed tracks choose first."""
    pairs: Dict[int, int] = {}
    for is_confirmed in (True, False):
        rows = [i for i, track in enumerate(tracks) if (track.number is not None) is is_confirmed]
        columns = [j for j in range(len(found)) if j not in pairs]
        if rows and columns:
            cost = _costs([tracks[i] for i in rows], [found[j] for j in columns], parameters)
            for a, b in zip(*linear_sum_assignment(cost)):
                if cost[a, b] < _NEVER:
                    pairs[columns[b]] = rows[a]
    return pairs


def _costs(tracks: List[Track], found: List[Detection], parameters: TrackParameters) -> np.ndarray:
    """Return the costs (tracks, detections): squared Mahalanobis distance plus log determinant."""
    costs = np.full((len(tracks), len(found)), _NEVER)
    centres = np.array([detection.centre for detection in found])
    places = np.array([track.x[:2] for track in tracks])
    distance = np.linalg.norm(places[:, None] - centres[None], axis=2)
    for i, j in np.argwhere(distance < parameters.gate_distance):
        innovation, S = tracks[i].innovation(found[j])
        (a, b), (_, d) = S
        determinant = a * d - b * b
        u, v = innovation
        off = (d * u * u - 2.0 * b * u * v + a * v * v) / determinant
        if off < parameters.gate:
            mixed = _WALL_COST if found[j].is_wall is not tracks[i].is_wall else 0.0
            costs[i, j] = off + math.log(determinant) + mixed
    return costs
