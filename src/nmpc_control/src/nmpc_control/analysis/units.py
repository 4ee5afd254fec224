# SPDX-License-Identifier: MIT
"""The units of figures, from the ends of their names."""

from typing import Any, Dict

from nmpc_control.analysis.record import Metrics

_UNITS = (  # longest first: the first end that fits counts
    ("_rad_s_time_s", "s"),
    ("_variation_per_s", None),  # of each input its own
    ("_percent_s", "percent/s"),
    ("_rad_s2", "rad/s^2"),
    ("_m_s3", "m/s^3"),
    ("_rad_s", "rad/s"),
    ("_m_s", "m/s"),
    ("_ms_p99", "ms"),
    ("_ms_max", "ms"),
    ("_percent", "percent"),
    ("_hz", "Hz"),
    ("_rad", "rad"),
    ("_ms", "ms"),
    ("_m", "m"),
    ("_s", "s"),
    ("_ratio", "1"),
    ("share", "1"),
)
_COUNTS = (
    "solver_iterations_mean",
    "solver_iterations",
    "plans_rejected",
    "deadline_misses",
    "collisions",
    "messages",
)
_INPUTS = {
    "thrust_min": "percent",
    "thrust_max": "percent",
    "angle": "rad",
    "yaw_rate": "rad/s",
}


def units(metrics: Metrics) -> Dict[str, str]:
    """Return the unit of every figure by its name, of those inside of others too."""
    found: Dict[str, str] = {}
    _collect(metrics, found)
    return found


def _collect(value: Any, found: Dict[str, str]) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            if key == "timeline":
                found.update(start="s", end="s")
                continue
            if key in _COUNTS:
                found[key] = "1"
            elif key in _INPUTS:
                found[key] = _INPUTS[key]
            else:
                unit = next((u for end, u in _UNITS if key.endswith(end)), None)
                if unit is not None:
                    found[key] = unit
            if key not in ("clearance_m", "mode_time_s"):  # inner names are the bag's
                _collect(inner, found)
    elif isinstance(value, list):
        for item in value:
            if isinstance(item, dict):
                _collect(item, found)
