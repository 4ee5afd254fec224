# SPDX-License-Identifier: MIT
"""The figures of one flight: one dictionary, ready for JSON, from a record of plain arrays.

Distances mean what they mean everywhere in this workspace: deviation is to the scenario's own
reference at the same time, its clock started at the first motion; clearance is from the hull to an
obstacle's surface. A figure that cannot be computed is None, and ``missing`` says why.
"""

import math
from dataclasses import replace
from typing import Any, Optional, Tuple

import numpy as np

from nmpc_control.analysis.clearance import clearance_figures
from nmpc_control.analysis.effort import command_figures, solver_figures
from nmpc_control.analysis.inputs import InputLimits, default_limits, input_figures
from nmpc_control.analysis.motion import motion_figures
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.segments import parts, segment_figures
from nmpc_control.analysis.streams import battery_figures, stream_figures
from nmpc_control.analysis.timeline import timeline_figures
from nmpc_control.analysis.tracking import arrival_figures, reference_figures
from nmpc_control.analysis.units import units
from nmpc_control.analysis.windows import mode_runs, scenario_window
from nmpc_control.mode_inputs import AUTOMATIC

SCHEMA_VERSION = 3
VEHICLE_RADIUS = 0.5  # [m] hull of the M100: 650 mm diagonal and 13 inch propellers


def flight_metrics(
    record: FlightRecord,
    vehicle_radius: float = VEHICLE_RADIUS,
    limits: Optional[InputLimits] = None,
    segments: Optional[str] = None,
    between: Optional[Tuple[float, float]] = None,
) -> Metrics:
    """Return the figures of a flight: keys end in their unit, values are JSON types, never NaN.

    Args:
        record: The flight; every part may be missing.
        vehicle_radius: Hull, centre to outermost propeller tip [m]; 0 for the paper's meaning.
        limits: Bounds of the inputs; None: the controller's for its own flights, else the paper's.
        segments: Also figures of parts: "mode", "goal" or seconds.
        between: First and last moment [s] since the bag's start to evaluate; None: the scenario's
            phase, or what the record says.

    Raises:
        ValueError: ``segments`` is none of these.
        ConfigError: the controller's limits cannot be read.
    """
    if between is not None:
        record = replace(record, between=between)
    missing = list(record.missing)
    window = scenario_window(record)
    limits = default_limits(record) if limits is None else limits
    metrics: Metrics = {
        "schema_version": SCHEMA_VERSION,
        "bag": record.bag,
        "flight": record.flight[0],
        "flights": record.flight[1],
        "scenario": record.scenario,
        "source": record.source,
        "vehicle_radius_m": vehicle_radius,
        "window_s": None if window is None else [window.start, window.end],
    }
    metrics.update(reference_figures(record, window, missing))
    metrics.update(arrival_figures(record, window, missing))
    metrics.update(solver_figures(record, window, missing))
    metrics.update(command_figures(record, window, missing))
    metrics.update(input_figures(record, window, limits, missing))
    metrics.update(clearance_figures(record, window, vehicle_radius, missing))
    metrics.update(motion_figures(record, window, missing))
    metrics.update(stream_figures(record, window, missing))
    metrics.update(battery_figures(record, window, missing))
    metrics.update(timeline_figures(record, missing))
    is_guarded = bool(mode_runs(record.status, AUTOMATIC))
    if not is_guarded and metrics["automatic_time_s"] is not None:  # what the switch told
        metrics["total_time_s"] = metrics["automatic_time_s"]
    if segments is not None:
        found = parts(record, segments)
        metrics["segments"] = segment_figures(record, found, vehicle_radius, limits)
        if not found:
            missing.append(f"no parts by {segments}: the bag does not tell them")
    metrics["missing"] = list(dict.fromkeys(missing))
    metrics["units"] = units(metrics)
    return plain(metrics)


def plain(value: Any) -> Any:
    """Return the value as JSON types, None for what is not finite."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
