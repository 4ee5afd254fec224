# SPDX-License-Identifier: MIT
"""What one cluster of echoes is: a cylinder, or a wall as a row of them."""

import math
from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from nmpc_control.laser_tracking.circle_fit import fit_circle
from nmpc_control.laser_tracking.parameters import LaserTrackerParameters
from nmpc_control.laser_tracking.scan import Beam
from nmpc_control.laser_tracking.view import View
from nmpc_control.laser_tracking.walls import pieces

_COVERED = 4.0  # [1] misfit from which a circle has to contain its echoes
_OCCLUDER = 0.1  # [m] nearer than the edge


@dataclass(frozen=True)
class Detection:
    """A vertical cylinder as one scan shows it."""

    lag: float  # [s] of its beams after the first of the scan
    centre: np.ndarray  # (2,) [m]
    covariance: np.ndarray  # (2, 2) [m^2]
    radius: float  # [m]
    radius_variance: float  # [m^2]
    heights: Tuple[float, float]  # [m] of its lowest and highest echo
    is_wall: bool = False
    beams: Optional[np.ndarray] = None  # of a cylinder with a hidden edge, to be fitted again


def detect(
    view: View, beams: np.ndarray, prior: Tuple[float, float], parameters: LaserTrackerParameters
) -> List[Detection]:
    """Return what a cluster's beams show; ``prior`` is an expected radius and its sigma [m]."""
    shapes = parameters.shapes
    points = view.points[beams, :2]
    origin = view.origins[beams].mean(axis=0)[:2]
    edges = _edges(view, beams)
    width = math.dist(points[0], points[-1])
    if width <= 2.2 * shapes.radius_max:
        bounds = (shapes.radius_min, 1.5 * shapes.radius_max)
        sigma = parameters.echoes.sigma
        circle = fit_circle(origin, points, edges, view.increment, sigma, prior, bounds)
        is_whole = None not in edges
        if circle.radius <= shapes.radius_max:
            radius = circle.radius
            if circle.misfit > _COVERED:
                away = np.linalg.norm(points - circle.centre, axis=1)
                radius = min(max(radius, float(away.max())), shapes.radius_max)
            pose = _pose_covariance(circle.centre - origin, parameters)
            return [
                Detection(
                    lag=float(view.lag[beams].mean()),
                    centre=circle.centre,
                    covariance=circle.covariance[:2, :2] + pose,
                    radius=radius,
                    radius_variance=float(circle.covariance[2, 2]),
                    heights=_heights(view, beams),
                    beams=None if is_whole else beams,
                )
            ]
    return _wall(view, beams, origin, parameters)


def _wall(
    view: View, beams: np.ndarray, origin: np.ndarray, parameters: LaserTrackerParameters
) -> List[Detection]:
    shapes = parameters.shapes
    found = []
    for piece, tangent in pieces(view.points[beams, :2], shapes):
        points = view.points[beams[piece], :2]
        along = points @ tangent
        middle = points.mean(axis=0) + (0.5 * (along.min() + along.max()) - along.mean()) * tangent
        half = 0.5 * float(np.ptp(along))
        normal = np.array([-tangent[1], tangent[0]])
        normal = normal if normal @ (middle - origin) > 0.0 else -normal
        depth = math.sqrt(max(0.0, shapes.wall_radius**2 - half**2))
        centre = middle + depth * normal
        # along a wall nothing tells how far it moved
        spread = (0.3 * shapes.wall_piece) ** 2 * np.outer(tangent, tangent)
        spread = spread + 0.05**2 * np.outer(normal, normal)
        found.append(
            Detection(
                lag=float(view.lag[beams[piece]].mean()),
                centre=centre,
                covariance=spread + _pose_covariance(centre - origin, parameters),
                radius=shapes.wall_radius,
                radius_variance=0.01,
                heights=_heights(view, beams[piece]),
                is_wall=True,
            )
        )
    return found


def _pose_covariance(offset: np.ndarray, parameters: LaserTrackerParameters) -> np.ndarray:
    """Return what an uncertain pose does to a point at an offset (2,) [m]."""
    across = parameters.pose.heading_sigma * np.array([-offset[1], offset[0]])
    floor = parameters.pose.position_sigma**2 + parameters.tracks.position_sigma**2
    return floor * np.eye(2) + np.outer(across, across)


def _heights(view: View, beams: np.ndarray) -> Tuple[float, float]:
    z = view.points[beams, 2]
    return float(z.min()), float(z.max())


def _edges(view: View, beams: np.ndarray) -> Tuple[Optional[float], Optional[float]]:
    """Return the bearings [rad] of right and left edge; None where something nearer may hide it."""
    return _edge(view, int(beams[0]), -1), _edge(view, int(beams[-1]), 1)


def _edge(view: View, beam: int, side: int) -> Optional[float]:
    n, other = len(view.kinds), beam + side
    if not view.is_closed and not 0 <= other < n:
        return None
    other %= n
    if view.kinds[other] in (Beam.UNKNOWN, Beam.GROUND):
        return None
    if view.reach[other] < view.reach[beam] + _OCCLUDER:
        return None
    bearing = view.bearings[beam]
    return bearing + 0.5 * math.remainder(view.bearings[other] - bearing, math.tau)
