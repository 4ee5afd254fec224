# SPDX-License-Identifier: MIT
"""The figures of one flight: one dictionary, ready for JSON, from a record of plain arrays.

Distances mean what they mean everywhere in this workspace: deviation is to the scenario's own
reference at the same time, its clock started at the first motion; clearance is from the hull to an
obstacle's surface. A figure that cannot be computed is None, and ``missing`` says why.
"""

import math
from typing import Any

import numpy as np

from nmpc_control.analysis.clearance import clearance_figures
from nmpc_control.analysis.effort import command_figures, motion_figures, solver_figures
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.tracking import arrival_figures, reference_figures
from nmpc_control.analysis.windows import scenario_window

SCHEMA_VERSION = 1
VEHICLE_RADIUS = 0.5  # [m] hull of the M100: 650 mm diagonal and 13 inch propellers


def flight_metrics(record: FlightRecord, vehicle_radius: float = VEHICLE_RADIUS) -> Metrics:
    """Return the figures of a flight: keys end in their unit, values are JSON types, never NaN.

    Args:
        record: The flight; every part may be missing.
        vehicle_radius: Hull, centre to outermost propeller tip [m]; 0 for the paper's meaning.
    """
    missing = list(record.missing)
    window = scenario_window(record)
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
    metrics.update(clearance_figures(record, window, vehicle_radius, missing))
    metrics.update(motion_figures(record, window, missing))
    metrics["missing"] = missing
    return _plain(metrics)


def _plain(value: Any) -> Any:
    """Return the value as JSON types, None for what is not finite."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
