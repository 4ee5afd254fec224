# SPDX-License-Identifier: MIT
"""What a bag says of commands and of the motion that followed."""

from pathlib import Path
from typing import NamedTuple, Optional, Tuple

import numpy as np

from nmpc_control.analysis import recording as reading
from nmpc_control.analysis.quaternions import rpy_of
from nmpc_control.analysis.record import Series
from nmpc_control.analysis.recording import Progress, Recording
from nmpc_control.analysis.source import is_hardware_in_the_loop
from nmpc_control.errors import BagError

THRUST, ROLL, PITCH, YAW_RATE = range(4)  # columns of commands


class Recorded(NamedTuple):
    """Commands and motion of one vehicle; times in s since the bag's first message, on receipt."""

    commands: Series  # (n, 4) thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN: not given
    attitude: Series  # (m, 3) roll, pitch, yaw [rad]; yaw is not wrapped
    velocity: Series  # (k, 3) [m/s] world ENU
    flight_status: Optional[Series]  # (j, 1) of the M100's enumeration
    source: str  # "simulation", "hil", "flight", or "unknown"
    remarks: Tuple[str, ...] = ()  # what was left out or taken for granted


def read_recorded(
    path: Path, namespace: Optional[str] = None, progress: Optional[Progress] = None
) -> Recorded:
    """Return commands and motion in a ROS 1 bag.

    Args:
        path: the bag.
        namespace: vehicle to read; None for the best recorded one.
        progress: wraps the messages to show how far reading is.

    Raises:
        BagError: it cannot be read, or lacks commands of thrust and angles, attitude or velocity.
    """
    recording = reading.read(path, namespace, progress)
    rows, remarks = recording.rows, list(recording.remarks)
    commands = rows.get("setpoint") or rows.get("mav_command")
    if commands is None:
        raise BagError(
            "no commands (expected dji_sdk/flight_control_setpoint_generic,"
            " or a topic of type mav_msgs/RollPitchYawrateThrust)"
        )
    if not np.isfinite(commands.values[:, : PITCH + 1]).all(axis=1).any():
        raise BagError("no command of roll, pitch and thrust (flag 0x2B or 0x2A)")
    quaternions = rows.get("attitude") or rows.get("imu")
    if quaternions is None:
        raise BagError("no attitude (expected dji_sdk/attitude or dji_sdk/imu)")
    if "velocity" not in rows:
        raise BagError("no velocity (expected dji_sdk/velocity)")
    if "setpoint" not in rows:
        remarks.append("commands are of mav_msgs: their thrust is taken as percent")
    return Recorded(
        commands,
        _attitude(quaternions),
        rows["velocity"],
        rows.get("flight_status"),
        _source(recording),
        tuple(remarks),
    )


def _attitude(quaternions: Series) -> Series:
    rpy = rpy_of(quaternions.values[:, :4])
    finite = np.isfinite(rpy).all(axis=1)
    if not finite.any():
        raise BagError("no attitude that is a rotation")
    rpy = rpy[finite]
    rpy[:, 2] = np.unwrap(rpy[:, 2])
    return Series(quaternions.times[finite], rpy)


def _source(recording: Recording) -> str:
    if recording.selection.is_simulation:
        return "simulation"
    verdict = is_hardware_in_the_loop(recording.rows["imu"]) if "imu" in recording.rows else None
    return {True: "hil", False: "flight", None: "unknown"}[verdict]
