# SPDX-License-Identifier: MIT
"""A clock that was set back: rospy tells of it in simulated time only, not on a computer's own."""

import math

STEP = 0.1  # [s] back from which on it is a jump; less is waited out


class ClockSteps:
    """Remembers the last reading."""

    def __init__(self) -> None:
        self._last = -math.inf

    def went_back(self, t: float) -> bool:
        """Return whether the clock, which reads ``t`` [s] now, has jumped back since last asked."""
        jumped = t < self._last - STEP
        self._last = t if jumped else max(t, self._last)
        return jumped
