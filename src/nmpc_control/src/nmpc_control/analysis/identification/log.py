# SPDX-License-Identifier: MIT
"""What identification needs of one bag: commands, what followed, and who was flying."""

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Optional, Tuple

import numpy as np

from nmpc_control.analysis import recording as reading
from nmpc_control.analysis.messages import IMU_QUATERNION, SETPOINTS, text
from nmpc_control.analysis.other_topics import battery_percent
from nmpc_control.analysis.quaternions import rpy_of
from nmpc_control.analysis.record import Series
from nmpc_control.analysis.recording import Progress, Recording
from nmpc_control.analysis.source import is_hardware_in_the_loop
from nmpc_control.errors import BagError

SHORTEST = 3.0  # [s] of attitude and commands
SILENCE = 0.3  # [s] without a new sample: the stream is interrupted
_LONGEST = 4.0  # [h]
_PLAUSIBLE = {  # most that a column may be, in its unit: beyond is damage, not flight
    "mav_command": (200.0, 4.0, 4.0, 50.0),
    **dict.fromkeys(SETPOINTS, (200.0, 4.0, 4.0, 50.0)),
    "velocity": (100.0,) * 3,
    "attitude": (2.0,) * 4,
    "imu": (*(2.0,) * 4, *(100.0,) * 3, *(500.0,) * 3),
    "battery": (110.0,),
}


@dataclass(frozen=True)
class Log:
    """One bag. One clock, which starts with the bag; attitudes ENU to FLU, yaw unwrapped."""

    bag: str  # what it is called
    source: str  # "simulation", "hil" or "flight"
    commands: Series  # (n, 4) thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN: not given
    attitude: Series  # (n, 3) [rad] roll, pitch, yaw
    velocity: Optional[Series] = None  # (n, 3) [m/s] ENU
    imu: Optional[Series] = None  # (n, 10) as in messages.py
    battery: Optional[Series] = None  # (n, 1) [percent]
    rc: Optional[Series] = None  # (n, 6) raw axes
    flight_status: Optional[Series] = None  # (n, 1)
    status: Optional[Series] = None  # (n, 3) of this project's guard
    remarks: Tuple[str, ...] = ()


def read_log(
    path: Path,
    namespace: Optional[str] = None,
    progress: Optional[Progress] = None,
    name: Optional[str] = None,
) -> Log:
    """Return what a bag says for identification.

    Args:
        path: The bag.
        namespace: Vehicle to read; None for the best recorded one.
        progress: Wraps the messages to show how far reading is.
        name: What the bag is called; None: as its file.

    Raises:
        BagError: it cannot be read, or has no commands or attitudes of a few seconds together.
    """
    recording = reading.read(Path(path), namespace, progress)
    remarks = list(recording.remarks)
    rows = _plausible(recording.rows, remarks)
    commands, attitude = _commands(rows), _attitude(rows)
    duration = float(np.minimum(np.diff(attitude.times), SILENCE).sum())
    if duration > 3600.0 * _LONGEST:
        raise BagError(f"{duration / 3600.0:.1f} h of attitude, expected at most {_LONGEST:g} h")
    first = max(commands.times[0], attitude.times[0])
    last = min(commands.times[-1], attitude.times[-1])
    if last - first < SHORTEST:
        together = max(0.0, last - first)
        raise BagError(
            f"commands and attitude go together for {together:.1f} s, expected {SHORTEST:g} or more"
        )
    if "mav_command" in rows and "setpoint" not in rows:
        remarks.append("mav_msgs commands: their thrust.z is taken as percent")
    return Log(
        bag=text(name or Path(path).name),
        source=_source(recording, remarks),
        commands=commands,
        attitude=attitude,
        velocity=rows.get("velocity"),
        imu=rows.get("imu"),
        battery=battery_percent(rows.get("battery"), remarks),
        rc=rows.get("rc"),
        flight_status=rows.get("flight_status"),
        status=rows.get("status"),
        remarks=tuple(remarks),
    )


def _plausible(rows: Dict[str, Series], remarks: list) -> Dict[str, Series]:
    """Return the rows without samples that no aircraft can have; NaN says that nothing is said."""
    kept = {}
    for role, series in rows.items():
        bounds = np.array(_PLAUSIBLE.get(role, (np.inf,) * series.values.shape[1]))
        wild = (np.abs(series.values) > bounds).any(axis=1)
        if wild.any():
            remarks.append(f"{role}: {wild.sum()} samples are not plausible: left out")
        if not wild.all():
            kept[role] = Series(series.times[~wild], series.values[~wild])
    return kept


def _commands(rows: Dict[str, Series]) -> Series:
    """Return the stream of commands, the newest of any topic in effect."""
    roles = ("mav_command",) if "mav_command" in rows else SETPOINTS
    found = [rows[role] for role in roles if role in rows and len(rows[role])]
    if not found:
        raise BagError(
            "no commands: expected a dji_sdk/flight_control_setpoint_* topic (sensor_msgs/Joy) or "
            "mav_msgs/RollPitchYawrateThrust"
        )
    times = np.concatenate([series.times for series in found])
    return Series(times, np.concatenate([series.values for series in found]))


def _attitude(rows: Dict[str, Series]) -> Series:
    source = next((rows[role] for role in ("attitude", "imu") if role in rows), None)
    if source is None:
        raise BagError("no attitude: expected dji_sdk/attitude or dji_sdk/imu")
    angles = rpy_of(source.values[:, IMU_QUATERNION])
    is_finite = np.isfinite(angles).all(axis=1)
    if not is_finite.any():
        raise BagError("no attitude: all quaternions have length zero")
    angles = angles[is_finite]
    angles[:, 2] = np.unwrap(angles[:, 2])
    return Series(source.times[is_finite], angles)


def _source(recording: Recording, remarks: list) -> str:
    if recording.selection.is_simulation:
        return "simulation"
    verdict = is_hardware_in_the_loop(recording.rows["imu"]) if "imu" in recording.rows else None
    if verdict is None:
        remarks.append("no imu data in motion: hardware in the loop cannot be told from a flight")
    return "hil" if verdict else "flight"
