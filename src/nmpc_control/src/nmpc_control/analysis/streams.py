# SPDX-License-Identifier: MIT
"""How regularly each topic came, and what the battery and hovering tell."""

from typing import List, Optional

import numpy as np

from nmpc_control.analysis.gaps import stream_gaps
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.windows import Window, runs
from nmpc_control.state import THRUST

_HOVER_SPEED, _HOVER_CLIMB = 0.3, 0.15  # [m/s] slower counts as hovering
_HOVER_TILT = 0.1  # [rad]
_LEAST_HOVER = 25  # commands
_SHORTEST_HOVER = 1.0  # [s]


def stream_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return rate and gaps of every topic in the window, by the end of its name."""
    if window is None or not record.stamps:
        return {"streams": None}
    streams = {}
    for name, times in record.stamps.items():
        count = int(np.sum((times >= window.start) & (times <= window.end)))
        if count < 2:
            if len(times) > 2:
                missing.append(f"{name}: no two messages in the evaluated time: no rate")
            continue
        gaps = stream_gaps(times, window.start, window.end)
        streams[name] = {
            "rate_hz": len(gaps) / max(gaps.sum(), 1e-9),
            "gap_ms_p99": 1e3 * np.percentile(gaps, 99),
            "gap_ms_max": 1e3 * gaps.max(),
            "messages": count,
        }
    return {"streams": streams}


def battery_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return the charge at the window's ends and the thrust that held the aircraft still."""
    figures: Metrics = {"battery_percent": None, "hover_thrust_percent": None}
    if window is None:
        return figures
    battery = record.battery and record.battery.between(window.start, window.end)
    if battery is not None and len(battery):
        charge = battery.values.reshape(len(battery), -1)[:, 0]
        figures["battery_percent"] = [charge[0], charge[-1]]
    else:
        missing.append("no battery state in the evaluated time: no charge")
    thrust = _hovering(record)
    if thrust is None:
        missing.append("no thrust commands together with velocity and attitude: no hover thrust")
    elif len(thrust) < _LEAST_HOVER:
        missing.append("the aircraft hardly hovered on thrust commands: no hover thrust")
    else:
        low, middle, high = np.percentile(thrust, (5, 50, 95))
        figures["hover_thrust_percent"] = {"p5": low, "median": middle, "p95": high}
    return figures


def _hovering(record: FlightRecord) -> Optional[np.ndarray]:
    """Return the thrust commands (n,) [percent] while the aircraft hovered in the air."""
    if record.commands is None or record.velocity is None or record.attitude is None:
        return None
    if record.airborne is None:
        return None
    commands = record.commands.between(*record.airborne)
    thrust = commands.values[:, THRUST]
    velocity, attitude = (s.at(commands.times) for s in (record.velocity, record.attitude))
    is_still = (np.linalg.norm(velocity, axis=1) < _HOVER_SPEED) & (
        np.abs(velocity[:, 2]) < _HOVER_CLIMB
    )
    is_level = np.hypot(attitude[:, 0], attitude[:, 1]) < _HOVER_TILT
    hovers = is_still & is_level
    for start, end in runs(commands.times, hovers):
        if end - start < _SHORTEST_HOVER:  # on its way through standstill
            hovers &= (commands.times < start) | (commands.times > end)
    return thrust[hovers & np.isfinite(thrust)]
