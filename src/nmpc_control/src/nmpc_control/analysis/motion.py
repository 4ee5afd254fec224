# SPDX-License-Identifier: MIT
"""How an aircraft moved: length, speed, tilt and jerk."""

from typing import List, Optional

import numpy as np
from scipy.signal import savgol_filter

from nmpc_control.analysis.effort import within
from nmpc_control.analysis.record import FlightRecord, Metrics, Series
from nmpc_control.analysis.windows import Window

_MOTION_FIGURES = ("airborne_time_s", "path_length_m", "speed_m_s", "tilt_rad", "jerk_m_s3")
_JERK_STEP = 0.02  # [s] between the samples that jerk is taken from
_JERK_SAMPLES = 25  # of each fit: half a second
_JERK_GAP = 0.3  # [s] without velocities: no jerk across it


def motion_figures(record: FlightRecord, window: Optional[Window], missing: List[str]) -> Metrics:
    """Return time in the air, length, speed, tilt and jerk in the window."""
    figures: Metrics = dict.fromkeys(_MOTION_FIGURES)
    if record.airborne is None:
        missing.append("nothing says when the aircraft was in the air: no airborne time")
    else:
        figures["airborne_time_s"] = record.airborne[1] - record.airborne[0]
    if window is None:
        return figures
    if record.position is None:
        missing.append("no positions: no path length")
    else:
        steps = np.diff(within(record.position, window), axis=0)
        figures["path_length_m"] = np.linalg.norm(steps, axis=1).sum() if len(steps) else None
    velocity, attitude = within(record.velocity, window), within(record.attitude, window)
    if len(velocity):
        speed = np.linalg.norm(velocity, axis=1)
        figures["speed_m_s"] = {"mean": speed.mean(), "max": speed.max()}
    else:
        missing.append("no velocities: no speed")
    figures["jerk_m_s3"] = jerk(record.velocity, window)
    if len(attitude):
        tilt = np.arccos(np.cos(attitude[:, 0]) * np.cos(attitude[:, 1]))
        figures["tilt_rad"] = {"mean": tilt.mean(), "max": tilt.max()}
    else:
        missing.append("no attitudes: no tilt")
    return figures


def jerk(velocity: Optional[Series], window: Window) -> Optional[Metrics]:
    """Return rms and maximum of the jerk [m/s^3], by cubic fits over half a second of velocity.

    Raw differences of a recorded velocity would show its noise instead.
    """
    if velocity is None:
        return None
    flown = velocity.between(window.start, window.end)
    edges = np.flatnonzero(np.diff(flown.times) > _JERK_GAP) + 1
    found = []
    for part in np.split(np.arange(len(flown)), edges):
        if len(part) < 4:
            continue
        times = np.arange(flown.times[part[0]], flown.times[part[-1]], _JERK_STEP)
        if len(times) >= _JERK_SAMPLES:
            even = Series(flown.times[part], flown.values[part]).at(times)
            second = savgol_filter(even, _JERK_SAMPLES, 3, deriv=2, delta=_JERK_STEP, axis=0)
            found.append(np.linalg.norm(second, axis=1))
    if not found:
        return None
    size = np.concatenate(found)
    return {"rms": np.sqrt(np.mean(size**2)), "max": size.max()}
