# SPDX-License-Identifier: MIT
"""Response of roll and pitch to their commands, and the flight controller's own tilt limit."""

from dataclasses import dataclass, field
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.identification.confidence import intervals, is_loose
from nmpc_control.analysis.identification.estimate import Estimate, unidentified
from nmpc_control.analysis.identification.output_error import (
    Fit,
    ResponseModel,
    fit,
    fit_percents,
)
from nmpc_control.analysis.identification.passages import Passage
from nmpc_control.analysis.identification.regimes import EXCITED
from nmpc_control.analysis.identification.response import FIRST, SECOND, Order

AXES = ("roll", "pitch")
LIMIT = "tilt_limit_rad"
NO_FLIGHT = "no part in flight follows attitude commands"
_LOOSE = 0.3  # [1] of a value: an interval that reaches further does not identify it
_LOOSE_DEAD_TIME = 0.05  # [s]
_BETTER = 0.1  # [percent] that a second order must fit better to be told from a first
_AT_BOUND = 0.01  # [1] of the range


@dataclass(frozen=True)
class Attitude:
    """What is known of roll and pitch."""

    second: Dict[str, Estimate]  # by axis
    first: Dict[str, Estimate]
    tilt_limit: Estimate
    lags: Optional[Fit] = None  # first order with one dead time for both: what the controller flies
    best: Optional[Fit] = None  # second order
    passages: List[Passage] = field(default_factory=list)


def identify_attitude(passages: List[Passage]) -> Attitude:
    """Return what passages of roll and pitch tell of the response."""
    reason = _objection(passages)
    if reason:
        limit = unidentified((LIMIT,), (LIMIT,), reason)
        return Attitude(_nothing(SECOND, reason), _nothing(FIRST, reason), limit)
    largest = max(np.linalg.norm(p.commands, axis=1).max() for p in passages)
    best, limit = _with_limit(passages, float(largest))
    has_limit = best.model.has_limit
    first = fit(ResponseModel(FIRST, 2, has_limit), passages)
    lags = fit(ResponseModel(FIRST, 2, has_limit, shares_dead_time=True), passages)
    simple = _estimates(first, passages)
    second = {
        axis: without_shape(estimate, simple[axis])
        for axis, estimate in _estimates(best, passages).items()
    }
    return Attitude(second, simple, limit, lags, best, passages)


def _objection(passages: Sequence[Passage]) -> str:
    """Return why nothing can be told; empty if something can."""
    if not passages:
        return NO_FLIGHT
    if max(_excitations(passages)) < EXCITED:
        moved = ", ".join(f"{x:.3f}" for x in _excitations(passages))
        return f"no excitation: commands of {moved} rad rms, expected {EXCITED:g} or more"
    return ""


def _excitations(passages: Sequence[Passage]) -> np.ndarray:
    """Return how much each axis was commanded to move (2,) [rad], standard deviation."""
    return np.concatenate([passage.inputs() for passage in passages]).std(axis=0)


def _nothing(order: Order, reason: str) -> Dict[str, Estimate]:
    return {a: unidentified((*order.names, "fit_percent"), order.names, reason) for a in AXES}


def _with_limit(passages: List[Passage], largest: float) -> Tuple[Fit, Estimate]:
    """Return the best fit, with the tilt limit only where commands went beyond it."""
    found = fit(ResponseModel(SECOND, 2, has_limit=True), passages)
    interval = intervals(("",) * 8 + (LIMIT,), found.parameters, found.covariance(passages))[LIMIT]
    if found.limit < largest and not is_loose(found.limit, interval, 0.1):
        return found, Estimate({LIMIT: found.limit}, {LIMIT: interval})
    reason = f"commands of up to {largest:.3f} rad were followed: no limit below that was seen"
    found = fit(ResponseModel(SECOND, 2), passages)
    return found, unidentified((LIMIT,), (LIMIT,), reason)


def _estimates(found: Fit, passages: Sequence[Passage]) -> Dict[str, Estimate]:
    order = found.model.order
    labels = [(axis, name) for axis in AXES for name in order.names]
    labels += [("", LIMIT)] * found.model.has_limit
    spans = intervals(labels, found.parameters, found.covariance(passages))
    percents = fit_percents(found.model, found.parameters, passages)
    estimates = {}
    for number, axis in enumerate(AXES):
        row = found.rows[number]
        values = {name: float(v) for name, v in zip(order.names, row)}
        own = {name: spans[axis, name] for name in order.names}
        estimate = Estimate({**values, "fit_percent": percents[number]}, own)
        if _excitations(passages)[number] < EXCITED:
            reason = f"no excitation: {_excitations(passages)[number]:.3f} rad rms of commands"
            estimates[axis] = unidentified(estimate.values, order.names, reason)
            continue
        estimates[axis] = withdraw_loose(order, estimate)
    return estimates


def without_shape(second: Estimate, first: Estimate) -> Estimate:
    """Return a second-order estimate without its shape where first order fits no worse."""
    fits = [estimate.values["fit_percent"] for estimate in (second, first)]
    if None in fits or fits[0] > fits[1] + _BETTER:
        return second
    return second.without(("omega", "zeta"), "a first-order response fits as well")


def withdraw_loose(order: Order, estimate: Estimate) -> Estimate:
    """Return the estimate without the parameters that the data leave open."""
    loose = []
    for name, low, high in zip(order.names, order.lower, order.upper):
        value, interval = estimate.values[name], estimate.confidence[name]
        is_dead_time = name == order.names[-1]
        share, floor = (0.0, _LOOSE_DEAD_TIME) if is_dead_time else (_LOOSE, 0.0)
        is_at_bound = value > high - _AT_BOUND * (high - low) or (
            not is_dead_time and value < low + 1e-6
        )
        if is_at_bound or is_loose(value, interval, share, floor):
            loose.append(name)
    if not loose:
        return estimate
    if all(interval is None for interval in estimate.confidence.values()):
        why = "too little data for an interval"
    else:
        why = f"the data leave {', '.join(loose)} open"
    return estimate.without(loose, why)
