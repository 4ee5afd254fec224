# SPDX-License-Identifier: MIT
"""Whether simulated time passes: running, paused, or for a counted number of steps."""

from threading import Condition


class Gate:
    """The simulating thread asks it before every step; any other thread may pause and step."""

    def __init__(self, paused: bool = False) -> None:
        self._change = Condition()
        self._paused = paused
        self._stands = False  # the simulating thread has seen that it is paused
        self._wanted = 0  # steps still to take while paused

    @property
    def paused(self) -> bool:
        """Time stands still but for counted steps."""
        return self._paused

    def pause(self, paused: bool, timeout: float = 0.0) -> None:
        """Stop simulated time, waiting for at most a wall time [s], or let it pass again."""
        with self._change:
            self._paused = paused
            self._wanted = 0
            self._change.notify_all()
            self._change.wait_for(lambda: self._stands or not self._paused, timeout)

    def take(self) -> bool:
        """Return whether a step may be taken; for the simulator."""
        return not self._paused or self._wanted > 0

    def taken(self) -> None:
        """Count a step that has been taken; for the simulator."""
        if self._wanted:
            with self._change:
                self._wanted = max(0, self._wanted - 1)
                self._change.notify_all()

    def stand(self, timeout: float) -> None:
        """Wait until a step may be taken, or for a wall time [s]; for the simulator."""
        with self._change:
            self._stands = True
            self._change.notify_all()
            self._change.wait_for(self.take, timeout)
            self._stands = False

    def step(self, steps: int, timeout: float) -> bool:
        """Have steps taken while paused; return whether they were within a wall time [s]."""
        with self._change:
            if not self._change.wait_for(lambda: self._stands or not self._paused, timeout):
                return False
            if not self._paused:
                return False
            self._wanted += steps
            self._change.notify_all()
            return self._change.wait_for(lambda: self._wanted == 0, timeout) and self._paused
