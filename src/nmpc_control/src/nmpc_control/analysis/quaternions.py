# SPDX-License-Identifier: MIT
"""Quaternions (n, 4) x, y, z, w, body FLU to world ENU, many at a time; zero length gives NaN."""

import numpy as np


def unit(quaternions: np.ndarray) -> np.ndarray:
    """Return the quaternions at length 1."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return quaternions / np.where(length > 0.5, length, np.nan)


def to_world(quaternions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return body vectors (n, 3) in world axes."""
    q = unit(quaternions)
    axis, w = q[:, :3], q[:, 3:]
    twice = 2.0 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)


def rpy_of(quaternions: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (n, 3) [rad]."""
    x, y, z, w = unit(quaternions).T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


def tilt_of(quaternions: np.ndarray) -> np.ndarray:
    """Return the angle (n,) [rad] between the body's z axis and the vertical."""
    x, y, _, _ = unit(quaternions).T
    return np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))


def from_rpy(angles: np.ndarray) -> np.ndarray:
    """Return the quaternions (n, 4) of roll, pitch, yaw (n, 3) [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles.T / 2.0), np.cos(angles.T / 2.0)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=1,
    )
