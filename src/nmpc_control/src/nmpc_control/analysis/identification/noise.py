# SPDX-License-Identifier: MIT
"""Noise of the telemetry, as seen from one sample to the next.

The third difference of evenly spaced samples removes smooth motion and multiplies the variance of
white noise by 20; the median over seconds keeps manoeuvres out. Slower errors (drift, bias) are not
seen, and neither is anything in a simulator that adds none.
"""

from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from nmpc_control.analysis.identification.passages import Stretch
from nmpc_control.analysis.messages import IMU_ACCELERATION, IMU_RATES
from nmpc_control.analysis.record import Series

_GAIN = np.sqrt(20.0)  # of the third difference: 1 + 9 + 9 + 1
_WINDOW = 1.0  # [s]
_FEWEST = 20  # samples in a window


def identify_noise(stretches: Sequence[Stretch], source: str) -> Dict[str, Any]:
    """Return the standard deviation of each axis of what was measured in flight."""
    found: Dict[str, Any] = {
        "attitude": _deviation([(s.log.attitude, slice(0, 3), s) for s in stretches]),
        "velocity": _deviation([(s.log.velocity, slice(0, 3), s) for s in stretches]),
        "gyro": _deviation([(s.log.imu, IMU_RATES, s) for s in stretches]),
        "accelerometer": _deviation([(s.log.imu, IMU_ACCELERATION, s) for s in stretches]),
    }
    if source != "flight":
        found["reason"] = f"source {source}: says nothing about the noise of an aircraft in flight"
    elif not stretches:
        found["reason"] = "no part in flight"
    return found


def _deviation(parts: Sequence[Any]) -> Optional[List[float]]:
    deviations: List[np.ndarray] = []
    for series, columns, stretch in parts:
        if series is not None:
            inside = series.between(stretch.start, stretch.end)
            deviations += _by_window(inside, columns)
    if not deviations:
        return None
    return [float(x) for x in np.median(deviations, axis=0)]


def _by_window(series: Series, columns: slice) -> List[np.ndarray]:
    if len(series) < _FEWEST:
        return []
    windows = ((series.times - series.times[0]) / _WINDOW).astype(int)
    edges = [0, *(np.flatnonzero(np.diff(windows)) + 1), len(windows)]
    parts = [series.values[a:b, columns] for a, b in zip(edges[:-1], edges[1:])]
    return [
        np.sqrt(np.mean(np.diff(part, n=3, axis=0) ** 2, axis=0)) / _GAIN
        for part in parts
        if len(part) >= _FEWEST
    ]
