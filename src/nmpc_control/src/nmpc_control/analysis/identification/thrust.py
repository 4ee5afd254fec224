# SPDX-License-Identifier: MIT
"""Affine map from DJI's thrust percentage to acceleration, dead time and lag, and vertical drag.

    mean(vz') + g = slope mean(u c) + offset mean(c) - k mean(vz),   c = cos(roll) cos(pitch)

u is the percentage after a dead time and, where the data tell the two apart, a first-order lag.
Where the battery fell far enough, the offset moves with its charge and is stated at the mean one.
"""

from dataclasses import dataclass, field, replace
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.identification.confidence import intervals, is_loose
from nmpc_control.analysis.identification.estimate import Estimate, unidentified
from nmpc_control.analysis.identification.robust import LinearFit, r_squared
from nmpc_control.analysis.identification.thrust_fit import (
    LONGEST_LAG,
    PER_CHARGE,
    VERTICAL,
    Late,
    Terms,
    ThrustProblem,
)
from nmpc_control.analysis.identification.translation import Motion
from nmpc_control.state import GRAVITY

NAMES = ("slope", "offset", "dead_time_s", "lag_s")
FIGURES = (*NAMES, "hover_percent", "r2")
_EXCITED = 1.0  # [percent] standard deviation of thrust below this tells no slope
_MOVED = 0.3  # [m/s] rms of the vertical velocity below this tells no drag
_FEWEST = 50  # windows
_STILL = 0.1  # [m/s^2] and [m/s]: a window that hovers
_DISCHARGED = 10.0  # [percent] of charge from which on the offset may move with it
_LEVEL = 0.995  # [1] cosine of the tilt
_LOOSE = 0.2  # [1]
_LOOSE_DEAD_TIME = 0.05  # [s]
_LOOSE_LAG = 0.02  # [s]
_LEAST_LAG = 0.01  # [s] half a command's period: less is as well a dead time


class Map(NamedTuple):
    """The numbers alone, for what builds on them."""

    slope: float  # [m/s^2 per percent]
    offset: float  # [m/s^2]
    vertical_drag: float  # [1/s]
    late: Late

    def thrust(self, percent: np.ndarray) -> np.ndarray:
        """Return the acceleration [m/s^2] of percentages."""
        return self.slope * percent + self.offset


@dataclass(frozen=True)
class Thrust:
    """What is known of thrust and vertical drag."""

    estimate: Estimate
    vertical_drag: Estimate
    map: Optional[Map] = None
    motions: List[Motion] = field(default_factory=list)
    fit: Optional[LinearFit] = None


def identify_thrust(motions: List[Motion]) -> Thrust:
    """Return what vertical motion tells of thrust."""
    reason = _objection(motions)
    if reason:
        return _without_map(unidentified(FIGURES, NAMES, reason), motions, reason)
    target = np.concatenate([m.acceleration[:, 2] for m in motions]) + GRAVITY
    terms = _terms(motions)
    problem = ThrustProblem(motions, target, terms)
    late, found, unlagged = _lateness(problem, terms)
    has_lag = not unlagged
    names = (*terms.names, *NAMES[2 : 3 + has_lag])
    parameters = [*found.parameters, *late[: 1 + has_lag]]
    spans = intervals(names, parameters, problem.covariance(late, found, has_lag))
    by_name = {name: float(value) for name, value in zip(names, parameters)}
    slope, offset, drag = by_name["slope"], by_name["offset"], by_name.get(VERTICAL, 0.0)
    used = found.used
    values = {
        "slope": slope,
        "offset": offset,
        "dead_time_s": late.dead_time,
        "lag_s": by_name.get("lag_s"),
        "hover_percent": (GRAVITY - offset) / slope if slope else None,
        "r2": r_squared(target[used], found.residuals[used]),
    }
    if terms.charge is not None:
        values.update(charge_percent=terms.charge, offset_per_charge=by_name[PER_CHARGE])
    told = [name for name in names if name != VERTICAL]
    confidence = {"lag_s": None, **{name: spans[name] for name in told}}
    estimate = Estimate(values, confidence, unlagged or None)
    if slope <= 0.0 or is_loose(slope, spans["slope"], _LOOSE):
        reason = "the data leave the slope open: thrust must rise and fall more, and for longer"
        return _without_map(estimate.without(FIGURES, reason), motions, reason)
    if is_loose(late.dead_time, spans["dead_time_s"], 0.0, _LOOSE_DEAD_TIME):
        estimate = estimate.without(("dead_time_s",), "the data leave the dead time open")
    if terms.has_drag:
        vertical = Estimate({VERTICAL: drag}, {VERTICAL: spans[VERTICAL]})
    else:
        slow = f"vertical velocity stayed below {_MOVED:g} m/s rms"
        vertical = unidentified((VERTICAL,), (VERTICAL,), slow)
    return Thrust(estimate, vertical, Map(slope, offset, drag, late), motions, found)


def _lateness(problem: ThrustProblem, terms: Terms) -> Tuple[Late, LinearFit, str]:
    """Return dead time and lag, the fit with them, and why there is no lag; empty if there is."""
    alone, simple = problem.best_dead_time()
    late, found = problem.with_lag(alone, simple.used)
    values = [*found.parameters, *late]
    covariance = problem.covariance(late, found, has_lag=True)
    interval = intervals((*terms.names, *NAMES[2:]), values, covariance)["lag_s"]
    if late.lag > 0.99 * LONGEST_LAG or is_loose(late.lag, interval, 0.0, _LOOSE_LAG):
        return alone, simple, "lag and dead time cannot be told apart: dead_time_s holds both"
    if min(late.lag - _LEAST_LAG, interval[0]) <= 0.0:
        return alone, simple, "a dead time without a lag explains thrust as well"
    return late, found, ""


def _without_map(estimate: Estimate, motions: List[Motion], reason: str) -> Thrust:
    """Return what is left without a map: the thrust at which the aircraft hovered, if it did."""
    hover = np.concatenate([_hovering(motion) for motion in motions] or [np.zeros(0)])
    if len(hover) >= _FEWEST:
        values = {**estimate.values, "hover_percent": float(hover.mean())}
        estimate = replace(estimate, values=values)
    return Thrust(estimate, unidentified((VERTICAL,), (VERTICAL,), reason))


def _hovering(motion: Motion) -> np.ndarray:
    """Return the thrust [percent] of windows in which nothing accelerated or climbed."""
    percent = motion.mean(motion.percent(0.0))
    is_still = np.abs(motion.acceleration[:, 2]) < _STILL
    is_still &= np.abs(motion.mean(motion.speed[:, 2])) < _STILL
    return percent[is_still & (motion.mean(motion.up[:, 2]) > _LEVEL)]


def _objection(motions: Sequence[Motion]) -> str:
    """Return why nothing can be told; empty if something can."""
    windows = sum(len(motion.times) for motion in motions)
    if windows < _FEWEST:
        return "no part in flight with thrust commands and velocity that is long enough"
    moved = float(np.concatenate([motion.mean(motion.percent(0.0)) for motion in motions]).std())
    if moved < _EXCITED:
        return f"no excitation: thrust moved by {moved:.2f} percent rms, expected {_EXCITED:g}"
    return ""


def _terms(motions: Sequence[Motion]) -> Terms:
    """Return which terms the flight can tell."""
    climb = np.concatenate([motion.mean(motion.speed[:, 2]) for motion in motions])
    level = np.concatenate([motion.level for motion in motions])
    discharges = np.isfinite(level).all() and np.ptp(level) > _DISCHARGED
    has_drag = bool(np.sqrt(np.mean(climb**2)) > _MOVED)
    return Terms(has_drag, float(level.mean()) if discharges else None)
