# SPDX-License-Identifier: MIT
"""/diagnostics once a second, from within a control loop.

``diagnostic_updater`` asks the master for its period in ``update``: with a master that is dead that
raises, with one out of reach it blocks. Here nobody is asked.
"""

from typing import Callable

import diagnostic_updater
import rospy

Wrapper = diagnostic_updater.DiagnosticStatusWrapper
PERIOD = 1.0  # [s]


class Diagnostics:
    """The entries of one node."""

    def __init__(self, hardware: str) -> None:
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID(hardware)
        self._told = rospy.Time(0)

    def add(self, name: str, diagnose: Callable[[Wrapper], Wrapper]) -> None:
        """Have another entry."""
        self._updater.add(name, diagnose)

    def update(self) -> None:
        """Publish all entries where the last time was a second ago."""
        now = rospy.Time.now()
        if not 0.0 <= (now - self._told).to_sec() < PERIOD:
            self._told = now
            self._updater.force_update()
