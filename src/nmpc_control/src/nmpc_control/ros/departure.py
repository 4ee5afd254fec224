# SPDX-License-Identifier: MIT
"""How the guard ends in the air: it goes on holding until authority is given back, then stops."""

import threading
import time
from typing import Any, Optional

import rospy

from nmpc_control.ros.dji_services import DjiServices

PATIENCE = 12.0  # [s] wall time for authority to be given back; roslaunch gives 15 before SIGTERM
BRAKE_FIRST = 0.1  # [s] wall time: some setpoints that brake have left by then
PAUSE = 0.5  # [s] between attempts
STANDSTILL = 1.0  # [s] wall time in which a tick must come


class Departure:
    """Gives authority back in a thread of its own, while the stream goes on."""

    def __init__(self, services: DjiServices) -> None:
        self._services = services
        self._begun: Optional[float] = None
        self._done = threading.Event()
        self._ended = threading.Event()

    @property
    def is_due(self) -> bool:
        """Whether the guard was told to end."""
        return self._begun is not None

    @property
    def is_over(self) -> bool:
        """Whether authority is given back, or was asked back for long enough."""
        return self._done.is_set() or (self.is_due and time.monotonic() > self._begun + PATIENCE)

    def on_signal(self, *_: Any) -> None:
        """End as described; told so a second time, at once."""
        if self.is_due:
            self._done.set()
            raise KeyboardInterrupt
        self.begin()

    def begin(self) -> None:
        """Begin to give authority back, once."""
        if not self.is_due:
            self._begun = time.monotonic()
            threading.Thread(target=self._give_back, name="departure", daemon=True).start()

    def end(self) -> None:
        """Note that the stream has stopped."""
        self._ended.set()

    def on_shutdown(self) -> None:
        """Hold up the end of ROS until the stream has ended as it should."""
        self.begin()
        self._done.wait(PATIENCE)
        self._ended.wait(PAUSE)

    def _give_back(self) -> None:
        time.sleep(BRAKE_FIRST)
        try:
            while self._services.may_hold_authority and not self.is_over:
                _, sentence = self._services.release_now()
                rospy.logwarn(f"shutting down: {sentence}")
                if self._services.may_hold_authority:
                    time.sleep(PAUSE)
        finally:
            self._done.set()
        if not self._ended.wait(STANDSTILL):  # simulated time has ended: so would no tick
            rospy.signal_shutdown("flight_guard ends")
