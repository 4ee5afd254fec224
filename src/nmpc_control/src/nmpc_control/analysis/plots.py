# SPDX-License-Identifier: MIT
"""Plots over time of one flight, for a browser; parts flown by hand are shaded as in the paper."""

from typing import Dict, List, NamedTuple, Optional

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from nmpc_control.analysis.bars import styled
from nmpc_control.analysis.deviation import errors, path_deviation
from nmpc_control.analysis.palette import (
    AXES,
    COMMAND,
    FLOWN,
    MANUAL,
    REFERENCE,
    TRUTH,
    thinned,
)
from nmpc_control.analysis.record import RUNG, SOLVE_TIME, FlightRecord, Series
from nmpc_control.analysis.timeline import periods
from nmpc_control.analysis.windows import Window
from nmpc_control.ladder import Rung
from nmpc_control.state import PITCH_REF, ROLL_REF, THRUST, YAW_RATE_REF

_ROW_HEIGHT = 150  # [pixels]
_RUNG_STEP = 0.25  # [s]


class Curve(NamedTuple):
    """A line in one row of a plot."""

    name: str
    series: Series  # (n,)
    colour: str
    shape: str = "linear"  # hv: held
    dash: str = "solid"


Rows = Dict[str, List[Curve]]  # label of the axis to curves


def column(series: Series, index: int) -> Series:
    """Return one column as a series."""
    return Series(series.times, series.values[:, index])


def input_rows(record: FlightRecord) -> Rows:
    """Return commands, with the attitude that followed."""
    rows: Rows = {}
    if record.commands is None:
        return rows
    measured = {ROLL_REF: 0, PITCH_REF: 1}
    for label, index in (
        ("thrust [%]", THRUST),
        ("roll [rad]", ROLL_REF),
        ("pitch [rad]", PITCH_REF),
        ("yaw rate [rad/s]", YAW_RATE_REF),
    ):
        rows[label] = [Curve("command", column(record.commands, index), COMMAND, "hv")]
        if index in measured and record.attitude is not None:
            attitude = column(record.attitude, measured[index])
            rows[label].append(Curve("measured", attitude, FLOWN))
    return rows


def state_rows(record: FlightRecord, window: Window) -> Rows:
    """Return position with its reference, velocity and attitude."""
    rows: Rows = {}
    if record.position is not None:
        for axis, name in enumerate("xyz"):
            curves = [Curve("estimate", column(record.position, axis), FLOWN)]
            if record.true_position is not None:
                curves.append(Curve("truth", column(record.true_position, axis), TRUTH))
            if record.reference is not None:
                path = record.reference.path
                reference = Series(path.times + record.reference.start, path.values[:, axis])
                curves.append(Curve("reference", reference, REFERENCE, dash="dash"))
            rows[f"{name} [m]"] = curves
    if record.velocity is not None:
        rows["velocity [m/s]"] = [
            Curve(f"v{name}", column(record.velocity, axis), AXES[axis])
            for axis, name in enumerate("xyz")
        ]
    if record.attitude is not None:
        rows["attitude [rad]"] = [
            Curve(name, column(record.attitude, axis), AXES[axis])
            for axis, name in enumerate(("roll", "pitch", "yaw"))
        ]
    return rows


def error_rows(record: FlightRecord, window: Window) -> Rows:
    """Return error of each axis, and deviation from the reference and from its path."""
    if record.reference is None:
        return {}
    found = {
        name: (
            errors(
                position,
                record.reference,
                max(record.reference.start, window.start),
                window.reference_end,
            ),
            colour,
        )
        for name, position, colour in (
            ("estimate", record.position, FLOWN),
            ("truth", record.true_position, TRUTH),
        )
        if position is not None
    }
    found = {name: pair for name, pair in found.items() if len(pair[0])}
    if not found:
        return {}
    rows: Rows = {
        f"{axis} error [m]": [
            Curve(name, column(error, index), colour) for name, (error, colour) in found.items()
        ]
        for index, axis in enumerate("xyz")
    }
    rows["deviation [m]"] = [
        Curve(name, Series(error.times, np.linalg.norm(error.values, axis=1)), colour)
        for name, (error, colour) in found.items()
    ]
    if record.position is not None:
        flown = record.position.between(
            max(record.reference.start, window.start), window.reference_end
        )
        nearest = path_deviation(flown.values, record.reference.path.values)
        rows["deviation [m]"].append(
            Curve("from the path", Series(flown.times, nearest), REFERENCE, dash="dot")
        )
    return rows


def solver_rows(record: FlightRecord) -> Rows:
    """Return solve times, iterations, rungs and battery."""
    rows: Rows = {}
    if record.solver is not None:
        milliseconds = Series(record.solver.times, 1e3 * record.solver.values[:, SOLVE_TIME])
        rows["solve time [ms]"] = [Curve("solve time", milliseconds, COMMAND)]
        rows["iterations"] = [Curve("iterations", column(record.solver, 0), FLOWN, "hv")]
    if record.status is not None and record.status.values.shape[1] > RUNG:
        rows["rung"] = [Curve("lowest rung", _lowest_rung(record.status), MANUAL, "hv")]
    if record.battery is not None:
        rows["battery [%]"] = [Curve("battery", column(record.battery, 0), REFERENCE)]
    return rows


def _lowest_rung(status: Series) -> Series:
    """Return the lowest rung of every quarter of a second: new plans come between old ones."""
    part = np.floor((status.times - status.times[0]) / _RUNG_STEP).astype(int)
    first = np.flatnonzero(np.diff(part, prepend=-1))
    lowest = np.maximum.reduceat(status.values[:, RUNG], first)
    return Series(status.times[first], lowest)


def time_figure(rows: Rows, record: FlightRecord, window: Window) -> Optional[go.Figure]:
    """Return the rows above each other over the time since the bag's start [s]."""
    rows = {label: [_inside(curve, window) for curve in curves] for label, curves in rows.items()}
    rows = {label: [c for c in curves if len(c.series)] for label, curves in rows.items()}
    rows = {label: curves for label, curves in rows.items() if curves}
    if not rows:
        return None
    figure = make_subplots(len(rows), 1, shared_xaxes=True, vertical_spacing=0.035)
    named = set()
    for number, (label, curves) in enumerate(rows.items(), 1):
        for curve in curves:
            thin = thinned(curve.series)
            figure.add_trace(
                go.Scatter(
                    x=np.round(thin.times, 3),
                    y=np.round(thin.values, 6).astype(np.float32),
                    mode="lines",
                    name=curve.name,
                    legendgroup=curve.name,
                    showlegend=curve.name not in named,
                    line={
                        "color": curve.colour,
                        "width": 1.4,
                        "shape": curve.shape,
                        "dash": curve.dash,
                    },
                ),
                number,
                1,
            )
            named.add(curve.name)
        figure.update_yaxes(title_text=label, row=number, col=1)
    if "rung" in rows:
        number = list(rows).index("rung") + 1
        names = [rung.name.lower().replace("_", " ") for rung in Rung]
        figure.update_yaxes(tickvals=[int(r) for r in Rung], ticktext=names, row=number, col=1)
    _shade(figure, record, window)
    figure.update_xaxes(title_text="time since the bag's start [s]", row=len(rows), col=1)
    return styled(figure, _ROW_HEIGHT * len(rows) + 90)


def _inside(curve: Curve, window: Window) -> Curve:
    return curve._replace(series=curve.series.between(window.start, window.end))


def _shade(figure: go.Figure, record: FlightRecord, window: Window) -> None:
    for period in periods(record):
        start, end = max(period.start, window.start), min(period.end, window.end)
        if period.automatic is False and start < end:
            figure.add_vrect(start, end, fillcolor=MANUAL, opacity=0.12, line_width=0)
