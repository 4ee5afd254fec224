# SPDX-License-Identifier: MIT
"""Trajectories as TUM files, for evo and other tools: stamp x y z qx qy qz qw in every line.

Both files hold the same stamps, so that ``evo_ape tum reference.tum estimate.tum`` without
alignment compares what ``ape_m`` compares.
"""

from pathlib import Path
from typing import List

import numpy as np

from nmpc_control.analysis.deviation import errors
from nmpc_control.analysis.quaternions import from_rpy
from nmpc_control.analysis.record import FlightRecord, Series
from nmpc_control.analysis.windows import scenario_window

_HEADER = "# timestamp[s] tx[m] ty[m] tz[m] qx qy qz qw"
_LEAST_STEP = 1e-6  # [s] the files' resolution: closer stamps would come twice


def write_tum(record: FlightRecord, directory: Path) -> List[str]:
    """Write estimate, reference and truth as far as they are known; return the files' names.

    The reference has no attitude of its own: its quaternion is that of no rotation.
    """
    window = scenario_window(record)
    written: List[str] = []
    if record.position is None or window is None:
        return written
    estimate = record.position.between(window.start, window.end)
    if not len(estimate):
        return written
    directory.mkdir(parents=True, exist_ok=True)
    if record.reference is not None:
        error = errors(record.position, record.reference, window.start, window.reference_end)
        estimate = Series(error.times, error.values + record.reference.position_at(error.times))
        reference = Series(estimate.times, record.reference.position_at(estimate.times))
        _write(directory / "reference.tum", reference, record, False)
        written.append("reference.tum")
    _write(directory / "estimate.tum", estimate, record, True)
    written.append("estimate.tum")
    if record.true_position is not None:
        truth = record.true_position.between(window.start, window.reference_end)
        _write(directory / "truth.tum", truth, record, True)
        written.append("truth.tum")
    return written


def _write(path: Path, positions: Series, record: FlightRecord, has_attitude: bool) -> None:
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
    if has_attitude and record.attitude is not None:
        turned = np.unwrap(record.attitude.values, axis=0)
        quaternions = from_rpy(Series(record.attitude.times, turned).at(positions.times))
    times = positions.times + record.start_time
    fresh = np.diff(np.round(times, 6), prepend=-np.inf) >= _LEAST_STEP / 2.0
    table = np.column_stack([positions.values, quaternions])[fresh]
    with path.open("w", encoding="utf-8") as stream:
        stream.write(_HEADER + "\n")
        for t, row in zip(times[fresh], table):
            stream.write(f"{t:.6f} " + " ".join(f"{value:.9f}" for value in row) + "\n")
