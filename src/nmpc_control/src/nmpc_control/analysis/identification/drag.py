# SPDX-License-Identifier: MIT
"""Linear drag along the heading, from horizontal motion under a known thrust.

    mean(v') - mean(T e_z) = -forward mean(v_f) h - sideways mean(v_s) n + b

The same with the speed as a factor tells whether drag grows with its square, as it does where it
is of pressure; the controller's model has the linear one.

On a real aircraft velocity is fused from GPS and vision and comes later than attitude: T e_z is
taken a lag earlier where that explains the motion better.

h and n are the heading and its left in the world, e_z the body's z axis; the constant b takes what
steady wind does, which is not drag of the aircraft's own motion.
"""

from dataclasses import dataclass, field
from typing import List, Optional, Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from nmpc_control.analysis.identification.confidence import BLOCK, block_covariance, intervals
from nmpc_control.analysis.identification.estimate import Estimate, unidentified
from nmpc_control.analysis.identification.robust import (
    LinearFit,
    r_squared,
    trimmed_least_squares,
)
from nmpc_control.analysis.identification.thrust import Map, Thrust
from nmpc_control.analysis.identification.translation import Motion

NAMES = ("forward", "sideways")
QUADRATIC = ("quadratic_forward", "quadratic_sideways")
FIGURES = (
    *NAMES,
    "velocity_lag_s",
    "steady_x",
    "steady_y",
    "r2",
    "speed_rms",
    *QUADRATIC,
    "quadratic_r2",
)
_MOVED = 0.5  # [m/s] rms of the speed along an axis below this tells no drag
_LAGS = np.arange(-0.1, 0.41, 0.02)  # [s]
_BETTER = 0.8  # [1] of the squares that must be left at most for a lag to be believed
_MOST_LEFT = 2.0  # [m/s^2] residuals beyond are contacts and count no more
_LOOSE = 0.05  # [1/s] half of the interval


@dataclass(frozen=True)
class Drag:
    """What is known of horizontal drag."""

    estimate: Estimate
    motions: List[Motion] = field(default_factory=list)
    target: Optional[np.ndarray] = None  # (2 w,) [m/s^2] acceleration that thrust does not explain
    fit: Optional[LinearFit] = None


def identify_drag(thrust: Thrust) -> Drag:
    """Return what horizontal motion tells of drag, given the thrust map."""
    if thrust.map is None:
        return Drag(unidentified(FIGURES, NAMES, "needs the thrust map, which is not identified"))
    motions, thrust_map = thrust.motions, thrust.map
    everything = np.concatenate([motion.acceleration[:, :2].T.ravel() for motion in motions])
    matrix = np.concatenate([_columns(motion) for motion in motions])
    lag = _best_lag(motions, thrust_map, matrix)
    target = _unexplained(motions, thrust_map, lag)
    found = trimmed_least_squares(matrix, target)
    speeds = np.concatenate([_along_heading(motion) for motion in motions])
    used, speed = found.used, np.sqrt(np.mean(speeds**2, axis=0))
    blocks = np.concatenate([np.tile(motion.blocks(BLOCK), 2) for motion in motions])
    covariance = block_covariance(-matrix[used], found.residuals[used], blocks[used])
    names = (*NAMES, "steady_x", "steady_y")
    spans = intervals(names, found.parameters, covariance)
    values = {name: float(value) for name, value in zip(names, found.parameters)}
    values["velocity_lag_s"] = lag
    values["r2"] = r_squared(everything[used], found.residuals[used])
    squared = np.concatenate([_columns(motion, is_quadratic=True) for motion in motions])
    other = trimmed_least_squares(squared, target)
    values.update((name, float(value)) for name, value in zip(QUADRATIC, other.parameters))
    values["quadratic_r2"] = r_squared(everything[other.used], other.residuals[other.used])
    values["speed_rms"] = float(np.linalg.norm(speed))
    estimate = Estimate(values, {name: spans[name] for name in NAMES})
    for name, moved in zip(NAMES, speed):
        interval = spans[name]
        if moved < _MOVED:
            reason = f"{name} velocity stayed below {_MOVED:g} m/s rms"
            estimate = estimate.without((name, f"quadratic_{name}"), reason)
        elif interval is None or interval[1] - interval[0] > 2.0 * _LOOSE:
            reason = f"the data leave drag {name} open"
            estimate = estimate.without((name, f"quadratic_{name}"), reason)
    return Drag(estimate, motions, target, found)


def _unexplained(motions: Sequence[Motion], thrust_map: Map, lag: float) -> np.ndarray:
    """Return the acceleration (2 w,) [m/s^2] that thrust does not explain: all of x, then of y."""
    rows = []
    for motion in motions:
        thrust = thrust_map.thrust(motion.percent(*thrust_map.late))
        force = motion.mean(thrust[:, None] * motion.up_late(lag)[:, :2])
        rows.append((motion.acceleration[:, :2] - force).T.ravel())
    return np.concatenate(rows)


def _best_lag(motions: Sequence[Motion], thrust_map: Map, matrix: np.ndarray) -> float:
    """Return how much later [s] than the attitude the velocity is; 0 unless that is plain."""

    def cost(lag: float) -> float:
        found = trimmed_least_squares(matrix, _unexplained(motions, thrust_map, lag))
        return float(np.sum(np.minimum(np.abs(found.residuals), _MOST_LEFT) ** 2))

    start = float(min(_LAGS, key=cost))
    bounds = (start - 0.02, start + 0.02)
    best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-3})
    return float(best.x) if best.fun < _BETTER * cost(0.0) else 0.0


def _along_heading(motion: Motion) -> np.ndarray:
    """Return forward and left velocity (m, 2) [m/s], mean in each interval of the grid."""
    (vx, vy), (c, s) = motion.velocity[:, :2].T, motion.heading.T
    at_points = np.stack([c * vx + s * vy, c * vy - s * vx], axis=1)
    return 0.5 * (at_points[1:] + at_points[:-1])


def _columns(motion: Motion, is_quadratic: bool = False) -> np.ndarray:
    """Return what the parameters multiply (2 w, 4): first all of x, then all of y."""
    speeds, heading = _along_heading(motion), 0.5 * (motion.heading[1:] + motion.heading[:-1])
    if is_quadratic:
        speeds = speeds * np.linalg.norm(motion.speed, axis=1, keepdims=True)
    forward = motion.mean(-speeds[:, :1] * heading)
    left = motion.mean(-speeds[:, 1:] * heading[:, ::-1] * np.array([-1.0, 1.0]))
    count = len(forward)
    steady = np.kron(np.eye(2), np.ones((count, 1)))
    return np.column_stack([forward.T.ravel(), left.T.ravel(), steady])


def mean_drag(drags: Sequence[Optional[float]]) -> Optional[float]:
    """Return the mean of the drags [1/s] that are known, or None."""
    known = [drag for drag in drags if drag is not None]
    return float(np.mean(known)) if known else None
