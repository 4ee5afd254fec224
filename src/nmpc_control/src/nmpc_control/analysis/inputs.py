# SPDX-License-Identifier: MIT
"""What the inputs cost: effort, restlessness and time at their bounds."""

from typing import Dict, List, NamedTuple, Optional

import numpy as np

from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.windows import Window
from nmpc_control.params import load_parameters
from nmpc_control.state import PITCH_REF, ROLL_REF, THRUST, YAW_RATE_REF

_NAMES = {
    "thrust_percent": THRUST,
    "roll_rad": ROLL_REF,
    "pitch_rad": PITCH_REF,
    "yaw_rate_rad_s": YAW_RATE_REF,
}
_PER_S = {  # names of their variation
    "thrust_percent": "thrust_percent_s",
    "roll_rad": "roll_rad_s",
    "pitch_rad": "pitch_rad_s",
    "yaw_rate_rad_s": "yaw_rate_rad_s2",
}
_AT_BOUND = 1e-3  # share of the range from which on an input is at its bound
_LONGEST_HOLD = 0.5  # [s] a command counts for no longer than this


class InputLimits(NamedTuple):
    """Bounds of the inputs; the defaults are the paper's (its code: 30 to 60 percent, 20 deg)."""

    thrust_min: float = 30.0  # [percent]
    thrust_max: float = 60.0  # [percent]
    angle: float = np.deg2rad(20.0)  # [rad] roll and pitch
    yaw_rate: float = np.deg2rad(150.0)  # [rad/s]


def controller_limits(vehicle: str = "dji_hil") -> InputLimits:
    """Return the bounds of this workspace's controller with a vehicle; raises ConfigError."""
    parameters = load_parameters(vehicle)
    low, high = parameters.limits.input_min, parameters.limits.input_max
    percent = parameters.vehicle.thrust_map.percent
    return InputLimits(percent(low[0]), percent(high[0]), float(high[1]), float(high[3]))


def default_limits(record: FlightRecord) -> InputLimits:
    """Return the controller's bounds for its own flights, the paper's for all others."""
    is_own = record.solver is not None or record.status is not None
    return controller_limits() if is_own else InputLimits()


def input_figures(
    record: FlightRecord, window: Optional[Window], limits: InputLimits, missing: List[str]
) -> Metrics:
    """Return effort, total variation and time in saturation of the commands in the window."""
    figures: Metrics = dict.fromkeys(("input_effort", "input_variation_per_s", "saturation"))
    figures["input_limits"] = limits._asdict()
    if record.commands is None or window is None:
        return figures
    commands = record.commands.between(window.start, window.end)
    if len(commands) < 2:
        missing.append("fewer than two commands in the evaluated time: no effort, no saturation")
        return figures
    held = np.minimum(np.diff(commands.times, append=commands.times[-1]), _LONGEST_HOLD)
    effort: Dict[str, Optional[float]] = {}
    variation: Dict[str, Optional[float]] = {}
    for name, column in _NAMES.items():
        values = commands.values[:, column]
        given = np.isfinite(values)
        time = held[given].sum()
        known = values[given]
        centre = known.mean() if column == THRUST and len(known) else 0.0
        is_known = len(known) > 1 and time > 0.0
        effort[name] = (
            np.sqrt((held[given] * (known - centre) ** 2).sum() / time) if is_known else None
        )
        variation[_PER_S[name]] = np.abs(np.diff(known)).sum() / time if is_known else None
    figures["input_effort"], figures["input_variation_per_s"] = effort, variation
    figures["saturation"] = _saturation(commands.values, held, limits, missing)
    return figures


def _saturation(
    commands: np.ndarray, held: np.ndarray, limits: InputLimits, missing: List[str]
) -> Metrics:
    """Return the time [s] at each bound, and at any, with its share of the commanded time.

    Commands beyond assumed bounds show that these were not the flight's: None, and the reason.
    """
    bounds = {
        "thrust_percent": (limits.thrust_min, limits.thrust_max),
        "roll_rad": (-limits.angle, limits.angle),
        "pitch_rad": (-limits.angle, limits.angle),
        "yaw_rate_rad_s": (-limits.yaw_rate, limits.yaw_rate),
    }
    anywhere = np.zeros(len(commands), dtype=bool)
    figures: Metrics = {}
    for name, (low, high) in bounds.items():
        values, margin = commands[:, _NAMES[name]], _AT_BOUND * (high - low)
        given = values[np.isfinite(values)]
        if (given < low - margin).any() or (given > high + margin).any():
            missing.append(
                f"{name}: commands from {given.min():.4g} to {given.max():.4g} exceed the assumed "
                f"bounds {low:.4g} to {high:.4g}: no time in saturation (--vehicle names others)"
            )
            figures[f"{name}_time_s"] = None
            continue
        at_bound = (values <= low + margin) | (values >= high - margin)  # false where NaN
        anywhere |= at_bound
        figures[f"{name}_time_s"] = held[at_bound].sum()
    total = held.sum()
    if None in figures.values():
        return {**figures, "time_s": None, "share": None}
    figures["time_s"] = held[anywhere].sum()
    figures["share"] = figures["time_s"] / total if total > 0.0 else None
    return figures
