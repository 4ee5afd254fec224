# SPDX-License-Identifier: MIT
"""Affine map from DJI's thrust percentage to acceleration, its dead time, and vertical drag.

    mean(vz') + g = slope mean(u(t - d) c) + offset mean(c) - k mean(vz),   c = cos(roll) cos(pitch)

Where the battery fell far enough, the offset moves with its charge and is stated at the mean one.
"""

from dataclasses import dataclass, field, replace
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.optimize import minimize_scalar

from nmpc_control.analysis.identification.confidence import (
    BLOCK,
    block_covariance,
    intervals,
    is_loose,
)
from nmpc_control.analysis.identification.estimate import Estimate, unidentified
from nmpc_control.analysis.identification.response import LONGEST_DEAD_TIME
from nmpc_control.analysis.identification.robust import (
    LinearFit,
    r_squared,
    trimmed_least_squares,
)
from nmpc_control.analysis.identification.translation import Motion
from nmpc_control.state import GRAVITY

NAMES = ("slope", "offset", "dead_time_s")
FIGURES = (*NAMES, "hover_percent", "r2")
VERTICAL = "vertical"
PER_CHARGE = "offset_per_charge"
_EXCITED = 1.0  # [percent] standard deviation of thrust below this tells no slope
_MOVED = 0.3  # [m/s] rms of the vertical velocity below this tells no drag
_FEWEST = 50  # windows
_STILL = 0.1  # [m/s^2] and [m/s]: a window that hovers
_DISCHARGED = 10.0  # [percent] of charge from which on the offset may move with it
_LEVEL = 0.995  # [1] cosine of the tilt
_LOOSE = 0.2  # [1]
_LOOSE_DEAD_TIME = 0.05  # [s]
_SCAN = np.arange(0.0, LONGEST_DEAD_TIME + 1e-9, 0.02)  # [s]


class Map(NamedTuple):
    """The numbers alone, for what builds on them."""

    slope: float  # [m/s^2 per percent]
    offset: float  # [m/s^2]
    dead_time: float  # [s]
    vertical_drag: float  # [1/s]

    def thrust(self, percent: np.ndarray) -> np.ndarray:
        """Return the acceleration [m/s^2] of percentages."""
        return self.slope * percent + self.offset


class _Terms(NamedTuple):
    """What is fitted beside slope and offset."""

    has_drag: bool
    charge: Optional[float]  # [percent] at which the offset is stated; None: it does not move

    @property
    def names(self) -> Tuple[str, ...]:
        """Names of the linear parameters."""
        drag = (VERTICAL,) if self.has_drag else ()
        return ("slope", "offset", *drag, *(() if self.charge is None else (PER_CHARGE,)))


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
    dead_time, found = _best_dead_time(motions, target, terms)
    parameters = np.append(found.parameters, dead_time)
    names = (*terms.names, "dead_time_s")
    spans = intervals(names, parameters, _covariance(motions, dead_time, found, terms))
    by_name = {name: float(value) for name, value in zip(names, parameters)}
    slope, offset, drag = by_name["slope"], by_name["offset"], by_name.get(VERTICAL, 0.0)
    used = found.used
    values = {
        "slope": slope,
        "offset": offset,
        "dead_time_s": dead_time,
        "hover_percent": (GRAVITY - offset) / slope if slope else None,
        "r2": r_squared(target[used], found.residuals[used]),
    }
    if terms.charge is not None:
        values.update(charge_percent=terms.charge, offset_per_charge=by_name[PER_CHARGE])
    told = [name for name in names if name != VERTICAL]
    estimate = Estimate(values, {name: spans[name] for name in told})
    if slope <= 0.0 or is_loose(slope, spans["slope"], _LOOSE):
        reason = "the data leave the slope open: thrust must rise and fall more, and for longer"
        return _without_map(estimate.without(FIGURES, reason), motions, reason)
    if is_loose(dead_time, spans["dead_time_s"], 0.0, _LOOSE_DEAD_TIME):
        estimate = estimate.without(("dead_time_s",), "the data leave the dead time open")
    if terms.has_drag:
        vertical = Estimate({VERTICAL: drag}, {VERTICAL: spans[VERTICAL]})
    else:
        slow = f"vertical velocity stayed below {_MOVED:g} m/s rms"
        vertical = unidentified((VERTICAL,), (VERTICAL,), slow)
    return Thrust(estimate, vertical, Map(slope, offset, dead_time, drag), motions, found)


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


def _terms(motions: Sequence[Motion]) -> _Terms:
    """Return which terms the flight can tell."""
    climb = np.concatenate([motion.mean(motion.speed[:, 2]) for motion in motions])
    level = np.concatenate([motion.level for motion in motions])
    discharges = np.isfinite(level).all() and np.ptp(level) > _DISCHARGED
    has_drag = bool(np.sqrt(np.mean(climb**2)) > _MOVED)
    return _Terms(has_drag, float(level.mean()) if discharges else None)


def _columns(motions: Sequence[Motion], dead_time: float, terms: _Terms) -> np.ndarray:
    rows = []
    for motion in motions:
        up = motion.up[:, 2]
        parts = [motion.percent(dead_time) * up, up]
        if terms.has_drag:
            parts.append(-motion.speed[:, 2])
        row = motion.mean(np.stack(parts, axis=1))
        if terms.charge is not None:
            row = np.column_stack([row, motion.mean(up) * (motion.level - terms.charge)])
        rows.append(row)
    return np.concatenate(rows)


def _best_dead_time(
    motions: Sequence[Motion], target: np.ndarray, terms: _Terms
) -> Tuple[float, LinearFit]:
    """Return the dead time [s] that fits best, to a fraction of a sample, and the fit with it."""

    def solve(dead_time: float) -> LinearFit:
        return trimmed_least_squares(_columns(motions, dead_time, terms), target)

    def cost(dead_time: float) -> float:
        return float(np.median(np.abs(solve(dead_time).residuals)))

    begin = float(min(_SCAN, key=cost))
    used = solve(begin).used

    def trimmed_cost(dead_time: float) -> float:
        columns = _columns(motions, dead_time, terms)[used]
        solution = np.linalg.lstsq(columns, target[used], rcond=None)[0]
        return float(np.sum((target[used] - columns @ solution) ** 2))

    low, high = max(0.0, begin - 0.04), min(LONGEST_DEAD_TIME, begin + 0.04)
    best = minimize_scalar(trimmed_cost, bounds=(low, high), method="bounded")
    return float(best.x), solve(float(best.x))


def _covariance(
    motions: Sequence[Motion], dead_time: float, found: LinearFit, terms: _Terms
) -> Optional[Tuple[np.ndarray, int]]:
    """Return the covariance of the linear parameters and the dead time."""
    step = 0.005  # [s]
    columns = _columns(motions, dead_time, terms)
    later = _columns(motions, dead_time + step, terms) @ found.parameters
    earlier = _columns(motions, max(0.0, dead_time - step), terms) @ found.parameters
    slope = (later - earlier) / (step + min(step, dead_time))
    jacobian = -np.column_stack([columns, slope])
    blocks = np.concatenate([motion.blocks(BLOCK) for motion in motions])
    used = found.used
    return block_covariance(jacobian[used], found.residuals[used], blocks[used])
