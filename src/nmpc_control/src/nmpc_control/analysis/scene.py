# SPDX-License-Identifier: MIT
"""The flight in space, to be turned in a browser: reference, flown path, obstacles."""

from html import escape
from typing import Any, Dict, List, Optional

import numpy as np
import plotly.graph_objects as go

from nmpc_control.analysis.palette import FLOWN, MANUAL, OBSTACLE, REFERENCE, SHELL, TRUTH, thinned
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Series
from nmpc_control.analysis.surfaces import surface
from nmpc_control.analysis.timeline import periods
from nmpc_control.analysis.windows import Window

SAFETY_DISTANCE = 0.5  # [m] from the hull: the shell that is drawn around an obstacle
_MOST_OBSTACLES = 40  # drawn with their names
_EYE = {"x": 0.75, "y": -1.15, "z": 0.65}  # of the camera, in lengths of the longest axis
_FINE = (49, 25)  # points around and up a surface
_MOST_PATH = 3000  # points of a path


def scene_figure(
    record: FlightRecord, window: Window, vehicle_radius: float
) -> Optional[go.Figure]:
    """Return the scene; None without positions."""
    if record.position is None:
        return None
    figure = go.Figure()
    flown = record.position.between(window.start, window.end)
    if record.reference is not None:
        _line(figure, record.reference.path, "reference", REFERENCE, 4, "dash")
    _line(figure, flown, "flown (estimate)", FLOWN, 5)
    for number, part in enumerate(_manual(record, flown)):
        _line(figure, part, "flown by hand", MANUAL, 5, is_first=number == 0)
    if record.true_position is not None:
        truth = record.true_position.between(window.start, window.end)
        _line(figure, truth, "flown (truth)", TRUTH, 2)
    for number, track in enumerate((record.obstacles or ())[:_MOST_OBSTACLES]):
        _obstacle(figure, track, flown, vehicle_radius, is_first=number == 0)
    if len(flown):
        _mark(figure, flown.values[0], "start", "circle")
        _mark(figure, flown.values[-1], "end", "square")
    figure.update_layout(
        scene=_space(record, flown, vehicle_radius),
        height=620,
        margin={"l": 0, "r": 0, "t": 10, "b": 0},
        legend={"x": 0.01, "y": 0.99, "bgcolor": "rgba(255,255,255,0.8)"},
    )
    return figure


def _space(record: FlightRecord, flown: Series, vehicle_radius: float) -> Dict[str, Any]:
    """Return axes on which a metre is a metre, with everything in view and never flat."""
    points = [flown.values]
    if record.reference is not None:
        points.append(record.reference.path.values)
    for track in (record.obstacles or ())[:_MOST_OBSTACLES]:
        centres = track.centre_at(flown.times[:: max(1, len(flown) // 100)])
        reach = track.obstacle.size.max() + SAFETY_DISTANCE + vehicle_radius
        points += [centres - reach, centres + reach]
    corners = [corner for part in points if len(part) for corner in (part.min(0), part.max(0))]
    low, high = np.min(corners or [np.zeros(3)], axis=0), np.max(corners or [np.ones(3)], axis=0)
    size = np.maximum(high - low, 0.3 * (high - low).max() + 0.1) * 1.05
    middle, ratio = (low + high) / 2.0, size / size.max()
    style = {"backgroundcolor": "#f8f9fa", "gridcolor": "#dee2e6", "zerolinecolor": "#adb5bd"}
    axes = {
        f"{name}axis": {
            "title": f"{name} [m]",
            "range": [float(m - s / 2.0), float(m + s / 2.0)],
            **style,
        }
        for name, m, s in zip("xyz", middle, size)
    }
    return {
        **axes,
        "aspectmode": "manual",
        "aspectratio": dict(zip("xyz", ratio.tolist())),
        "camera": {"eye": _EYE, "center": {"x": 0.0, "y": 0.0, "z": -0.1}},
    }


def _manual(record: FlightRecord, flown: Series) -> List[Series]:
    by_hand = [p for p in periods(record) if p.automatic is False]
    parts = [flown.between(period.start, period.end) for period in by_hand]
    return [part for part in parts if len(part) > 1]


def _line(
    figure: go.Figure,
    path: Series,
    name: str,
    colour: str,
    width: float,
    dash: str = "solid",
    is_first: bool = True,
) -> None:
    if not len(path):
        return
    thin = thinned(path, _MOST_PATH)
    x, y, z = thin.values.T.astype(np.float32)
    figure.add_trace(
        go.Scatter3d(
            x=x,
            y=y,
            z=z,
            mode="lines",
            name=name,
            legendgroup=name,
            showlegend=is_first,
            line={"color": colour, "width": width, "dash": dash},
            customdata=np.round(thin.times, 2),
            hovertemplate=f"{name}<br>%{{customdata}} s<br>%{{x:.2f}}, %{{y:.2f}}, %{{z:.2f}} m"
            "<extra></extra>",
        )
    )


def _mark(figure: go.Figure, point: np.ndarray, name: str, symbol: str) -> None:
    x, y, z = point
    marker = {"size": 5, "color": FLOWN, "symbol": symbol, "line": {"color": "white", "width": 1}}
    figure.add_trace(go.Scatter3d(x=[x], y=[y], z=[z], mode="markers", name=name, marker=marker))


def _obstacle(
    figure: go.Figure, track: ObstacleTrack, flown: Series, vehicle_radius: float, is_first: bool
) -> None:
    """Draw an obstacle where it was when the aircraft came nearest, with its safety shell."""
    name = escape(track.obstacle.id or "unnamed", quote=False)
    there = flown.between(track.begin, track.end)
    times = there.times if len(there) else flown.times[:1]
    if not len(times):
        return
    centres = track.centre_at(times)
    nearest = np.linalg.norm(flown.at(times) - centres, axis=1).argmin()
    centre = centres[nearest]
    _surface(figure, track, centre, 0.0, f"obstacle {name}", OBSTACLE, 1.0, True)
    shell = SAFETY_DISTANCE + vehicle_radius
    label = f"hull + safety distance ({shell:g} m)"
    _surface(figure, track, centre, shell, label, SHELL, 0.18, is_first)
    if np.ptp(centres, axis=0).max() > 0.01:
        _line(figure, Series(times, centres), f"way of {name}", OBSTACLE, 2, "dot")


def _surface(
    figure: go.Figure,
    track: ObstacleTrack,
    centre: np.ndarray,
    margin: float,
    name: str,
    colour: str,
    opacity: float,
    has_legend: bool,
) -> None:
    x, y, z = surface(track.obstacle, centre, margin, _FINE).astype(np.float32)
    figure.add_trace(
        go.Surface(
            x=x,
            y=y,
            z=z,
            name=name,
            legendgroup=name,
            showlegend=has_legend,
            showscale=False,
            opacity=opacity,
            surfacecolor=np.zeros_like(x),
            colorscale=[[0.0, colour], [1.0, colour]],
            lighting={"ambient": 0.75, "diffuse": 0.45, "specular": 0.05},
            hovertemplate=f"{name}<extra></extra>",
        )
    )
