# SPDX-License-Identifier: MIT
"""How well a flight followed its reference, and whether and when it arrived."""

from typing import List, Optional

import numpy as np

from nmpc_control.analysis.deviation import arrival_time, errors, path_deviation
from nmpc_control.analysis.following import following_figures
from nmpc_control.analysis.gaps import LONGEST_GAP, distance_to_sample, uncovered
from nmpc_control.analysis.record import FlightRecord, Metrics, Reference, Series
from nmpc_control.analysis.windows import Window

TRANSIENT = 6.0  # [s] that the deviation "after 6 s" leaves out
_TOLERANCE = 0.5  # [s] a flight that ends this much before its reference is cut short
_ARRIVAL_FIGURES = ("arrived", "navigation_time_s", "end_distance_m", "total_time_s")


def reference_figures(
    record: FlightRecord, window: Optional[Window], missing: List[str]
) -> Metrics:
    """Return the deviations from the reference while its time ran."""
    figures = _deviation_figures(None, "")
    figures.update(_deviation_figures(None, "_truth"))
    figures.update(average_deviation_after_6s_m=None, average_path_deviation_m=None, rmse_m=None)
    figures.update(following_figures(None, None))
    figures.update(_retimed_figures(record, window, missing))
    figures.update(scenario_time_s=None, reference_length_m=None)
    reference = record.reference
    if reference is None:
        missing.append(
            "no reference with a clock start: no deviation, arrival, navigation or scenario time"
        )
        return figures
    figures.update(scenario_time_s=reference.duration, reference_length_m=reference.length)
    if window.reference_end < window.start + reference.duration - _TOLERANCE:
        cut = window.start + reference.duration - window.reference_end
        missing.append(
            f"the flight ended {cut:.1f} s before its reference: deviations are over what was flown"
        )
    if record.position is None:
        missing.append("no position estimate: no deviation of the estimate")
    else:
        error = errors(record.position, reference, window.start, window.reference_end)
        figures.update(_deviation_figures(error, ""))
        figures.update(_estimate_figures(record.position, reference, error, window))
        figures.update(following_figures(error, reference))
        if not len(error):
            missing.append(
                "no position estimate while the reference ran: no deviation of the estimate"
            )
        _say_uncovered(record.position, "position estimates", window, missing)
    if record.true_position is None:
        missing.append("no ground truth: no deviation of the true position")
    else:
        error = errors(record.true_position, reference, window.start, window.reference_end)
        figures.update(_deviation_figures(error, "_truth"))
        _say_uncovered(record.true_position, "true positions", window, missing)
    return figures


def _say_uncovered(position: Series, name: str, window: Window, missing: List[str]) -> None:
    lost = uncovered(position.times, window.start, window.reference_end)
    if lost > 0.0:
        whole = window.reference_end - window.start
        missing.append(
            f"{name} are missing for {lost:.1f} s of {whole:.1f} s while the reference ran: "
            "deviations tell nothing of that time"
        )


def _deviation_figures(error: Optional[Series], suffix: str) -> Metrics:
    deviation = np.zeros(0) if error is None else np.linalg.norm(error.values, axis=1)
    return {
        f"average_deviation{suffix}_m": deviation.mean() if len(deviation) else None,
        f"maximum_deviation{suffix}_m": deviation.max() if len(deviation) else None,
    }


def _estimate_figures(
    position: Series, reference: Reference, error: Series, window: Window
) -> Metrics:
    if not len(error):
        return {}
    late = error.between(window.start + TRANSIENT, window.reference_end)
    flown = position.between(window.start, window.reference_end)
    square = np.mean(error.values**2, axis=0)
    return {
        "average_deviation_after_6s_m": _deviation_figures(late, "")["average_deviation_m"],
        "average_path_deviation_m": path_deviation(flown.values, reference.path.values).mean(),
        "rmse_m": dict(zip(("x", "y", "z", "total"), np.sqrt([*square, square.sum()]))),
    }


def _retimed_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return the deviation to what the controller compared with, slowed or re-timed as it was."""
    tracked, position = record.tracked_reference, record.position
    if tracked is None or position is None or window is None or not len(position):
        missing.append(
            "what the controller compared with is not known: no deviation from a re-timed reference"
        )
        return _deviation_figures(None, "_retimed")
    if record.reference is None:  # what is published then is where to hold, not what to follow
        return _deviation_figures(None, "_retimed")
    start, end = max(window.start, position.times[0]), min(window.reference_end, position.times[-1])
    tracked = tracked.between(start, end)
    error = Series(tracked.times, position.at(tracked.times) - tracked.values)
    return _deviation_figures(error, "_retimed")


def arrival_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return whether and when the aircraft came to the end, and how long the flight took."""
    figures: Metrics = dict.fromkeys(_ARRIVAL_FIGURES)
    if record.automatic is None:
        missing.append("nothing says when the automatic flight began and ended: no total time")
    else:
        figures["total_time_s"] = record.automatic[1] - record.automatic[0]
    if record.reference is None or record.position is None or not len(record.position):
        return figures
    if record.velocity is None:
        missing.append("no velocity estimate: no arrival and no navigation time")
        return figures
    arrival = arrival_time(record.position, record.velocity, record.reference, window.end)
    goal = record.reference.path.values[-1]
    is_seen = distance_to_sample(record.position.times, window.end) <= LONGEST_GAP
    figures["arrived"] = True if arrival is not None else False if is_seen else None
    figures["navigation_time_s"] = None if arrival is None else arrival - window.start
    if is_seen:
        last = record.position.at(np.array([window.end]))[0]
        figures["end_distance_m"] = np.linalg.norm(last - goal)
    else:
        missing.append(
            f"no position estimate within {LONGEST_GAP} s of the end: no end distance"
            + ("" if arrival is not None else ", and whether the aircraft arrived is not known")
        )
    if arrival is None and is_seen:
        missing.append("the aircraft did not arrive: no navigation time")
    return figures
