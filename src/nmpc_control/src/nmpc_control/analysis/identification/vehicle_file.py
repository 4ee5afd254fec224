# SPDX-License-Identifier: MIT
"""An identification as a vehicle file of the controller (config/vehicles)."""

import io
import json
from typing import List, Optional, Tuple

import numpy as np
import yaml

from nmpc_control.analysis.identification.attitude import AXES, LIMIT
from nmpc_control.analysis.identification.drag import mean_drag
from nmpc_control.analysis.identification.identify import Identification
from nmpc_control.analysis.identification.thrust import VERTICAL
from nmpc_control.analysis.messages import text
from nmpc_control.battery_thrust import LEAST, MOST
from nmpc_control.config import from_dict
from nmpc_control.params import Lag, Vehicle
from nmpc_control.state import GRAVITY

_CHARGES = 4  # points of the battery's curve
_SHORTEST_LAG = 0.02  # [s] of the yaw rate, where the dead time of all inputs takes most of it

Line = Tuple[str, str]  # key and value, comment


def vehicle_yaml(
    found: Identification, name: str, base: Vehicle, airframe: Optional[str]
) -> Tuple[str, List[str]]:
    """Return the file's text, and what in it is not from the bags.

    Args:
        found: what was identified.
        name: of the vehicle.
        base: where mass, hull, thrust range and what is not identified are from.
        airframe: words for what was measured, where and when; None: not given.

    Raises:
        ConfigError: the numbers do not make a vehicle.
    """
    kept: List[str] = []
    lines = [
        ("name: " + json.dumps(text(name)), ""),
        (f"mass: {base.mass:.6g}", f"[kg] not identified: of {base.name}"),
        (f"radius: {base.radius:.6g}", f"[m] not identified: of {base.name}"),
        *_attitude(found, base, kept),
        _yaw_rate(found, base, kept),
        _drag(found, base, kept),
        _delay(found, base),
        _tilt_limit(found, base, kept),
        *_thrust_map(found, base, airframe, kept),
        *_battery(found),
    ]
    bags = ", ".join(text(bag) for bag in found.bags)
    head = f"# Identified from {bags}; source: {found.source} (doc/identification.md).\n"
    body = "".join(f"{line}  # {comment}\n" if comment else f"{line}\n" for line, comment in lines)
    from_dict(Vehicle, yaml.safe_load(io.StringIO(body)), name)
    return head + body, kept


def _attitude(found: Identification, base: Vehicle, kept: List[str]) -> List[Line]:
    lags = found.attitude.lags
    lines = []
    for number, axis in enumerate(AXES):
        lag: Lag = getattr(base, axis)
        comment = f"[s], [1] not identified: of {base.name}"
        if lags is not None and found.attitude.first[axis].is_found:
            gain, time_constant, _ = lags.rows[number]
            fit = found.attitude.first[axis].values["fit_percent"]
            lag = Lag(float(time_constant), float(gain))
            comment = f"[s], [1] best first-order fit, {fit:.1f} %"
        else:
            kept.append(axis)
        lines.append((_lag(axis, lag), comment))
    return lines


def _lag(name: str, lag: Lag) -> str:
    return f"{name}: {{time_constant: {lag.time_constant:.4g}, gain: {lag.gain:.4g}}}"


def _delay_of(found: Identification, base: Vehicle) -> float:
    """Return the dead time [s] of all inputs: that of the first-order fit of the attitude."""
    lags = found.attitude.lags
    return base.delay if lags is None else float(lags.rows[0, -1])


def _delay(found: Identification, base: Vehicle) -> Line:
    where = f"not identified: of {base.name}" if found.attitude.lags is None else "of that fit"
    thrust, lag = (found.thrust.estimate.values[name] for name in ("dead_time_s", "lag_s"))
    other = "" if thrust is None else f"; thrust alone {thrust:.3f}"
    other += "" if thrust is None or lag is None else f" and a lag of {lag:.3f}, not modelled"
    return f"delay: {_delay_of(found, base):.4g}", f"[s] dead time, {where}{other}"


def _yaw_rate(found: Identification, base: Vehicle, kept: List[str]) -> Line:
    """Return the lag that is as late on the whole, after the dead time of all inputs."""
    second, first = found.yaw_rate.second.values, found.yaw_rate.first.values
    if None not in second.values():
        gain, lateness = second["gain"], 2.0 * second["zeta"] / second["omega"]
        lateness += second["dead_time_s"]
    elif None not in first.values():
        gain, lateness = first["gain"], first["time_constant_s"] + first["dead_time_s"]
    else:
        kept.append("yaw_rate")
        return _lag("yaw_rate", base.yaw_rate), f"[s], [1] not identified: of {base.name}"
    lag = Lag(max(_SHORTEST_LAG, lateness - _delay_of(found, base)), gain)
    return _lag("yaw_rate", lag), "[s], [1] as late on the whole as the response, less the delay"


def _drag(found: Identification, base: Vehicle, kept: List[str]) -> Line:
    along = [found.drag.estimate.values[name] for name in ("forward", "sideways")]
    horizontal, vertical = mean_drag(along), found.thrust.vertical_drag.values[VERTICAL]
    drag = [horizontal, horizontal, vertical]
    if None in drag:
        kept.append("drag")
    known = [float(b) if d is None else max(0.0, d) for d, b in zip(drag, base.drag)]
    own = ["?" if d is None else f"{d:.3f}" for d in along]
    comment = f"[1/s] world x, y, z: forward {own[0]} and sideways {own[1]}, their mean"
    if None in drag:
        comment += f"; what is not identified is of {base.name}"
    return "drag: [" + ", ".join(f"{d:.4g}" for d in known) + "]", comment


def _tilt_limit(found: Identification, base: Vehicle, kept: List[str]) -> Line:
    limit = found.attitude.tilt_limit.values[LIMIT]
    if limit is None:
        kept.append("tilt_limit")
        return f"tilt_limit: {base.tilt_limit:.4g}", f"[rad] not identified: of {base.name}"
    return f"tilt_limit: {limit:.4g}", "[rad] norm of the commanded (roll, pitch)"


def _thrust_map(
    found: Identification, base: Vehicle, airframe: Optional[str], kept: List[str]
) -> List[Line]:
    """Return the map; only a map that was identified may say what it was measured on."""
    values, measured = found.thrust.estimate.values, base.thrust_map
    if found.thrust.map is None:
        kept.append("thrust_map")
        slope, offset, origin = measured.slope, measured.offset, ""
        comment = f"not identified: of {base.name}"
    else:
        slope, offset = found.thrust.map.slope, found.thrust.map.offset
        comment = f"R^2 {values['r2']:.3f}, hover {values['hover_percent']:.1f} %"
        origin = ", ".join(filter(None, (_ORIGINS.get(found.source), airframe)))
    why = "" if origin else "empty: the guard commands no thrust through this map"
    return [
        ("thrust_map:", ""),
        (f"  slope: {slope:.5g}", f"[m/s^2 per percent] {comment}"),
        (f"  offset: {offset:.5g}", "[m/s^2]"),
        (f"  minimum: {measured.minimum:.4g}", f"[percent] of {base.name}"),
        (f"  maximum: {measured.maximum:.4g}", f"[percent] of {base.name}"),
        ("  measured_on: " + json.dumps(text(origin)), why),
    ]


def _battery(found: Identification) -> List[Line]:
    """Return what the charge leaves of the thrust, where the flights discharged far enough."""
    thrust_map, slope, levels = found.thrust.map, found.battery.slope, found.battery.levels
    if thrust_map is None or slope is None or not levels:
        return []
    charges = np.array([level["battery_percent"] for level in levels])
    samples = [level["samples"] for level in levels]
    mean = float(np.average(charges, weights=samples))
    mapped = found.thrust.estimate.values.get("charge_percent") or mean
    at = np.linspace(charges.min(), charges.max(), _CHARGES)
    hover = (GRAVITY - thrust_map.offset) / thrust_map.slope + slope * (at - mapped)
    gain = np.clip(GRAVITY / thrust_map.thrust(hover), LEAST, MOST)
    return [
        ("battery:", ""),
        ("  charge: [" + ", ".join(f"{c / 100.0:.3f}" for c in at) + "]", "[1]"),
        (
            "  gain: [" + ", ".join(f"{g:.4f}" for g in gain) + "]",
            f"[1] hover thrust moved by {slope:.3f} percent per percent of charge",
        ),
    ]


_ORIGINS = {"hil": "DJI HIL simulator", "simulation": "uav_sim"}  # no airframe at all
