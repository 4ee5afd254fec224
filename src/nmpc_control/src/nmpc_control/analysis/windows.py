# SPDX-License-Identifier: MIT
"""Which part of a flight a figure is about."""

from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from nmpc_control.analysis.record import MODE, FlightRecord, Series
from nmpc_control.mode_inputs import STREAMING, Mode


@dataclass(frozen=True)
class Window:
    """The scenario's phase; without a reference, all that can be evaluated."""

    start: float  # [s] the reference's clock starts: first motion
    reference_end: float  # [s] the reference's time is over, or the phase is
    end: float  # [s] end of the phase: landing, the next trajectory, or end of the data


def runs(times: np.ndarray, is_inside: np.ndarray) -> List[Tuple[float, float]]:
    """Return start and end [s] of each run of true samples; the first false one ends it."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], is_inside.astype(int), [0]))))
    last = len(times) - 1
    return [(float(times[a]), float(times[min(b, last)])) for a, b in zip(edges[::2], edges[1::2])]


def mode_runs(status: Optional[Series], modes: Tuple[Mode, ...]) -> List[Tuple[float, float]]:
    """Return the periods [s] in which the guard was in one of the modes."""
    if status is None:
        return []
    return runs(status.times, np.isin(status.values[:, MODE], modes))


def run_at(periods: List[Tuple[float, float]], t: float) -> Optional[Tuple[float, float]]:
    """Return the period [s] that holds a time [s], or None."""
    return next((period for period in periods if period[0] <= t <= period[1]), None)


def scenario_window(record: FlightRecord) -> Optional[Window]:
    """Return the period to evaluate, or None where nothing says when the flight was."""
    window = _phase(record)
    if record.between is None:
        return window
    start, end = record.between
    reference_end = end if window is None else min(end, window.reference_end)
    return Window(start, max(start, reference_end), end)


def _phase(record: FlightRecord) -> Optional[Window]:
    if record.reference is None:
        period = record.automatic or record.airborne or _extent(record)
        return period and Window(period[0], period[1], period[1])
    start = record.reference.start
    ends = [record.phase_end, (_extent(record) or (start, start))[1]]
    streaming = run_at(mode_runs(record.status, STREAMING), start)
    if streaming is not None:
        ends.append(streaming[1])
    end = max(start, min(t for t in ends if t is not None))
    return Window(start, min(end, start + record.reference.duration), end)


def _extent(record: FlightRecord) -> Optional[Tuple[float, float]]:
    series = (record.position, record.true_position, record.velocity, record.commands)
    present = [s for s in series if s is not None and len(s)]
    if not present:
        return None
    return float(min(s.times[0] for s in present)), float(max(s.times[-1] for s in present))
