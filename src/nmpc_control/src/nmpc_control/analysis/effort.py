# SPDX-License-Identifier: MIT
"""What a flight cost: solver and command stream."""

import math
from typing import List, Optional

import numpy as np

from nmpc_control.analysis.gaps import stream_gaps
from nmpc_control.analysis.record import (
    DEADLINE_MISSES,
    FOUND,
    ITERATIONS,
    PLANS_REJECTED,
    SOLVE_TIME,
    FlightRecord,
    Metrics,
    Series,
)
from nmpc_control.analysis.windows import Window, mode_runs
from nmpc_control.mode_inputs import STREAMING
from nmpc_control.state import THRUST

_SOLVER_FIGURES = (
    "solver_iterations_mean",
    "solver_iterations",
    "solve_time_ms",
    "plans_found_ratio",
    "plans_rejected",
    "deadline_misses",
)
_COMMAND_FIGURES = (
    "thrust_percent",
    "command_rate_hz",
    "command_gap_ms_max",
    "command_gap_ms_p99",
)


def solver_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return iterations and solve times of the plans in the window."""
    figures: Metrics = dict.fromkeys(_SOLVER_FIGURES)
    status = within(record.status, window)
    if len(status):
        figures["plans_rejected"] = _counted(status[:, PLANS_REJECTED])
        figures["deadline_misses"] = _counted(status[:, DEADLINE_MISSES])
        if (np.diff(status[:, [PLANS_REJECTED, DEADLINE_MISSES]], axis=0) < 0.0).any():
            missing.append("the guard restarted: its counters are summed from 0 again")
    else:
        missing.append("no status of the guard: no count of rejected plans and deadline misses")
    plans = within(record.solver, window)
    if not len(plans):
        missing.append("no solver results in the evaluated time: no iterations and no solve times")
        return figures
    milliseconds = 1e3 * plans[:, SOLVE_TIME]
    figures["solver_iterations_mean"] = plans[:, ITERATIONS].mean()
    iterations = plans[:, ITERATIONS]
    figures["solver_iterations"] = {
        "p50": np.percentile(iterations, 50),
        "p99": np.percentile(iterations, 99),
        "max": iterations.max(),
    }
    figures["plans_found_ratio"] = plans[:, FOUND].mean()
    figures["solve_time_ms"] = {
        "mean": milliseconds.mean(),
        "p50": np.percentile(milliseconds, 50),
        "p99": np.percentile(milliseconds, 99),
        "max": milliseconds.max(),
    }
    return figures


def _counted(counter: np.ndarray) -> int:
    """Return by how much a counter (n,) rose; where it falls it started from 0 again."""
    steps = np.diff(counter)
    return int(np.where(steps < 0.0, counter[1:], steps).sum())


def command_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return thrust range in the window, rate and gaps of the command stream."""
    figures: Metrics = dict.fromkeys(_COMMAND_FIGURES)
    if record.commands is None or window is None:
        missing.append("no commands: no thrust range, command rate or gaps")
        return figures
    thrust = within(record.commands, window)[:, THRUST]
    thrust = thrust[np.isfinite(thrust)]
    if len(thrust):
        figures["thrust_percent"] = [thrust.min(), thrust.max()]
    else:
        missing.append("no command with thrust in the evaluated time: no thrust range")
    gaps = command_gaps(record, window)
    if len(gaps):
        figures["command_rate_hz"] = len(gaps) / max(gaps.sum(), 1e-9)
        figures["command_gap_ms_max"] = 1e3 * gaps.max()
        figures["command_gap_ms_p99"] = 1e3 * np.percentile(gaps, 99)
    else:
        missing.append("no two commands while automatic flight was on: no command rate or gaps")
    return figures


def command_gaps(record: FlightRecord, window: Window) -> np.ndarray:
    """Return the times [s] without a command while the guard streams: none of under two commands.

    Without the guard's status, all commands in the window count.
    """
    periods = [(window.start, window.end)]
    if record.status is not None:
        first, last = record.automatic or (-math.inf, math.inf)
        streaming = mode_runs(record.status, STREAMING)
        clipped = [(max(start, first), min(end, last)) for start, end in streaming]
        periods = [(start, end) for start, end in clipped if start < end]
    times = record.commands.times
    if sum(np.sum((times >= start) & (times <= end)) for start, end in periods) < 2:
        return np.zeros(0)
    return np.concatenate([stream_gaps(times, start, end) for start, end in periods])


def within(series: Optional[Series], window: Optional[Window]) -> np.ndarray:
    """Return the values in the window; none where there is no series or no window."""
    if series is None or window is None:
        return np.zeros((0, 1))
    return series.between(window.start, window.end).values
