# SPDX-License-Identifier: MIT
"""Everything that a set of logs of one aircraft tells of it."""

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.analysis.identification.attitude import AXES, Attitude, identify_attitude
from nmpc_control.analysis.identification.battery import Battery, identify_battery
from nmpc_control.analysis.identification.drag import Drag, identify_drag
from nmpc_control.analysis.identification.log import Log
from nmpc_control.analysis.identification.noise import identify_noise
from nmpc_control.analysis.identification.passages import (
    Stretch,
    attitude_passages,
    yaw_passages,
)
from nmpc_control.analysis.identification.regimes import classify
from nmpc_control.analysis.identification.segments import (
    FLIGHT,
    LIMITED,
    Segment,
    segments,
    stretches,
)
from nmpc_control.analysis.identification.thrust import Thrust, identify_thrust
from nmpc_control.analysis.identification.translation import motions
from nmpc_control.analysis.identification.validation import cross_validate, validate
from nmpc_control.analysis.identification.yaw_rate import WINDOW, YawRate, identify_yaw_rate
from nmpc_control.errors import BagError

Period = Tuple[float, float]  # [s] on the bag's clock
ALWAYS: Period = (-np.inf, np.inf)
_NO_DEAD_TIME = 1e-3  # [s]


@dataclass(frozen=True)
class Identification:
    """The aircraft, as its logs show it."""

    bags: Tuple[str, ...]
    source: str
    regime: str  # kind of the segments that all this is from
    segments: Tuple[Segment, ...]
    attitude: Attitude
    yaw_rate: YawRate
    thrust: Thrust
    drag: Drag
    battery: Battery
    noise: Dict[str, Any]
    cross_validation: Dict[str, Any]
    validation: Optional[Dict[str, Any]]
    other_regime: Optional[Dict[str, Any]]  # what the limited segments, left out, were like
    remarks: Tuple[str, ...]


def identify(
    logs: Sequence[Log],
    fit_period: Period = ALWAYS,
    validation_period: Optional[Period] = None,
    regime: str = FLIGHT,
) -> Identification:
    """Return what logs of one aircraft tell.

    Args:
        logs: at least one, all of the same source.
        fit_period: parameters are from this part of the bag.
        validation_period: their fit is also given on this part.
        regime: kind of segments to use, FLIGHT or LIMITED.

    Raises:
        BagError: the logs are of different sources.
    """
    sources = sorted({log.source for log in logs})
    if len(sources) > 1:
        raise BagError(f"bags of different sources ({', '.join(sources)}) are not one aircraft")
    kinds = classify(logs)
    parts = _stretches(logs, kinds, regime)
    passages = attitude_passages(parts, *fit_period)
    attitude = identify_attitude(passages)
    thrust = identify_thrust(motions(parts, *fit_period))
    held_back = None
    if validation_period is not None:
        held_back = validate(attitude.best, attitude_passages(parts, *validation_period))
        held_back.update(zip(("start", "end"), validation_period))
    limited = _stretches(logs, kinds, LIMITED) if regime == FLIGHT else []
    return Identification(
        bags=tuple(log.bag for log in logs),
        source=sources[0],
        regime=regime,
        segments=tuple(s for log, kind in zip(logs, kinds) for s in segments(log, kind)),
        attitude=attitude,
        yaw_rate=identify_yaw_rate(yaw_passages(parts, WINDOW, *fit_period)),
        thrust=thrust,
        drag=identify_drag(thrust),
        battery=identify_battery(thrust),
        noise=identify_noise(parts, sources[0]),
        cross_validation=cross_validate(attitude.best, passages),
        validation=held_back,
        other_regime=_other_regime(limited),
        remarks=(*_remarks(logs, parts, limited), *_clocks(attitude)),
    )


def _stretches(logs: Sequence[Log], kinds: Sequence[np.ndarray], kind: str) -> List[Stretch]:
    return [s for log, found in zip(logs, kinds) for s in stretches(log, found, kind)]


def _other_regime(limited: Sequence[Stretch]) -> Optional[Dict[str, Any]]:
    """Return the response in the segments with limited attitude, for comparison only."""
    if not limited:
        return None
    passages = attitude_passages(limited)
    tilts = [np.linalg.norm(passage.values, axis=1).max() for passage in passages]
    found = identify_attitude(passages)
    responses = {axis: found.second[axis].as_dict() for axis in AXES}
    return {**responses, "largest_tilt_rad": float(max(tilts, default=np.nan))}


def _remarks(
    logs: Sequence[Log], parts: Sequence[Stretch], limited: Sequence[Stretch]
) -> Tuple[str, ...]:
    remarks = [f"{log.bag}: {remark}" for log in logs for remark in log.remarks]
    if limited:
        names = ", ".join(dict.fromkeys(stretch.log.bag for stretch in limited))
        remarks.append(f"{names}: attitude followed a small part of the commands; not mixed in")
    if not parts and limited:
        remarks.append("nothing else was flown: --regime limited identifies that regime")
    return tuple(remarks)


def _clocks(attitude: Attitude) -> Tuple[str, ...]:
    """Return a warning where the response follows its command without any dead time."""
    for axis in AXES:
        dead_time = attitude.first[axis].values["dead_time_s"]
        if dead_time is not None and dead_time < _NO_DEAD_TIME:
            return (f"{axis}: no dead time: no link in between, or two clocks that differ",)
    return ()
