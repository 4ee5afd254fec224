# SPDX-License-Identifier: MIT
"""The bench's figures as PNG files."""

from pathlib import Path
from typing import Any, Callable, Dict, List

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 - the backend must be chosen before
import numpy as np  # noqa: E402

from uav_sim.closed_loop.bench.scenes import circuit  # noqa: E402

_COLOURS = {
    "budgeted": "tab:green",
    "converged": "tab:olive",
    "ipopt": "tab:blue",
    "paper": "tab:red",
}

_SHOWN_HORIZONS = (1.0, 2.0, 6.0, 12.0)  # [s]


def draw(results: Dict[str, Any], folder: Path) -> List[Path]:
    """Write a figure for every section that was measured; return the files."""
    makers: Dict[str, Callable[[Any], plt.Figure]] = {
        "samples_ms": _backends,
        "scaling_n": lambda _: _scaling(results),
        "horizon": lambda _: _horizon(results),
        "presets": _presets,
    }
    names = {"samples_ms": "backends", "scaling_n": "scaling"}
    files = []
    for key, maker in makers.items():
        if key in results:
            figure = maker(results[key])
            files.append(folder / f"bench_{names.get(key, key)}.png")
            figure.savefig(files[-1], dpi=100)
            plt.close(figure)
    return files


def _backends(samples: Dict[str, Dict[str, List[float]]]) -> plt.Figure:
    """Time of a solve, every problem a point, by kind of problem and backend."""
    kinds = [kind for kind in samples if kind != "all"]
    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    width = 0.8 / len(samples["all"])
    for i, kind in enumerate(kinds):
        for j, (name, times) in enumerate(samples[kind].items()):
            x = i - 0.4 + width * (j + 0.5)
            spread = x + 0.6 * width * (np.linspace(0.0, 1.0, len(times)) - 0.5)
            label = name if i == 0 else None
            axes.plot(spread, times, ".", color=_COLOURS[name], markersize=4, label=label)
            axes.plot([x - width / 2.5, x + width / 2.5], 2 * [np.median(times)], "k", lw=1.5)
    axes.set_xticks(range(len(kinds)), [kind.replace("_", "\n", 1) for kind in kinds])
    axes.set(yscale="log", ylabel="one call from Python [ms]", title="The same problems, one run")
    axes.grid(axis="y", alpha=0.3)
    axes.legend(loc="upper left", ncol=4)
    return figure


def _scaling(results: Dict[str, Any]) -> plt.Figure:
    figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for axes, key, label in zip(
        panels,
        ("scaling_n", "scaling_obstacles"),
        ("stages N", "obstacles, each in a slot of its own"),
    ):
        data = results[key]
        axes.plot(data["size"], data["p50_ms"], "o-", color=_COLOURS["budgeted"])
        axes.set(xlabel=label, ylabel="median solve [ms]", ylim=(0, None))
        axes.set_title(f"growth with the power {data['exponent']:.2f}")
        axes.grid(alpha=0.3)
    return figure


def _horizon(results: Dict[str, Any]) -> plt.Figure:
    """Paths around the circuit, and what a longer look ahead is worth relative to the longest."""
    figure, panels = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained")
    scene, laps = circuit(), results["horizon_circuit"]
    reference = scene.trajectory.sample(np.linspace(0.0, scene.trajectory.duration, 400)).position
    panels[0].plot(*reference[:, :2].T, "k--", lw=1, label="reference")
    for sphere in scene.obstacles:
        panels[0].add_patch(plt.Circle(sphere.position[:2], sphere.size[0], color="0.8"))
    for lap in laps:
        if lap["seconds"] in _SHOWN_HORIZONS:
            panels[0].plot(*np.array(lap["path"]).T, lw=1.3, label=f"{lap['seconds']:g} s")
    panels[0].set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="circuit at 4 m/s")
    panels[0].legend(loc="center", title="horizon")
    for key, name, marker in (
        ("horizon_circuit", "circuit, 4 m/s", "o"),
        ("horizon", "multi_obstacle, 2.35 m/s", "s"),
    ):
        rows = results[key]
        seconds = [row["seconds"] for row in rows]
        for quantity, label, line in (
            ("cost", "closed-loop cost", "-"),
            ("deviation_mean", "mean deviation", "--"),
        ):
            part = [row[quantity] / rows[-1][quantity] for row in rows]
            panels[1].plot(seconds, part, line + marker, ms=4, label=f"{label}: {name}")
    panels[1].set(xlabel="horizon [s]", ylabel="relative to the longest horizon")
    panels[1].grid(alpha=0.3)
    panels[1].legend()
    return figure


def _presets(laps: List[Dict[str, Any]]) -> plt.Figure:
    figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
    corners = np.array(laps[0]["corners"])
    closed = np.vstack([corners, corners[:1]])
    axes.plot(closed[:, 0], closed[:, 1], "k--", lw=1, label="reference")
    for lap in laps:
        path = np.array(lap["path"])
        label = f"{lap['preset']}, {lap['speed']:g} m/s"
        axes.plot(path[:, 0], path[:, 1], label=label)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="hexagon, second lap of three")
    axes.grid(alpha=0.3)
    axes.legend(loc="center")
    return figure
