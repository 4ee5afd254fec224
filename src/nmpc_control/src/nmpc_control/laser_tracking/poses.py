# SPDX-License-Identifier: MIT
"""Where the aircraft was at the time of each beam."""

from collections import deque
from typing import Deque, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.estimator import Estimator
from nmpc_control.laser_tracking.parameters import PoseParameters

_KEPT = 200  # [1] two seconds of attitude at 100 Hz


class PoseHistory:
    """The estimator's states at the stamps of attitude, and between them."""

    def __init__(self, parameters: PoseParameters) -> None:
        self.estimator = Estimator()
        self._parameters = parameters
        self._states: Deque[Tuple[float, np.ndarray]] = deque(maxlen=_KEPT)

    def add_attitude(self, t: float, quaternion: Sequence[float]) -> bool:
        """Take a quaternion (x, y, z, w), body FLU to world ENU, of ``t`` [s]; False if refused."""
        if not self.estimator.add_attitude(t, quaternion):
            return False
        estimate = self.estimator.estimate(t)
        if estimate is not None and estimate.age <= self._parameters.max_age:
            self._states.append((t, estimate.vector[:6]))
        return True

    def forget(self) -> None:
        """Drop everything, as after a jump of the clock."""
        self.estimator.forget()
        self._states.clear()

    def at(self, times: np.ndarray) -> Optional[np.ndarray]:
        """Return position [m], roll, pitch, yaw [rad] (n, 6) at times (n,) [s]; None if not known.

        Beyond the newest telemetry velocity and body rates carry on, no longer than ``max_age``.
        """
        stamps = np.asarray(times) + self._parameters.delay  # the telemetry that shows that time
        first, last = float(stamps.min()), float(stamps.max())
        states = list(self._states)
        if not states or first < states[0][0]:
            return None
        if last > states[-1][0]:
            estimate = self.estimator.estimate(last)
            if estimate is None or estimate.age > self._parameters.max_age:
                return None
            states.append((last, estimate.vector[:6]))
        knots = np.array([t for t, _ in states])
        values = np.array([vector for _, vector in states])
        gap = np.searchsorted(knots, first, "right") - 1
        if np.diff(knots[gap:]).max(initial=0.0) > self._parameters.max_age:
            return None
        return np.stack([np.interp(stamps, knots, values[:, k]) for k in range(6)], axis=1)
