# SPDX-License-Identifier: MIT
"""Steps of simulated time on the wall clock, without drift, at a speed that may change."""

import time
from typing import Callable

# [s] of simulated time that is caught up in one burst; the rest stays lost, or subscribers would
# see a clock that runs ahead of the telemetry still in their sockets
MAX_LAG = 0.03
TURN = 0.005  # [s] of wall time after which other threads get a turn where nothing is waited for


class Pacer:
    """Says when the next step is due, counted from the first, so that lateness is caught up."""

    def __init__(
        self,
        step: float,
        speed_factor: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.lost = 0.0  # [s] of wall time given up because the machine was too slow
        self._step = step
        self._clock = clock
        self._sleep = sleep
        self.restart(speed_factor)

    def restart(self, speed_factor: float) -> None:
        """Count anew from now on, in simulated seconds per second; 0: as fast as possible."""
        self.speed_factor = speed_factor
        self._period = self._step / speed_factor if speed_factor > 0.0 else 0.0
        self._max_lag = MAX_LAG / speed_factor if speed_factor > 0.0 else 0.0
        self._epoch = self._clock()
        self._steps = 0

    def wait(self) -> None:
        """Return when the next step is due; at once with speed factor 0."""
        if self._period == 0.0:
            now = self._clock()
            if now - self._epoch >= TURN:
                self._epoch = now
                self._sleep(0.0)
            return
        self._steps += 1
        remaining = self._epoch + self._steps * self._period - self._clock()
        if remaining > 0.0:
            self._sleep(remaining)
        elif remaining < -self._max_lag:
            self._epoch -= remaining
            self.lost -= remaining
