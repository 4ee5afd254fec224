# SPDX-License-Identifier: MIT
"""Where the aircraft was at the time of each beam."""

from collections import deque
from typing import Deque, NamedTuple, Optional, Sequence

import numpy as np

from nmpc_control.estimator import Estimator
from nmpc_control.laser_tracking.parameters import PoseParameters

_KEPT = 200  # [1] two seconds of attitude at 100 Hz
_JUMP = 1.0  # [m] off dead reckoning: the origin of positions is another one now
_TURN = 0.3  # [rad] the same for angles
_LOOK_AHEAD = 0.01  # [s] over which the estimator's extrapolation tells its rates


class _Pose(NamedTuple):
    t: float  # [s]
    pose: np.ndarray  # (6,) position [m], roll, pitch, yaw [rad]
    rates: np.ndarray  # (6,) of these [1/s]


class PoseHistory:
    """The estimator's states at the stamps of attitude, and between them, with less noise.

    From stamp to stamp velocity and body rates carry the pose on, and each sample corrects it by a
    share: noise of an attitude, 10 m away from the aircraft, and of a position would look like
    motion of what is seen. Where the telemetry's position wanders meanwhile, ``shift`` tells it.
    """

    def __init__(self, parameters: PoseParameters) -> None:
        self.estimator = Estimator()
        self._parameters = parameters
        self._poses: Deque[_Pose] = deque(maxlen=_KEPT)
        self.shift = np.zeros(3)  # [m] from the positions of ``at`` to those of the telemetry
        times = (parameters.position_time, parameters.attitude_time)
        self._times = np.repeat(times, 3)  # (6,) [s]

    def add_attitude(self, t: float, quaternion: Sequence[float]) -> bool:
        """Take a quaternion (x, y, z, w), body FLU to world ENU, of ``t`` [s]; False if refused.

        Position, velocity and body rates go to ``estimator`` itself.
        """
        if not self.estimator.add_attitude(t, quaternion):
            return False
        told, ahead = self.estimator.estimate(t), self.estimator.estimate(t + _LOOK_AHEAD)
        if told is None or told.age > self._parameters.max_age:
            return True
        pose = told.vector[:6]
        rates = (ahead.vector[:6] - pose) / _LOOK_AHEAD
        shift = np.zeros(3)
        if self._poses:
            last = self._poses[-1]
            expected = last.pose + 0.5 * (t - last.t) * (last.rates + rates)
            off = pose - expected
            is_near = np.abs(off[:3]).max() < _JUMP and np.abs(off[3:]).max() < _TURN
            if is_near and t - last.t <= self._parameters.max_age:
                pose = expected + np.minimum(1.0, (t - last.t) / self._times) * off
                share = min(1.0, (t - last.t) / self._parameters.frame_time)
                shift = self.shift + share * (told.vector[:3] - pose[:3] - self.shift)
        self.shift = shift
        self._poses.append(_Pose(t, pose, rates))
        return True

    def forget(self) -> None:
        """Drop everything, as after a jump of the clock."""
        self.estimator.forget()
        self._poses.clear()
        self.shift = np.zeros(3)

    def at(self, times: np.ndarray) -> Optional[np.ndarray]:
        """Return position [m], roll, pitch, yaw [rad] (n, 6) at times (n,) [s]; None if not known.

        Beyond the newest telemetry velocity and body rates carry on, no longer than ``max_age``.
        """
        stamps = np.asarray(times) + self._parameters.delay  # the telemetry that shows that time
        first, last = float(stamps.min()), float(stamps.max())
        known, longest = list(self._poses), self._parameters.max_age
        if not known or first < known[0].t:
            return None
        newest = known[-1]
        if last > newest.t:
            age = max(self.estimator.age(name, last) for name in ("position", "velocity"))
            if max(age, last - newest.t) > longest:
                return None
            pose = newest.pose + (last - newest.t) * newest.rates
            known.append(_Pose(last, pose, newest.rates))
        knots = np.array([p.t for p in known])
        begin = max(0, int(np.searchsorted(knots, first, "right")) - 1)
        if np.diff(knots[begin:]).max(initial=0.0) > longest:
            return None
        poses = np.array([p.pose for p in known[begin:]])
        return np.stack([np.interp(stamps, knots[begin:], column) for column in poses.T], axis=1)
