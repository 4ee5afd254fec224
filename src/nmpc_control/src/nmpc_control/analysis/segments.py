# SPDX-License-Identifier: MIT
"""Figures of parts of a flight: by mode, by length of time, by goal of the action."""

import math
from dataclasses import replace
from typing import List, NamedTuple, Optional

from nmpc_control.analysis.clearance import clearance_figures
from nmpc_control.analysis.effort import command_figures, solver_figures
from nmpc_control.analysis.inputs import InputLimits, input_figures
from nmpc_control.analysis.motion import motion_figures
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.streams import stream_figures
from nmpc_control.analysis.timeline import periods
from nmpc_control.analysis.tracking import reference_figures
from nmpc_control.analysis.windows import Window, scenario_window

MODE, GOAL = "mode", "goal"
_SHORTEST = 0.2  # [s] shorter parts are not listed
_MOST = 1000  # parts


class Part(NamedTuple):
    """A part of a flight."""

    name: str
    start: float  # [s]
    end: float  # [s]
    automatic: Optional[bool]  # None: neither or not known


def parts(record: FlightRecord, by: str) -> List[Part]:
    """Return the parts of a flight.

    Args:
        record: The flight.
        by: "mode" (automatic and manual apart), "goal" (of the action) or a length of time [s],
            which cuts the evaluated time.

    Raises:
        ValueError: it is none of them.
    """
    if by == MODE:
        found = [Part(p.mode, p.start, p.end, p.automatic) for p in periods(record)]
    elif by == GOAL:
        found = [Part(name or "goal", start, end, None) for name, start, end in record.goals]
    else:
        found = _by_time(record, length_of(by))
    if record.between is not None:
        first, last = record.between
        found = [p._replace(start=max(p.start, first), end=min(p.end, last)) for p in found]
    return [part for part in found if part.end - part.start >= _SHORTEST][:_MOST]


def length_of(by: str) -> float:
    """Return the length [s] of the parts, NaN by mode or goal; raises ValueError."""
    if by in (MODE, GOAL):
        return math.nan
    try:
        length = float(by)
    except ValueError:
        length = math.nan
    if not _SHORTEST <= length < math.inf:
        raise ValueError(f"got {by}, expected {MODE}, {GOAL} or seconds from {_SHORTEST:g} on")
    return length


def _by_time(record: FlightRecord, length: float) -> List[Part]:
    window = scenario_window(record)
    if window is None:
        return []
    count = min(math.ceil((window.end - window.start) / length), _MOST)
    edges = [min(window.start + k * length, window.end) for k in range(count + 1)]
    return [
        Part(f"{a - window.start:.4g} to {b - window.start:.4g} s", a, b, None)
        for a, b in zip(edges[:-1], edges[1:])
    ]


def segment_figures(
    record: FlightRecord, found: List[Part], radius: float, limits: InputLimits
) -> List[Metrics]:
    """Return the figures of each part that mean something for a part."""
    return [_figures(record, part, radius, limits) for part in found]


def _figures(record: FlightRecord, part: Part, radius: float, limits: InputLimits) -> Metrics:
    missing: List[str] = []  # what the whole flight lacks is said there
    window = Window(part.start, part.end, part.end)
    reference = record.reference
    if reference is not None:
        first, last = reference.start, reference.start + reference.duration
        start, end = max(part.start, first), min(part.end, last)
        window = Window(part.start, end, part.end) if start < end else window
        if start >= end:  # the reference did not run in this part
            reference = None
    inside = replace(record, automatic=(part.start, part.end), reference=reference)
    position = record.position
    if reference is not None and position is not None:
        inside = replace(inside, position=position.between(max(part.start, first), part.end))
    figures: Metrics = {
        "name": part.name,
        "start_s": part.start,
        "end_s": part.end,
        "automatic": part.automatic,
    }
    figures.update(reference_figures(inside, window, missing))
    inside = replace(inside, position=position)
    figures.update(solver_figures(inside, window, missing))
    figures.update(command_figures(inside, window, missing))
    figures.update(input_figures(inside, window, limits, missing))
    figures.update(clearance_figures(inside, window, radius, missing))
    figures.update(motion_figures(inside, window, missing))
    figures.update(stream_figures(inside, window, missing))
    del figures["input_limits"]
    return figures
