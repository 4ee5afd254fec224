# SPDX-License-Identifier: MIT
"""The offline optimum: the gentlest way past everything, with full knowledge of its future.

The aircraft turns its thrust vector with the lags of its vehicle file at constant yaw, so that
position, thrust, roll, pitch and their references follow exactly from a spline and its derivatives
(D. Mellinger and V. Kumar, Minimum snap trajectory generation and control for quadrotors, ICRA
2011). IPOPT minimises effort over the control points; gaps and input bounds are inequalities, the
gaps softened by an L1 penalty so that a start that leads nowhere ends as well.
"""

from functools import lru_cache
from typing import NamedTuple, Tuple

import casadi as ca
import numpy as np

from nmpc_control.params import Limits, Vehicle
from nmpc_control.state import GRAVITY
from uav_sim.closed_loop.campaign import clamped_spline as spline

SLOTS = 8  # nearest spheres at each sample
LOCAL = np.array([0.125, 0.375, 0.625, 0.875])  # samples in each segment
SAMPLES = spline.SEGMENTS * len(LOCAL)
BUFFER = 0.02  # [m] for what lies between samples
_TILT_SHARE = 0.95  # of the bound of one axis, for both together
_SLACK_WEIGHT = 100.0  # [1/m] of the L1 penalty, against mean squares of acceleration
_JERK_WEIGHT = 0.05  # [s^2]
_ROUNDS = 3  # solves, each with the spheres nearest to the last result
_SAME = 0.02  # [m] a round that moves no control point by more ends the search
_OPTIONS = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "ipopt.max_iter": 150,
    "ipopt.tol": 1e-3,  # the result is checked anyway
    "ipopt.acceptable_tol": 1e-2,
    "ipopt.acceptable_iter": 5,
    "ipopt.mu_strategy": "monotone",  # the adaptive one runs into the limit of iterations here
    "ipopt.mu_init": 0.1,
}


class Spheres(NamedTuple):
    """What is in the way; centres move at constant velocity."""

    centers: np.ndarray  # (n, 3) [m] at t = 0
    velocities: np.ndarray  # (n, 3) [m/s]
    gaps: np.ndarray  # (n,) [m] least distance of the aircraft's centre

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return the centres (n, M, 3) [m] at times (M,) [s]."""
        return self.centers[:, None] + t[:, None] * self.velocities[:, None]

    def excess(self, t: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Return by how much (n, M) [m] positions (M, 3) [m] are farther away than they must."""
        return np.linalg.norm(positions - self.at(t), axis=2) - self.gaps[:, None]


def improve(
    path: np.ndarray, duration: float, spheres: Spheres, vehicle: Vehicle, limits: Limits
) -> np.ndarray:
    """Return control points (POINTS, 3) [m] of the optimum near a path (n, 3) [m], even in time."""
    solver = _solver()
    points, h = spline.through(path), duration / spline.SEGMENTS
    t = spline.times(LOCAL, h)
    lag = max(vehicle.roll.time_constant, vehicle.pitch.time_constant)
    tilt = np.tan(_TILT_SHARE * min(limits.input_max[1:3].min(), vehicle.tilt_limit))
    bounds = [h, *limits.input_min[:1], *limits.input_max[:1], tilt, lag, limits.speed]
    for _ in range(_ROUNDS):
        slots = _slots(t, _positions(points), spheres)
        numbers = np.concatenate(
            [points[0], points[-1], bounds, vehicle.drag, *(part.ravel() for part in slots)]
        )
        free = points[spline.CLAMPED : -spline.CLAMPED]
        guess = np.concatenate([free.ravel(), np.zeros(spline.SEGMENTS)])
        result = solver(x0=guess, p=numbers, lbg=0.0, ubg=np.inf, lbx=_lower())
        found = np.array(result["x"]).ravel()[: free.size].reshape(free.shape)
        if not np.isfinite(found).all():
            return points
        points = points.copy()
        points[spline.CLAMPED : -spline.CLAMPED] = found
        clear = spheres.excess(t, _positions(points)).min(initial=np.inf) > 0.0
        if clear or np.abs(found - free).max() < _SAME:
            return points
    return points


def _positions(points: np.ndarray) -> np.ndarray:
    return spline.matrices(LOCAL)[0] @ points


def _slots(t: np.ndarray, positions: np.ndarray, spheres: Spheres) -> Tuple[np.ndarray, np.ndarray]:
    """Return centres (SAMPLES, SLOTS, 3) and gaps (SAMPLES, SLOTS) of the nearest spheres."""
    centers = np.full((SAMPLES, SLOTS, 3), 1e3)
    gaps = np.ones((SAMPLES, SLOTS))
    n = min(SLOTS, len(spheres.gaps))
    if n:
        nearest = np.argsort(spheres.excess(t, positions), axis=0)[:n].T
        samples = np.arange(SAMPLES)[:, None]
        centers[:, :n] = spheres.at(t)[nearest, samples]
        gaps[:, :n] = spheres.gaps[nearest] + BUFFER
    return centers, gaps


def _lower() -> np.ndarray:
    free = 3 * (spline.POINTS - 2 * spline.CLAMPED)
    return np.r_[np.full(free, -np.inf), np.zeros(spline.SEGMENTS)]


@lru_cache(maxsize=1)
def _solver() -> ca.Function:
    """Return the solver; its parameters are packed in ``improve``."""
    free = ca.SX.sym("free", 3, spline.POINTS - 2 * spline.CLAMPED)
    slack = ca.SX.sym("slack", spline.SEGMENTS)
    start, end = ca.SX.sym("start", 3), ca.SX.sym("end", 3)
    bounds, drag = ca.SX.sym("bounds", 6), ca.SX.sym("drag", 3)
    centers = ca.SX.sym("centers", 3 * SLOTS, SAMPLES)
    gaps = ca.SX.sym("gaps", SLOTS, SAMPLES)
    h, least, most, tilt, lag, speed = ca.vertsplit(bounds)
    points = ca.horzcat(*[start] * spline.CLAMPED, free, *[end] * spline.CLAMPED)
    p, v, a, j = (
        points @ ca.sparsify(ca.DM(matrix.T)) / h**i
        for i, matrix in enumerate(spline.matrices(LOCAL))
    )
    thrust = a + ca.repmat(ca.vertcat(0, 0, GRAVITY), 1, SAMPLES) + ca.diag(drag) @ v
    level = thrust[:2, :] + lag * j[:2, :]  # first order of what the references must be
    squares = ca.sum1(thrust**2)
    inequalities = [
        (squares - least**2) / (2 * GRAVITY),
        (most**2 - squares) / (2 * GRAVITY),
        ((tilt * thrust[2, :]) ** 2 - ca.sum1(level**2)) / (2 * GRAVITY),
        (speed**2 - ca.sum1(v**2)) / (2 * speed),
    ]
    soft = ca.repmat(slack.T, len(LOCAL), 1).reshape((1, SAMPLES))
    for i in range(SLOTS):
        away = ca.sum1((p - centers[3 * i : 3 * i + 3, :]) ** 2)
        inequalities.append((away / gaps[i, :] - gaps[i, :]) / 2 + soft)
    effort = (ca.sumsqr(a) + _JERK_WEIGHT * ca.sumsqr(j)) / SAMPLES
    problem = {
        "x": ca.vertcat(ca.vec(free), slack),
        "p": ca.vertcat(start, end, bounds, drag, ca.vec(centers), ca.vec(gaps)),
        "f": effort + _SLACK_WEIGHT / spline.SEGMENTS * ca.sum1(slack),
        "g": ca.horzcat(*inequalities).T,
    }
    return ca.nlpsol("way", "ipopt", problem, _OPTIONS)
