# SPDX-License-Identifier: MIT
"""A scan in the world: where its echoes are, which of them are ground, what is seen and what not.

The scan plane tilts with the aircraft, so that each beam has its own height at a distance. Seen
from above, every beam goes out from the scanner at a bearing; ``reach`` is how far it saw.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from nmpc_control.laser_tracking.parameters import LaserTrackerParameters
from nmpc_control.laser_tracking.scan import Beam, Scan, judge


@dataclass(frozen=True)
class View:
    """The beams (n,) of one scan, counter-clockwise, in the world frame."""

    t: float  # [s] of the first beam in time
    lag: np.ndarray  # (n,) [s] of each beam after that
    kinds: np.ndarray  # (n,) Beam
    origins: np.ndarray  # (n, 3) [m] the scanner at the time of the beam
    points: np.ndarray  # (n, 3) [m] echoes; elsewhere without meaning
    bearings: np.ndarray  # (n,) [rad] seen from above
    slopes: np.ndarray  # (n,) [1] rise over horizontal distance
    reach: np.ndarray  # (n,) [m] horizontal distance that is free; 0 where nothing is known
    increment: float  # [rad] between beams
    is_closed: bool  # the last beam is the neighbour of the first


def look(scan: Scan, poses: np.ndarray, parameters: LaserTrackerParameters) -> View:
    """Return the view of a usable scan taken at poses (n, 6): position [m], roll, pitch, yaw."""
    echoes, mount = parameters.echoes, parameters.mount
    kinds = judge(scan, echoes)
    angles = scan.angles
    beams = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    beams = beams @ _matrix(np.array([mount.rpy]))[0].T
    known = poses if scan.time_increment > 0.0 else poses[:1]  # at one instant one does for all
    rpy = known[:, 3:] * (0.0, 0.0, 1.0) if mount.level else known[:, 3:]
    attitude = _matrix(rpy)  # (n or 1, 3, 3)
    origins = poses[:, :3] + attitude @ np.asarray(mount.position)
    directions = (attitude @ beams[..., None])[..., 0]

    farthest = min(scan.range_max, echoes.max_range)
    ranges = np.where(kinds == Beam.ECHO, scan.ranges, farthest)
    points = origins + ranges[:, None] * directions
    margin = echoes.ground_margin + echoes.ground_angle * ranges
    is_low = points[:, 2] < echoes.ground_height + margin
    kinds[(kinds == Beam.ECHO) & is_low] = Beam.GROUND
    flat = np.maximum(np.hypot(directions[:, 0], directions[:, 1]), 1e-6)
    reach = np.where(kinds == Beam.UNKNOWN, 0.0, ranges * flat)
    order = slice(None, None, 1 if scan.angle_increment > 0.0 else -1)
    return View(
        t=scan.t,
        lag=(scan.times - scan.t)[order],
        kinds=kinds[order],
        origins=origins[order],
        points=points[order],
        bearings=np.arctan2(directions[:, 1], directions[:, 0])[order],
        slopes=(directions[:, 2] / flat)[order],
        reach=reach[order],
        increment=abs(scan.angle_increment),
        is_closed=scan.is_closed,
    )


def _matrix(rpy: np.ndarray) -> np.ndarray:
    """Return the matrices (n, 3, 3) from body to world axes of roll, pitch, yaw (n, 3) [rad]."""
    return Rotation.from_euler("ZYX", rpy[:, ::-1]).as_matrix()
