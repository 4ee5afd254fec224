# SPDX-License-Identifier: MIT
"""Bars of one flight for a browser: who flew when, and how long solving took."""

from html import escape
from typing import List, Optional, Sequence, Tuple

import numpy as np
import plotly.graph_objects as go

from nmpc_control.analysis.palette import COMMAND, FLOWN, MANUAL, MODES, OTHER_MODE
from nmpc_control.analysis.record import SOLVE_TIME, FlightRecord
from nmpc_control.analysis.timeline import Period, periods
from nmpc_control.analysis.windows import Window

_MOST_BARS = 2000


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
    return styled(figure, 260)


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
    return styled(figure, 320)


def styled(figure: go.Figure, height: int) -> go.Figure:
    """Give a figure the report's look and a height [pixels]; return it."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"},
        hovermode="closest",
    )
    return figure
