# SPDX-License-Identifier: MIT
"""An identification as text for a terminal."""

from typing import Any, List, Optional, Sequence

from nmpc_control.analysis.identification.attitude import AXES, LIMIT
from nmpc_control.analysis.identification.estimate import Estimate
from nmpc_control.analysis.identification.identify import Identification
from nmpc_control.analysis.identification.segments import FLIGHT, KINDS
from nmpc_control.analysis.identification.thrust import VERTICAL

_UNITS = {
    "omega": "rad/s",
    "time_constant_s": "s",
    "dead_time_s": "s",
    "lag_s": "s",
    "fit_percent": "%",
    LIMIT: "rad",
    "slope": "m/s^2 per %",
    "offset": "m/s^2",
    "hover_percent": "%",
    "forward": "1/s",
    "sideways": "1/s",
    VERTICAL: "1/s",
    "velocity_lag_s": "s",
    "steady_x": "m/s^2",
    "steady_y": "m/s^2",
    "speed_rms": "m/s",
    "quadratic_forward": "1/m",
    "quadratic_sideways": "1/m",
}
_MOST_LEVELS = 12  # of the battery that are printed


def as_text(found: Identification) -> str:
    """Return the identification as lines, values with their 95 % intervals."""
    attitude = found.attitude
    lines = [f"{', '.join(found.bags)}: source {found.source}", "", "segments [s]"]
    for part in found.segments:
        bag = f"{part.bag}  " if len(found.bags) > 1 else ""
        meaning = KINDS[part.kind]
        lines.append(f"  {bag}{max(0.0, part.start):8.2f} {part.end:8.2f}  {part.kind}: {meaning}")
    regime = "" if found.regime == FLIGHT else f", {found.regime} regime"
    for axis in AXES:
        lines += _section(f"{axis}, second order{regime}", attitude.second[axis])
        lines += _section(f"{axis}, first order{regime}", attitude.first[axis])
    lines += _cross_validation(found)
    lines += _section("tilt limit", attitude.tilt_limit)
    lines += _section("yaw rate, second order", found.yaw_rate.second)
    lines += _section("yaw rate, first order", found.yaw_rate.first)
    lines += _section("thrust: slope * percent + offset", found.thrust.estimate)
    lines += _section("drag", found.drag.estimate)
    lines += _section("drag, vertical", found.thrust.vertical_drag)
    lines += _battery(found) + _noise(found) + _other(found)
    return "\n".join(lines) + "\n"


def number(value: Optional[float], unit: str = "") -> str:
    """Return a number as it is printed."""
    return "-" if value is None else f"{value:.4g}{' ' + unit if unit else ''}"


def _section(title: str, estimate: Estimate) -> List[str]:
    lines = ["", title]
    if not estimate.is_found:
        return [*lines, f"  not identifiable: {estimate.reason}"]
    for name, value in estimate.values.items():
        interval = estimate.confidence.get(name)
        span = "" if interval is None else f"   [{interval[0]:.4g}, {interval[1]:.4g}]"
        lines.append(f"  {name:<20}{number(value, _UNITS.get(name, ''))}{span}")
    if estimate.reason:
        lines.append(f"  not identifiable: {estimate.reason}")
    return lines


def _axes(fits: Any) -> str:
    return ", ".join(f"{axis} {number(fits[axis], '%')}" for axis in AXES)


def _cross_validation(found: Identification) -> List[str]:
    lines = ["", "fit on held-back parts with parameters from the others"]
    folds = found.cross_validation["folds"]
    lines += [f"  {f['start']:8.2f} {f['end']:8.2f}  {_axes(f)}" for f in folds]
    if folds:
        lines.append(f"  all of them        {_axes(found.cross_validation)}")
    else:
        lines.append(f"  not done: {found.cross_validation['reason']}")
    if found.validation is not None:
        lines.append(f"  asked for: {_axes(found.validation)}")
    return lines


def _battery(found: Identification) -> List[str]:
    battery = found.battery
    lines = ["", "hover thrust by state of charge"]
    step = max(1, -(-len(battery.levels) // _MOST_LEVELS))
    for level in battery.levels[::step]:
        values = f"{level['hover_percent']:.2f} +- {level['std']:.2f} %"
        lines.append(f"  {level['battery_percent']:5.0f} %  {values}, {level['samples']} windows")
    if battery.slope is not None:
        lines.append(f"  slope {battery.slope:.4f} % per %")
    return lines if battery.reason is None else [*lines, f"  not identifiable: {battery.reason}"]


def _noise(found: Identification) -> List[str]:
    names = (
        ("attitude", "rad"),
        ("velocity", "m/s"),
        ("gyro", "rad/s"),
        ("accelerometer", "m/s^2"),
    )
    lines = ["", "noise, standard deviation of each axis"]
    for name, unit in names:
        values: Optional[Sequence[float]] = found.noise[name]
        if values is not None:
            lines.append(f"  {name:<16}{', '.join(f'{v:.2g}' for v in values)} {unit}")
    return lines + ([f"  {found.noise['reason']}"] if "reason" in found.noise else [])


def _other(found: Identification) -> List[str]:
    lines = []
    if found.other_regime is not None:
        other = found.other_regime
        gains = ", ".join(f"{axis} {number(other[axis]['gain'])}" for axis in AXES)
        tilt = other["largest_tilt_rad"]
        lines += ["", f"limited segments, not mixed in: gain {gains}; tilt up to {tilt:.3f} rad"]
    if found.remarks:
        lines += ["", *(f"note: {remark}" for remark in found.remarks)]
    return lines
