# SPDX-License-Identifier: MIT
"""Figure of a replay: commanded, recorded and replayed angles, and vertical velocity."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from uav_sim.closed_loop.replay.recorded import PITCH, ROLL
from uav_sim.closed_loop.replay.replay import Replay

COMMANDED, RECORDED, REPLAYED = "0.75", "tab:blue", "tab:orange"
_STYLE = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.fontsize": 8}


def write_figure(result: Replay, path: Path, title: str) -> None:
    """Write the figure to a PNG or PDF file."""
    with matplotlib.rc_context(_STYLE):
        figure = replay_figure(result)
        figure.suptitle(title)
        figure.savefig(path, dpi=130)


def replay_figure(result: Replay) -> Figure:
    """Return three axes over the time of the bag; only airborne segments are replayed."""
    figure = Figure(figsize=(10.0, 7.5), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    first, last = result.segments[0].start, result.segments[-1].end
    commands = result.recorded.commands.between(first, last)
    for k, (name, column) in enumerate((("roll", ROLL), ("pitch", PITCH))):
        scaled = np.degrees(result.attitude_scale * commands.values[:, column])
        axes[k].plot(commands.times, scaled, color=COMMANDED, label="commanded")
        axes[k].set_ylabel(f"{name} [deg]")
    axes[2].set_ylabel("vertical velocity [m/s]")
    axes[2].set_xlabel("time of the bag [s]")
    for i, motion in enumerate(result.motions):
        labels = ("recorded", "replayed") if i == 0 else (None, None)
        shown = (
            (motion.attitude, motion.replayed_attitude),
            (motion.vertical_velocity, motion.replayed_vertical_velocity),
        )
        for values, color, label in zip(zip(*shown), (RECORDED, REPLAYED), labels):
            angles, vertical = np.degrees(values[0]), values[1]
            axes[0].plot(motion.attitude_times, angles[:, 0], color=color, label=label)
            axes[1].plot(motion.attitude_times, angles[:, 1], color=color, label=label)
            axes[2].plot(motion.velocity_times, vertical, color=color, label=label)
    axes[0].legend(loc="upper right")
    axes[2].legend(loc="upper right")
    return figure
