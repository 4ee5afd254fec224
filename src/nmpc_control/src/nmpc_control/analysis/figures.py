# SPDX-License-Identifier: MIT
"""Figures like the paper's as PDF: path, inputs, states, errors, deviation, solve times."""

from pathlib import Path
from typing import Callable, Dict, Iterable, List, Optional, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmpc_control.analysis.deviation import errors, path_deviation
from nmpc_control.analysis.palette import (
    AXES,
    COMMAND,
    FLOWN,
    MANUAL,
    OBSTACLE,
    REFERENCE,
    SHELL,
    TRUTH,
    thinned,
)
from nmpc_control.analysis.record import SOLVE_TIME, FlightRecord, ObstacleTrack, Series
from nmpc_control.analysis.surfaces import surface
from nmpc_control.analysis.timeline import periods, shown_window
from nmpc_control.analysis.windows import Window
from nmpc_control.state import PITCH_REF, ROLL_REF, THRUST, YAW_RATE_REF

SAFETY_DISTANCE = 0.5  # [m] from the hull: the shell that is drawn around an obstacle
_STYLE = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.fontsize": 8}

Draw = Callable[[FlightRecord, Window, float], Optional[Figure]]


def write_figures(
    record: FlightRecord, directory: Path, stem: str, vehicle_radius: float
) -> List[Path]:
    """Write ``<stem>_<figure>.pdf`` for all figures that can be drawn; return the files."""
    window = shown_window(record)
    written: List[Path] = []
    if window is None:
        return written
    with matplotlib.rc_context(_STYLE):
        for name, draw in _FIGURES.items():
            figure = draw(record, window, vehicle_radius)
            if figure is None:
                continue
            path = directory / f"{stem}_{name}.pdf"
            figure.savefig(path)
            written.append(path)
    return written


def path_figure(record: FlightRecord, window: Window, vehicle_radius: float) -> Optional[Figure]:
    """Return reference, flown path and obstacles in space."""
    if record.position is None:
        return None
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    curves = [record.position.between(window.start, window.end).values]
    if record.reference is not None:
        reference = record.reference.path.values
        axes.plot(*_thin(reference).T, "--", color=REFERENCE, label="reference")
        curves.append(reference)
    axes.plot(*_thin(curves[0]).T, color=FLOWN, label="flown (estimate)")
    if record.true_position is not None:
        true = record.true_position.between(window.start, window.end).values
        axes.plot(*_thin(true).T, color=TRUTH, linewidth=0.8, label="flown (truth)")
    for track in record.obstacles or ():
        _draw_obstacle(axes, track, window.start, vehicle_radius)
    if record.obstacles:
        axes.plot([], [], "o", color=OBSTACLE, label="obstacle")
        shell = SAFETY_DISTANCE + vehicle_radius
        axes.plot([], [], "o", color=SHELL, alpha=0.4, label=f"within {shell:g} m")
    points = np.concatenate([curve for curve in curves if len(curve)] or [np.zeros((1, 3))])
    _equal_axes(axes, points, record.obstacles or ())
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    _legend(axes)
    return figure


def inputs_figure(record: FlightRecord, window: Window, vehicle_radius: float) -> Optional[Figure]:
    """Return the four commands over time, with the attitude that followed."""
    if record.commands is None:
        return None
    commands = _since(record.commands, window)
    attitude = None if record.attitude is None else _since(record.attitude, window)
    panels = (
        ("thrust [%]", THRUST, None),
        ("roll [rad]", ROLL_REF, 0),
        ("pitch [rad]", PITCH_REF, 1),
        ("yaw rate [rad/s]", YAW_RATE_REF, None),
    )
    figure = Figure(figsize=(6.0, 6.5), layout="constrained")
    rows = figure.subplots(len(panels), sharex=True)
    for row, (label, column, angle) in zip(rows, panels):
        sent = commands.values[:, column]
        row.step(commands.times, sent, where="post", color=COMMAND, label="command")
        if angle is not None and attitude is not None:
            row.plot(attitude.times, attitude.values[:, angle], color=FLOWN, label="measured")
        row.set_ylabel(label)
    rows[-1].set_xlabel("time [s]")
    _shade(rows, record, window)
    _legend(rows[ROLL_REF])
    return figure


def errors_figure(record: FlightRecord, window: Window, vehicle_radius: float) -> Optional[Figure]:
    """Return the error of each axis while the reference ran."""
    lines = _errors(record, window)
    if not lines:
        return None
    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    rows = figure.subplots(3, sharex=True)
    for axis, row in enumerate(rows):
        for name, error in lines.items():
            row.plot(error.times, error.values[:, axis], color=_COLOURS[name], label=name)
        row.set_ylabel(f"{'xyz'[axis]} error [m]")
    rows[-1].set_xlabel("time [s]")
    _shade(rows, record, window)
    _legend(rows[0])
    return figure


def deviation_figure(
    record: FlightRecord, window: Window, vehicle_radius: float
) -> Optional[Figure]:
    """Return the deviation from the reference and from its path over time."""
    lines = _errors(record, window)
    if not lines:
        return None
    figure = Figure(figsize=(6.0, 3.0), layout="constrained")
    axes = figure.add_subplot()
    for name, error in lines.items():
        distance = np.linalg.norm(error.values, axis=1)
        axes.plot(error.times, distance, color=_COLOURS[name], label=f"from the reference, {name}")
    if record.position is not None:
        flown = record.position.between(
            max(record.reference.start, window.start), window.reference_end
        )
        nearest = path_deviation(flown.values, record.reference.path.values)
        axes.plot(flown.times - window.start, nearest, color=REFERENCE, label="from its path")
    axes.set(xlabel="time [s]", ylabel="deviation [m]")
    axes.set_ylim(bottom=0.0)
    _shade([axes], record, window)
    _legend(axes)
    return figure


def states_figure(record: FlightRecord, window: Window, vehicle_radius: float) -> Optional[Figure]:
    """Return position with its reference, and velocity."""
    if record.position is None or record.velocity is None:
        return None
    position, velocity = _since(record.position, window), _since(record.velocity, window)
    figure = Figure(figsize=(6.0, 6.5), layout="constrained")
    rows = figure.subplots(4, sharex=True)
    for axis, row in enumerate(rows[:3]):
        if record.reference is not None:
            path = record.reference.path
            start = record.reference.start - window.start
            row.plot(path.times + start, path.values[:, axis], "--", color=REFERENCE)
        row.plot(position.times, position.values[:, axis], color=FLOWN)
        row.set_ylabel(f"{'xyz'[axis]} [m]")
    for axis, name in enumerate("xyz"):
        rows[3].plot(velocity.times, velocity.values[:, axis], color=AXES[axis], label=f"v{name}")
    rows[3].set(xlabel="time [s]", ylabel="velocity [m/s]")
    _shade(rows, record, window)
    rows[0].plot([], [], "--", color=REFERENCE, label="reference")
    rows[0].plot([], [], color=FLOWN, label="estimate")
    _legend(rows[0])
    rows[3].legend(loc="upper right", ncol=3, frameon=False)
    return figure


def solver_figure(record: FlightRecord, window: Window, vehicle_radius: float) -> Optional[Figure]:
    """Return the histogram of solve times."""
    if record.solver is None:
        return None
    times = 1e3 * record.solver.between(window.start, window.end).values[:, SOLVE_TIME]
    if not len(times):
        return None
    figure = Figure(figsize=(6.0, 2.6), layout="constrained")
    axes = figure.add_subplot()
    low = max(times.min(), 1e-3)
    edges = np.geomspace(low, max(times.max(), 2.0 * low), 41)
    axes.hist(np.maximum(times, low), edges, color=FLOWN, edgecolor="white", linewidth=0.3)
    for share, style in ((50, "--"), (99, ":")):
        value = np.percentile(times, share)
        axes.axvline(value, color=COMMAND, linestyle=style, label=f"p{share} {value:.2f} ms")
    axes.set(xscale="log", xlabel="solve time [ms]", ylabel="solves")
    _legend(axes)
    return figure


_FIGURES: Dict[str, Draw] = {
    "path": path_figure,
    "inputs": inputs_figure,
    "states": states_figure,
    "solver": solver_figure,
    "errors": errors_figure,
    "deviation": deviation_figure,
}
_COLOURS = {"estimate": FLOWN, "truth": TRUTH}


def _errors(record: FlightRecord, window: Window) -> Dict[str, Series]:
    """Return the errors (n, 3) [m] over the time since the window's start, by what was measured."""
    if record.reference is None:
        return {}
    start = max(record.reference.start, window.start)
    positions = {"estimate": record.position, "truth": record.true_position}
    found = {
        name: errors(position, record.reference, start, window.reference_end)
        for name, position in positions.items()
        if position is not None
    }
    return {n: Series(e.times - window.start, e.values) for n, e in found.items() if len(e)}


def _since(series: Series, window: Window) -> Series:
    inside = series.between(window.start, window.end)
    return Series(inside.times - window.start, inside.values)


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=4, frameon=False)


def _thin(curve: np.ndarray) -> np.ndarray:
    return thinned(Series(np.arange(len(curve)), curve)).values


def _shade(rows: Iterable[Axes], record: FlightRecord, window: Window) -> None:
    """Mark the parts that were flown by hand, as in the paper."""
    for period in periods(record):
        start, end = max(period.start, window.start), min(period.end, window.end)
        if period.automatic is False and start < end:
            for row in rows:
                row.axvspan(
                    start - window.start, end - window.start, color=MANUAL, alpha=0.15, lw=0
                )


def _equal_axes(axes: Axes, points: np.ndarray, tracks: Sequence[ObstacleTrack]) -> None:
    """Show one metre at the same length on all axes, with everything in view."""
    for track in tracks:
        hull = surface(track.obstacle, track.obstacle.position, 0.0).reshape(3, -1).T
        points = np.concatenate([points, hull])
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.maximum(high - low, 0.3 * (high - low).max() + 0.1) / 2.0
    low, high = (low + high) / 2.0 - half, (low + high) / 2.0 + half
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(half, zoom=0.88)  # leaves room for the labels
    axes.locator_params(nbins=5)


def _draw_obstacle(axes: Axes, track: ObstacleTrack, t: float, vehicle_radius: float) -> None:
    centre = track.centre_at(np.array([t]))[0]
    shell = SAFETY_DISTANCE + vehicle_radius
    grid = {"rcount": 25, "ccount": 25, "linewidth": 0.0}
    axes.plot_surface(*surface(track.obstacle, centre, 0.0), color=OBSTACLE, alpha=0.9, **grid)
    axes.plot_surface(*surface(track.obstacle, centre, shell), color=SHELL, alpha=0.15, **grid)
