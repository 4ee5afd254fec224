# SPDX-License-Identifier: MIT
"""Plots over time of one flight, for a browser; parts flown by hand are shaded as in the paper."""

from html import escape
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from nmpc_control.analysis.deviation import errors, path_deviation
from nmpc_control.analysis.palette import (
    AXES,
    COMMAND,
    FLOWN,
    MANUAL,
    MODES,
    OTHER_MODE,
    REFERENCE,
    TRUTH,
    thinned,
)
from nmpc_control.analysis.record import RUNG, SOLVE_TIME, FlightRecord, Series
from nmpc_control.analysis.timeline import Period, periods
from nmpc_control.analysis.windows import Window
from nmpc_control.ladder import Rung
from nmpc_control.state import PITCH_REF, ROLL_REF, THRUST, YAW_RATE_REF

_ROW_HEIGHT = 150  # [pixels]
_RUNG_STEP = 0.25  # [s]
_MOST_BARS = 2000


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
        name: (errors(position, record.reference, window.start, window.reference_end), colour)
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
        flown = record.position.between(window.start, window.reference_end)
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
                    y=thin.values.astype(np.float32),
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
    return _styled(figure, _ROW_HEIGHT * len(rows) + 90)


def _inside(curve: Curve, window: Window) -> Curve:
    return curve._replace(series=curve.series.between(window.start, window.end))


def _shade(figure: go.Figure, record: FlightRecord, window: Window) -> None:
    for period in periods(record):
        start, end = max(period.start, window.start), min(period.end, window.end)
        if period.automatic is False and start < end:
            figure.add_vrect(start, end, fillcolor=MANUAL, opacity=0.12, line_width=0)


def timeline_figure(record: FlightRecord) -> Optional[go.Figure]:
    """Return modes and authority as bars over the whole bag."""
    found = periods(record)[:_MOST_BARS]
    if not found:
        return None
    figure = go.Figure()
    named = set()
    lines: Sequence[Tuple[str, List[Tuple[str, Period]]]] = (
        ("mode", [(p.mode, p) for p in found]),
        ("who flies", [(_who(p.automatic), p) for p in found if p.automatic is not None]),
        ("authority", [("held", p) for p in found if p.authority]),
    )
    for line, bars in lines:
        for name in dict.fromkeys(name for name, _ in bars):
            chosen = [p for other, p in bars if other == name]
            figure.add_trace(
                go.Bar(
                    y=[line] * len(chosen),
                    base=[p.start for p in chosen],
                    x=[p.end - p.start for p in chosen],
                    orientation="h",
                    name=escape(name).replace("_", " "),
                    marker={"color": _BARS.get(name, OTHER_MODE), "line": {"width": 0}},
                    showlegend=name not in named,
                    hovertemplate=f"{escape(name)}<br>%{{base:.2f}} s, for %{{x:.2f}} s"
                    "<extra></extra>",
                )
            )
            named.add(name)
    figure.update_layout(barmode="overlay", bargap=0.35)
    figure.update_xaxes(title_text="time since the bag's start [s]")
    figure.update_yaxes(autorange="reversed")
    return _styled(figure, 260)


_BARS = {**MODES, "automatic": "#1c6dd0", "by hand": MANUAL, "held": "#5f3dc4"}


def _who(automatic: Optional[bool]) -> str:
    return "automatic" if automatic else "by hand"


def histogram_figure(record: FlightRecord, window: Window) -> Optional[go.Figure]:
    """Return how often a solve took how long, with median and p99."""
    if record.solver is None:
        return None
    times = 1e3 * record.solver.between(window.start, window.end).values[:, SOLVE_TIME]
    if not len(times):
        return None
    low, high = max(times.min(), 1e-3), max(times.max(), 2e-3)
    edges = np.geomspace(low, high * 1.001, 41)
    counts, _ = np.histogram(np.maximum(times, low), edges)
    figure = go.Figure(
        go.Bar(
            x=np.sqrt(edges[:-1] * edges[1:]),
            y=counts,
            width=np.diff(edges),
            marker={"color": FLOWN, "line": {"color": "white", "width": 0.5}},
            name="solves",
            hovertemplate="%{x:.2f} ms: %{y} solves<extra></extra>",
        )
    )
    for name, value, position in (
        ("median", np.percentile(times, 50), "bottom"),
        ("p99", np.percentile(times, 99), "top"),
    ):
        figure.add_vline(
            value,
            line={"color": COMMAND, "dash": "dash"},
        )
        figure.add_annotation(  # on a logarithmic axis its place is an exponent
            x=np.log10(value),
            y=1.0,
            yref="paper",
            text=f"{name} {value:.2f} ms",
            showarrow=False,
            xanchor="left",
            yanchor=position,
        )
    reach = [np.log10(edges[0]) - 0.05, np.log10(edges[-1]) + 0.05]
    figure.update_xaxes(type="log", range=reach, title_text="solve time [ms]")
    figure.update_yaxes(title_text="number of solves")
    return _styled(figure, 320)


def _styled(figure: go.Figure, height: int) -> go.Figure:
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"},
        hovermode="closest",
    )
    return figure
