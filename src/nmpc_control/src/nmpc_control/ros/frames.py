# SPDX-License-Identifier: MIT
"""Where frames of messages stand in the world frame, by tf2.

/tf is heard only from the first message on that is in another frame: its 100 Hz and more would
cost every process that asks for nothing.
"""

import time
from typing import Optional, Tuple

import numpy as np
import rospy
import tf2_ros

from nmpc_control.errors import NmpcError

AHEAD = 0.2  # [s] by which a stamp may be newer than the newest transform, which then serves
WARM_UP = 1.0  # [s] of wall time in which transforms come after /tf was subscribed

Place = Tuple[np.ndarray, np.ndarray]  # (3, 3) rotation to the world frame, (3,) [m] its origin


class FrameError(NmpcError):
    """A frame is not known at a time; the text says why."""


class Frames:
    """Looks frames up and waits for nothing."""

    def __init__(self, world: str) -> None:
        self.world = world.lstrip("/")
        self._buffer: Optional[tf2_ros.Buffer] = None
        self._since = 0.0  # [s] wall time

    @property
    def is_new(self) -> bool:
        """Whether /tf was subscribed so recently that a missing transform says nothing."""
        return self._buffer is not None and time.monotonic() - self._since < WARM_UP

    def is_world(self, frame_id: str) -> bool:
        """Return whether a frame is the world frame, with or without ROS 1's leading slash."""
        return frame_id.lstrip("/") == self.world

    def place(self, frame_id: str, t: float) -> Place:
        """Return where a frame is at ``t`` [s], 0 being the newest that is known.

        Raises:
            FrameError: not connected to the world frame, or not known at that time.
        """
        frame = frame_id.lstrip("/")
        if not frame:
            raise FrameError("the message names no frame")
        if self._buffer is None:
            self._buffer, self._since = tf2_ros.Buffer(debug=False), time.monotonic()
            self._listener = tf2_ros.TransformListener(self._buffer)
        try:
            try:
                found = self._look_up(frame, rospy.Time.from_sec(t))
            except tf2_ros.ExtrapolationException:
                newest = self._buffer.get_latest_common_time(self.world, frame)
                if not 0.0 < t - newest.to_sec() <= AHEAD:
                    raise
                found = self._look_up(frame, newest)
        except tf2_ros.TransformException as error:
            raise FrameError(f"frame {frame!r}: {error}".splitlines()[0]) from None
        r, q = found.transform.translation, found.transform.rotation
        numbers = np.array([r.x, r.y, r.z, q.x, q.y, q.z, q.w])
        if not np.isfinite(numbers).all() or abs(np.linalg.norm(numbers[3:]) - 1.0) > 0.05:
            raise FrameError(f"frame {frame!r}: its transform is not finite or not a rotation")
        return rotation(*(numbers[3:] / np.linalg.norm(numbers[3:]))), numbers[:3]

    def _look_up(self, frame: str, stamp: rospy.Time) -> object:
        return self._buffer.lookup_transform(self.world, frame, stamp, rospy.Duration(0))


def rotation(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the rotation matrix (3, 3) of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
