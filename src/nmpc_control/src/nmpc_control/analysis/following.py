# SPDX-License-Identifier: MIT
"""The error of a flight in more detail: along and across the reference, percentiles, axes."""

from typing import Dict, Optional, Tuple

import numpy as np

from nmpc_control.analysis.record import Metrics, Reference, Series

PERCENTILES = (50, 90, 95, 99)
_STANDSTILL = 0.02  # [m/s] of the reference: below it has no direction
_STEP = 0.05  # [s] around a moment in which its direction is taken


def following_figures(error: Optional[Series], reference: Optional[Reference]) -> Metrics:
    """Return percentiles, figures of each axis, along-track and cross-track error.

    Args:
        error: Position minus reference at the same time (n, 3) [m]; None where not known.
        reference: What was to be flown.
    """
    figures: Metrics = dict.fromkeys(
        ("ape_m", "deviation_percentiles_m", "axis_error_m", "cross_track_m", "along_track_m")
    )
    if error is None or not len(error):
        return figures
    deviation = np.linalg.norm(error.values, axis=1)
    figures["ape_m"] = _statistics(deviation)
    figures["deviation_percentiles_m"] = {f"p{p}": np.percentile(deviation, p) for p in PERCENTILES}
    figures["axis_error_m"] = {
        axis: {"mean": column.mean(), "max": np.abs(column).max()}
        for axis, column in zip("xyz", error.values.T)
    }
    along, across = track_errors(error, reference)
    if len(along):
        figures["along_track_m"] = {**_statistics(np.abs(along)), "bias": along.mean()}
        figures["cross_track_m"] = _statistics(across)
    return figures


def track_errors(error: Series, reference: Reference) -> Tuple[np.ndarray, np.ndarray]:
    """Return the error along the reference's motion (positive: ahead) and across it (m,) [m].

    Moments in which the reference stands still have no direction: they are left out.
    """
    ahead = reference.position_at(error.times + _STEP / 2.0)
    step = ahead - reference.position_at(error.times - _STEP / 2.0)
    length = np.linalg.norm(step, axis=1)
    moving = length > _STANDSTILL * _STEP
    values, direction = error.values[moving], step[moving] / length[moving, None]
    along = np.einsum("ij,ij->i", values, direction)
    return along, np.linalg.norm(values - along[:, None] * direction, axis=1)


def _statistics(distance: np.ndarray) -> Dict[str, float]:
    """Return what evo_ape prints of distances (n,) [m], under its names."""
    return {
        "rmse": np.sqrt(np.mean(distance**2)),
        "mean": distance.mean(),
        "median": np.median(distance),
        "std": distance.std(),
        "min": distance.min(),
        "max": distance.max(),
    }
