# SPDX-License-Identifier: MIT
"""The pilot's remote control as dji_sdk shows it (doc/dji_sdk.md 2.4); in F, sticks centred."""

from dataclasses import dataclass
from typing import Tuple

from uav_sim.preset import RcValues

STICK_DEADBAND = 0.02  # [1]
CORNER = 0.8  # [1] a stick is in a corner when both of its axes are beyond this


@dataclass
class RemoteControl:
    """Sticks in -1..1 in the transmitter's own sense, and two switches; change them at any time."""

    roll: float = 0.0  # right positive
    pitch: float = 0.0  # forward positive
    yaw: float = 0.0  # right, clockwise positive
    throttle: float = 0.0  # up positive
    mode: str = "F"  # P, A or F
    gear: str = "up"  # up or down
    connected: bool = True

    @property
    def allows_sdk(self) -> bool:
        """The switch is in F and the link stands."""
        return self.connected and self.mode == "F"

    @property
    def starts_motors(self) -> bool:
        """Both sticks are held in a lower corner, the pilot's command to start the motors."""
        sideways = min(abs(self.roll), abs(self.yaw))
        down = -max(self.pitch, self.throttle)
        return self.connected and min(sideways, down) > CORNER

    def axes(self, values: RcValues) -> Tuple[float, ...]:
        """Return the six axes of the ``rc`` topic; the gear axis of a dead link is 0."""
        gear = getattr(values, f"gear_{self.gear}") if self.connected else 0.0
        return (self.roll, self.pitch, self.yaw, self.throttle, getattr(values, self.mode), gear)

    def sticks(self) -> Tuple[float, float, float, float]:
        """Return roll, pitch, yaw, throttle as flown: 0 within the dead band and without link."""
        if not self.connected:
            return 0.0, 0.0, 0.0, 0.0
        sticks = (self.roll, self.pitch, self.yaw, self.throttle)
        return tuple(0.0 if abs(v) < STICK_DEADBAND else v for v in sticks)
