# SPDX-License-Identifier: MIT
"""What the identified model makes of the flight: measured, modelled, and what is left."""

from pathlib import Path
from typing import Callable, Dict, List, Optional, Sequence, Tuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nmpc_control.analysis.identification.attitude import AXES
from nmpc_control.analysis.identification.battery import curve
from nmpc_control.analysis.identification.identify import Identification
from nmpc_control.analysis.identification.output_error import Fit
from nmpc_control.analysis.identification.passages import Passage
from nmpc_control.analysis.identification.segments import FLIGHT, KINDS, LIMITED
from nmpc_control.analysis.identification.thrust_fit import Late
from nmpc_control.analysis.identification.translation import Motion
from nmpc_control.state import GRAVITY

MEASURED, MODEL, RESIDUAL, COMMAND = "tab:blue", "tab:orange", "tab:green", "tab:red"
_TIME = "time [s], bags one after another"
_STYLE = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.fontsize": 8}
_LABELLED = 0.06  # [1] of the time axis: a shorter segment has no room for its name
_MOST_POINTS = 5000  # drawn of one curve

Curve = Tuple[np.ndarray, np.ndarray]


def write_figures(found: Identification, directory: Path, stem: str) -> List[Path]:
    """Write ``<stem>_<figure>.png`` and ``.pdf`` where there is something to draw."""
    written = []
    with matplotlib.rc_context(_STYLE):
        for name, draw in _FIGURES.items():
            figure = draw(found)
            if figure is None:
                continue
            path = directory / f"{stem}_{name}.png"
            figure.savefig(path, dpi=130)
            figure.savefig(path.with_suffix(".pdf"))
            written.append(path)
    return written


def segments_figure(found: Identification) -> Optional[Figure]:
    """Return which part of each bag was what."""
    longest = max(part.end for part in found.segments)
    height = 1.5 + 0.5 * len(found.bags)
    figure = Figure(figsize=(9.0, height), layout="constrained")
    axes = figure.add_subplot()
    for kind in KINDS:
        parts = [part for part in found.segments if part.kind == kind]
        for row, bag in enumerate(found.bags):
            spans = [(p.start, p.end - p.start) for p in parts if p.bag == bag]
            axes.broken_barh(spans, (row - 0.4, 0.8), color=_COLOURS.get(kind, "lightgrey"))
        for part in parts:
            if part.end - part.start > _LABELLED * longest:
                middle = 0.5 * (part.start + part.end)
                row = found.bags.index(part.bag)
                axes.text(middle, row, kind, ha="center", va="center", fontsize=7)
    axes.set_yticks(range(len(found.bags)), [_plain(bag) for bag in found.bags])
    axes.set_xlabel("time [s]")
    return figure


def attitude_figure(found: Identification) -> Optional[Figure]:
    """Return roll and pitch: commanded, measured, modelled and the residual."""
    attitude = found.attitude
    if attitude.best is None:
        return None
    return _responses(attitude.best, attitude.passages, [f"{axis} [rad]" for axis in AXES])


def yaw_rate_figure(found: Identification) -> Optional[Figure]:
    """Return the yaw rate likewise."""
    if found.yaw_rate.best is None:
        return None
    return _responses(found.yaw_rate.best, found.yaw_rate.passages, ["yaw rate [rad/s]"])


def thrust_figure(found: Identification) -> Optional[Figure]:
    """Return the thrust of each window against its percentage, and the residual over time."""
    thrust = found.thrust
    if thrust.map is None or thrust.fit is None:
        return None
    measured = np.concatenate([_lift(m, thrust.map.vertical_drag) for m in thrust.motions])
    percent = np.concatenate([_percent(m, thrust.map.late) for m in thrust.motions])
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    chosen = thrust.fit.used
    left.plot(*_thin(percent[chosen], measured[chosen]), ".", ms=1.5, color=MEASURED)
    left.plot(*_thin(percent[~chosen], measured[~chosen]), ".", ms=1.5, color="lightgrey")
    ends = np.array([percent.min(), percent.max()])
    left.plot(ends, thrust.map.thrust(ends), color=MODEL, label="map")
    left.set(xlabel="thrust [%], after dead time and lag", ylabel="thrust [m/s$^2$]")
    left.set_ylim(*np.percentile(measured, [0.5, 99.5]) + np.array([-1.0, 1.0]))
    left.legend()
    _residual_over_time(right, thrust.motions, thrust.fit.residuals, thrust.fit.used)
    return figure


def drag_figure(found: Identification) -> Optional[Figure]:
    """Return the residual of horizontal motion over time, x and y."""
    drag = found.drag
    if drag.fit is None:
        return None
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    rows = figure.subplots(2, sharex=True)
    split = [drag.fit.residuals, drag.fit.used]
    parts = [_by_axis(values, drag.motions) for values in split]
    for axis, row in enumerate(rows):
        _residual_over_time(row, drag.motions, parts[0][axis], parts[1][axis])
        row.set_ylabel(f"{'xy'[axis]}: measured less model [m/s$^2$]")
    return figure


def battery_figure(found: Identification) -> Optional[Figure]:
    """Return hover thrust over the state of charge."""
    if not found.battery.levels:
        return None
    level, hover, deviation = curve(found.battery.levels)
    figure = Figure(figsize=(5.0, 3.5), layout="constrained")
    axes = figure.add_subplot()
    axes.errorbar(level, hover, yerr=deviation, fmt="o", ms=3, color=MEASURED)
    axes.set(xlabel="state of charge [%]", ylabel="hover thrust [%]")
    axes.invert_xaxis()
    return figure


_FIGURES: Dict[str, Callable[[Identification], Optional[Figure]]] = {
    "segments": segments_figure,
    "attitude": attitude_figure,
    "yaw_rate": yaw_rate_figure,
    "thrust": thrust_figure,
    "drag": drag_figure,
    "battery": battery_figure,
}
_COLOURS = {FLIGHT: "tab:green", LIMITED: "gold", "not_following": "tab:red", "impact": "tab:red"}


def _responses(found: Fit, passages: Sequence[Passage], labels: Sequence[str]) -> Figure:
    figure = Figure(figsize=(9.0, 2.0 + 3.0 * len(labels)), layout="constrained")
    ratios = {"height_ratios": [3, 1] * len(labels)}
    rows = figure.subplots(2 * len(labels), sharex=True, gridspec_kw=ratios)
    models = found.model.simulate(found.parameters, passages)
    shifts = _shifts([passage.times for passage in passages])
    for axis, label in enumerate(labels):
        above, below = rows[2 * axis], rows[2 * axis + 1]
        for passage, model, shift in zip(passages, models, shifts):
            times, y, m = passage.times + shift, passage.values[:, axis], model[:, axis]
            sent = passage.command_times + shift, passage.commands[:, axis]
            above.step(*_thin(*sent), where="post", color=COMMAND, lw=0.6, label="command")
            above.plot(*_thin(times, y), color=MEASURED, lw=1.0, label="measured")
            above.plot(*_thin(times, m), "--", color=MODEL, lw=1.0, label="model")
            below.plot(*_thin(times, y - m), color=RESIDUAL, lw=0.8)
        above.set_ylabel(label)
        below.set_ylabel("residual")
    handles, names = rows[0].get_legend_handles_labels()
    unique = dict(zip(names, handles))
    place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "frameon": False}
    rows[0].legend(unique.values(), unique.keys(), ncol=3, **place)
    rows[-1].set_xlabel(_TIME)
    return figure


def _shifts(times: Sequence[np.ndarray]) -> List[float]:
    """Return what [s] to add to each part's times so that bags follow one another."""
    shifts: List[float] = []
    shift = 0.0
    for number, part in enumerate(times):
        if number and part[0] < times[number - 1][0]:  # another bag, whose clock starts anew
            shift += times[number - 1][-1]
        shifts.append(shift)
    return shifts


def _residual_over_time(
    axes: Axes, motions: Sequence[Motion], residuals: np.ndarray, used: np.ndarray
) -> None:
    parts = [motion.times for motion in motions]
    times = np.concatenate([part + shift for part, shift in zip(parts, _shifts(parts))])
    axes.plot(*_thin(times[used], residuals[used]), ".", ms=1.5, color=RESIDUAL)
    axes.set(xlabel=_TIME, ylabel="measured less model [m/s$^2$]")


def _by_axis(values: np.ndarray, motions: Sequence[Motion]) -> List[np.ndarray]:
    """Return x and y parts of rows that hold, motion after motion, all of x and then all of y."""
    counts = [len(motion.times) for motion in motions]
    edges = np.cumsum([0, *(2 * count for count in counts)])
    pairs = [values[a:b].reshape(2, -1) for a, b in zip(edges[:-1], edges[1:])]
    return list(np.concatenate(pairs, axis=1))


def _lift(motion: Motion, vertical_drag: float) -> np.ndarray:
    climb = motion.mean(motion.speed[:, 2])
    lift = motion.acceleration[:, 2] + GRAVITY + vertical_drag * climb
    return lift / motion.mean(motion.up[:, 2])


def _percent(motion: Motion, late: Late) -> np.ndarray:
    up = motion.up[:, 2]
    return motion.mean(motion.percent(*late) * up) / motion.mean(up)


def _thin(x: np.ndarray, y: np.ndarray) -> Curve:
    step = max(1, len(x) // _MOST_POINTS)
    return x[::step], y[::step]


def _plain(name: str) -> str:
    """Return a bag's name without what matplotlib would take for mathematics."""
    return "".join(c for c in name if c.isprintable()).replace("$", "")
