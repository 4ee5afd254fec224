# SPDX-License-Identifier: MIT
"""Response of the yaw rate to its command.

Measured is the change of yaw over a short window, not the gyro: in hardware-in-the-loop the gyro
does not turn. The model's response is averaged over the same window, so that nothing is biased.
"""

from dataclasses import dataclass, field
from typing import List, Optional

import numpy as np

from nmpc_control.analysis.identification.attitude import (
    NO_FLIGHT,
    withdraw_loose,
    without_shape,
)
from nmpc_control.analysis.identification.confidence import intervals
from nmpc_control.analysis.identification.estimate import Estimate, unidentified
from nmpc_control.analysis.identification.output_error import (
    Fit,
    ResponseModel,
    fit,
    fit_percents,
)
from nmpc_control.analysis.identification.passages import Passage
from nmpc_control.analysis.identification.response import FIRST, SECOND, Order

WINDOW = 0.1  # [s] the change of yaw is taken over
EXCITED = 0.05  # [rad/s] rms of commands below this tells nothing
_LEAST_FIT = 20.0  # [percent] below this, something else turned the aircraft


@dataclass(frozen=True)
class YawRate:
    """What is known of the yaw rate."""

    second: Estimate
    first: Estimate
    best: Optional[Fit] = None  # second order
    passages: List[Passage] = field(default_factory=list)


def identify_yaw_rate(passages: List[Passage]) -> YawRate:
    """Return what passages of the yaw rate tell of the response."""
    reason = _objection(passages)
    if not reason:
        best = fit(ResponseModel(SECOND, 1), passages)
        percent = fit_percents(best.model, best.parameters, passages)[0]
        if percent is None or percent < _LEAST_FIT:
            reason = f"the aircraft did not turn as commanded (fit {percent or 0.0:.0f} %)"
    if reason:
        return YawRate(*(_nothing(order, reason) for order in (SECOND, FIRST)))
    first = fit(ResponseModel(FIRST, 1), passages)
    simple = _estimate(first, passages)
    return YawRate(without_shape(_estimate(best, passages), simple), simple, best, passages)


def _objection(passages: List[Passage]) -> str:
    if not passages:
        return NO_FLIGHT.replace("attitude", "yaw rate")
    moved = float(np.concatenate([passage.inputs() for passage in passages]).std())
    if moved < EXCITED:
        return f"no excitation: commands of {moved:.3f} rad/s rms, expected {EXCITED:g} or more"
    return ""


def _nothing(order: Order, reason: str) -> Estimate:
    return unidentified((*order.names, "fit_percent"), order.names, reason)


def _estimate(found: Fit, passages: List[Passage]) -> Estimate:
    order = found.model.order
    percent = fit_percents(found.model, found.parameters, passages)[0]
    values = {name: float(value) for name, value in zip(order.names, found.rows[0])}
    spans = intervals(order.names, found.parameters, found.covariance(passages))
    return withdraw_loose(order, Estimate({**values, "fit_percent": percent}, spans))
