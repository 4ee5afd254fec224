# SPDX-License-Identifier: MIT
"""The circle behind an arc of echoes, by maximum likelihood.

Three kinds of evidence: echoes lie on the circle; where an edge is in view, the line of sight
touches it there; and an expected radius. A mean of the echoes lies up to 0.79 radii nearer to the
scanner than the centre, and a circle through a short noisy arc is almost free in size: the edges
and the expected radius settle both.
"""

import math
from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

_ITERATIONS = 10
_CONVERGED = 5e-4  # [m]
_EDGE_SIGMA = 0.4  # [1] of the increment; evenly within one would be 0.29


@dataclass(frozen=True)
class Circle:
    """A fitted circle with the covariance of centre and radius."""

    centre: np.ndarray  # (2,) [m]
    radius: float  # [m]
    covariance: np.ndarray  # (3, 3) of x, y, radius [m^2]
    misfit: float  # [1] mean squared residual in sigmas: 1 where it is a circle


def fit_circle(
    origin: np.ndarray,
    points: np.ndarray,
    edges: Tuple[Optional[float], Optional[float]],
    increment: float,
    sigma: float,
    prior: Tuple[float, float],
    bounds: Tuple[float, float],
) -> Circle:
    """Return the circle behind echoes.

    Args:
        origin: (2,) [m] of the scanner.
        points: (m, 2) [m] echoes, from right to left.
        edges: bearings [rad] of the right and left edges, None where hidden.
        increment: [rad] between beams, the uncertainty of an edge.
        sigma: [m] of a range.
        prior: expected radius and its sigma [m].
        bounds: least and greatest radius [m].
    """
    local = points - origin
    middle = local[len(local) // 2]
    towards = math.atan2(middle[1], middle[0])
    turned = [None if e is None else math.remainder(e - towards, math.tau) for e in edges]
    cos, sin = math.cos(towards), math.sin(towards)
    local = local @ np.array([[cos, -sin], [sin, cos]])  # x along the line of sight
    parameters = _first_guess(local, turned, prior[0], bounds)
    weight = 1.0 / (_EDGE_SIGMA * increment)
    for _ in range(_ITERATIONS):
        J, residual = _residuals(parameters, local, turned, weight, sigma, prior)
        H = J.T @ J
        step = np.linalg.solve(H + 1e-9 * np.eye(3), -J.T @ residual)
        step *= min(1.0, 0.5 / max(1e-9, float(np.abs(step).max())))
        parameters = parameters + step
        parameters[2] = min(max(parameters[2], bounds[0]), bounds[1])
        parameters[0] = max(parameters[0], 1.01 * parameters[2])  # the scanner is outside
        if np.abs(step).max() < _CONVERGED:
            break
    misfit = float(residual @ residual) / max(1, len(residual) - 3)
    covariance = max(1.0, misfit) * np.linalg.inv(H + 1e-9 * np.eye(3))
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    centre = origin + turn[:2, :2] @ parameters[:2]
    return Circle(centre, float(parameters[2]), turn @ covariance @ turn.T, misfit)


def _first_guess(
    local: np.ndarray, edges: list, radius: float, bounds: Tuple[float, float]
) -> np.ndarray:
    nearest = float(np.hypot(local[:, 0], local[:, 1]).min())
    bearing = 0.0
    if None not in edges:
        half = 0.5 * (edges[1] - edges[0])
        sine = math.sin(min(max(half, 1e-3), 1.2))
        radius, bearing = nearest * sine / (1.0 - sine), 0.5 * (edges[0] + edges[1])
    radius = min(max(radius, bounds[0]), bounds[1])
    distance = nearest + radius
    return np.array([distance * math.cos(bearing), distance * math.sin(bearing), radius])


def _residuals(
    parameters: np.ndarray,
    local: np.ndarray,
    edges: list,
    weight: float,
    sigma: float,
    prior: Tuple[float, float],
) -> Tuple[np.ndarray, np.ndarray]:
    """Return Jacobian (k, 3) and residuals (k,) in sigmas."""
    x, y, radius = parameters
    offset = local - parameters[:2]
    distance = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-6)
    m = len(local)
    shown = [(side, edge) for side, edge in zip((-1.0, 1.0), edges) if edge is not None]
    J = np.empty((m + 1 + len(shown), 3))
    residual = np.empty(len(J))
    J[:m, :2] = -offset / distance[:, None] / sigma
    J[:m, 2] = -1.0 / sigma
    residual[:m] = (distance - radius) / sigma
    J[m] = 0.0, 0.0, 1.0 / prior[1]
    residual[m] = (radius - prior[0]) / prior[1]
    away = math.hypot(x, y)
    sine = min(radius / away, 0.99)
    slope = 1.0 / (away * math.sqrt(1.0 - sine * sine))
    for row, (side, edge) in enumerate(shown, m + 1):
        residual[row] = weight * (math.atan2(y, x) + side * math.asin(sine) - edge)
        across, along = 1.0 / (away * away), side * sine * slope / away
        J[row] = -y * across - along * x, x * across - along * y, side * slope
        J[row] *= weight
    return J, residual
