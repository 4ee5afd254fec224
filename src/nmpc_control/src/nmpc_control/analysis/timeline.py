# SPDX-License-Identifier: MIT
"""Who flew when, and on what: modes, rungs and authority; automatic and manual parts apart."""

from typing import Dict, List, NamedTuple, Optional

import numpy as np

from nmpc_control.analysis.record import (
    AUTHORITY,
    MODE,
    RUNG,
    FlightRecord,
    Metrics,
    Series,
)
from nmpc_control.analysis.windows import Window, scenario_window
from nmpc_control.dji import RC_SWITCH_TOLERANCE
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import AUTOMATIC, Mode

RC_MODE_F = 8000.0  # [raw] of the mode switch: only there an M100 obeys its SDK
_RC_MODE_AXIS, _RC_LINK_AXIS = 4, 5
_MOST_PERIODS = 2000  # listed; a mode that flutters is a defect, not a list


class Period(NamedTuple):
    """A part of a flight in one mode."""

    start: float  # [s]
    end: float  # [s]
    mode: str
    automatic: Optional[bool]  # None: on the ground or unknown
    authority: Optional[bool]  # None: not known


def periods(record: FlightRecord) -> List[Period]:
    """Return the parts of a flight by mode; from the transmitter's switch where no guard told.

    Of the only flight of a bag they are those of the whole bag, on the ground too.
    """
    found = _of_bag(record)
    spans = [span for span in (record.automatic, record.airborne) if span is not None]
    if record.flight[1] <= 1 or not spans:
        return found
    first, last = min(span[0] for span in spans), max(span[1] for span in spans)
    inside = [p._replace(start=max(p.start, first), end=min(p.end, last)) for p in found]
    return [p for p in inside if p.start < p.end]


def _of_bag(record: FlightRecord) -> List[Period]:
    if record.status is not None and len(record.status):
        return _of_status(record.status)
    if record.rc is not None and len(record.rc):
        return _of_switch(record)
    if record.airborne is not None:
        return [Period(*record.airborne, "in the air", None, None)]
    return []


def shown_window(record: FlightRecord) -> Optional[Window]:
    """Return what drawings show: the evaluated time, with what was flown by hand before and after.

    Errors are shown as long as the reference's own time runs.
    """
    window = scenario_window(record)
    flown = [p for p in periods(record) if p.automatic is not None]
    by_hand = [p for p in flown if not p.automatic]
    if window is None or record.between is not None or not by_hand:
        return window
    start, end = min(window.start, by_hand[0].start), max(window.end, flown[-1].end)
    if record.airborne is not None:
        start = min(window.start, max(start, record.airborne[0]))
        end = max(window.end, min(end, record.airborne[1]))
    reference = record.reference
    last = end if reference is None else min(end, reference.start + reference.duration)
    return Window(start, max(window.reference_end, last), end)


def _of_status(status: Series) -> List[Period]:
    values = status.values
    authority = values[:, AUTHORITY] if values.shape[1] > AUTHORITY else np.full(len(values), -1)
    found = []
    for start, end, (mode, held) in _runs(
        status.times, np.stack([values[:, MODE], authority], axis=1)
    ):
        name = Mode(int(mode)).name.lower() if mode in list(Mode) else f"mode {mode:.0f}"
        is_manual = mode in (Mode.MANUAL, Mode.RELEASED)
        automatic = True if mode in AUTOMATIC else False if is_manual else None
        found.append(Period(start, end, name, automatic, None if held < 0 else bool(held)))
    return found


def _of_switch(record: FlightRecord) -> List[Period]:
    """Automatic is the switch at F with the link alive, as the paper's code took it."""
    values = record.rc.values
    is_f = np.abs(values[:, _RC_MODE_AXIS] - RC_MODE_F) <= RC_SWITCH_TOLERANCE
    kind = (is_f & (values[:, _RC_LINK_AXIS] != 0.0)).astype(float)
    if record.airborne is not None:
        first, last = record.airborne
        kind[(record.rc.times < first) | (record.rc.times > last)] = -1.0
    names = {1.0: "switch at F", 0.0: "switch not at F", -1.0: "on the ground"}
    return [
        Period(start, end, names[value], None if value < 0 else bool(value), None)
        for start, end, (value,) in _runs(record.rc.times, kind[:, None])
    ]


def _runs(times: np.ndarray, values: np.ndarray) -> List:
    """Return start, end and value of each run of equal rows; a run ends where the next begins."""
    edges = np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1)) + 1
    starts = np.concatenate(([0], edges)).astype(int)
    ends = np.concatenate((edges, [len(times) - 1])).astype(int)
    return [(float(times[a]), float(times[b]), values[a]) for a, b in zip(starts, ends)]


def timeline_figures(record: FlightRecord, missing: List[str]) -> Metrics:
    """Return the timeline and the time in each mode and on each rung."""
    found = periods(record)
    figures: Metrics = {
        "timeline": [period._asdict() for period in found[:_MOST_PERIODS]] or None,
        "automatic_time_s": None,
        "manual_time_s": None,
        "mode_time_s": None,
        "rung_time_s": _rung_times(record),
    }
    if not found:
        missing.append("neither status nor transmitter: no timeline of modes and authority")
        return figures
    if len(found) > _MOST_PERIODS:
        missing.append(f"{len(found)} changes of mode: the first {_MOST_PERIODS} are listed")
    by_mode: Dict[str, float] = {}
    for period in found:
        by_mode[period.mode] = by_mode.get(period.mode, 0.0) + period.end - period.start
    figures["mode_time_s"] = by_mode
    if any(period.automatic is not None for period in found):
        for key, kind in (("automatic_time_s", True), ("manual_time_s", False)):
            figures[key] = sum(p.end - p.start for p in found if p.automatic is kind)
    return figures


def _rung_times(record: FlightRecord) -> Optional[Dict[str, float]]:
    """Return the time on each rung of the guard's ladder in this flight [s]."""
    status = record.status
    if status is None or len(status) < 2 or status.values.shape[1] <= RUNG:
        return None
    if record.automatic is not None:
        status = status.between(*record.automatic)
    if len(status) < 2:
        return None
    lasting, rung = np.diff(status.times), status.values[:-1, RUNG]
    return {r.name.lower(): lasting[rung == r].sum() for r in Rung if np.any(rung == r)}
