# SPDX-License-Identifier: MIT
"""Telling a real flight from DJI's hardware-in-the-loop simulator, with the aircraft on a desk."""

from typing import Optional

import numpy as np

from nmpc_control.analysis.messages import IMU_ACCELERATION, IMU_QUATERNION, IMU_RATES
from nmpc_control.analysis.quaternions import tilt_of
from nmpc_control.analysis.record import Series

_MOVING_TILT = 0.1  # [rad] attitude moved at least this much, or nothing can be told
_GYRO_SHARE = (
    0.1  # a gyro that shows less than this share of the attitude's own rate contradicts it
)
_STILL_ACCELERATION = 0.1  # [m/s^2] deviation below this in flight means that nothing vibrates


def is_hardware_in_the_loop(imu: Series) -> Optional[bool]:
    """Return whether gyro or accelerometer contradict the attitude that the same messages show.

    Args:
        imu: Rows of ``dji_sdk/imu`` (n, 10): quaternion, rates [rad/s], specific force [m/s^2].

    Returns:
        None where the aircraft hardly tilted, so that nothing can be told.
    """
    tilt = tilt_of(imu.values[:, IMU_QUATERNION])
    if len(imu) < 10 or tilt.max() < _MOVING_TILT:
        return None
    shown = _attitude_rate(imu.times, imu.values[:, IMU_QUATERNION])
    measured = np.linalg.norm(imu.values[:, IMU_RATES], axis=1)[1:]
    is_turning = shown > np.percentile(shown, 90)
    gyro_contradicts = np.median(measured[is_turning]) < _GYRO_SHARE * np.median(shown[is_turning])
    acceleration_contradicts = (
        imu.values[:, IMU_ACCELERATION].std(axis=0).max() < _STILL_ACCELERATION
    )
    return bool(gyro_contradicts or acceleration_contradicts)


def _attitude_rate(times: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """Return the rate of turn (n - 1,) [rad/s] between successive attitudes (n, 4)."""
    cosine = np.abs(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
    return 2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)) / np.maximum(np.diff(times), 1e-3)
