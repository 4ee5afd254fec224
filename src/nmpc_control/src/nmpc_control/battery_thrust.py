# SPDX-License-Identifier: MIT
"""What the battery's charge leaves of the thrust: the prior that flights are begun with.

The same command gives less thrust as the voltage falls. A curve of the vehicle says by how much for
a reported charge, and the guard commands the more; thrust in m/s^2 keeps its meaning everywhere
else, so that ``disturbance_estimate`` learns from the vertical acceleration only what the curve
gets wrong. The curve needs no time to learn: it is what a start in the air begins with, where the
estimate knows nothing yet.
"""

from dataclasses import dataclass, field
from typing import Optional

import numpy as np

from nmpc_control.errors import ConfigError

LEAST, MOST = 0.7, 1.15  # [1] whatever curve and battery say
RATE = 0.01  # [1/s] by which it moves in flight; a battery that leaps is made up for more slowly


@dataclass(frozen=True)
class BatteryCurve:
    """Thrust for a command by that at the charge where the thrust map was measured."""

    charge: np.ndarray = field(metadata={"min": 0.0, "max": 1.0})  # (n,) [1] increasing
    gain: np.ndarray = field(metadata={"min": LEAST, "max": MOST})  # (n,) [1]

    def __post_init__(self) -> None:
        if len(self.charge) < 2 or np.any(np.diff(self.charge) <= 0.0):
            raise ConfigError("battery", "charge", list(self.charge), "two or more, increasing")
        if len(self.gain) != len(self.charge):
            raise ConfigError("battery", "gain", list(self.gain), "one for each charge")

    def at(self, charge: float) -> float:
        """Return the gain [1] at a charge [1]; beyond the curve that of its end."""
        return float(np.interp(charge, self.charge, self.gain))


class BatteryThrust:
    """The gain in force, of the newest charge that was heard of."""

    def __init__(self, curve: Optional[BatteryCurve]) -> None:
        """Begin with a gain of 1, where it stays without a curve."""
        self.gain = 1.0
        self._curve = curve

    def update(self, charge: float, dt: float, in_force: bool) -> None:
        """Take the present charge.

        Args:
            charge: [1] reported state of charge; not finite or out of range: the gain stays.
            dt: [s] since the last call.
            in_force: whether thrust is commanded with it, so that it must not jump. On the ground
                and while a pilot flies it follows at once, and so begins anew.
        """
        if self._curve is None or not 0.0 <= charge <= 1.0:
            return
        wanted, step = min(max(self._curve.at(charge), LEAST), MOST), RATE * dt
        change = wanted - self.gain
        self.gain += min(max(change, -step), step) if in_force else change
