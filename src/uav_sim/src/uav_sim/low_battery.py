# SPDX-License-Identifier: MIT
"""What the flight controller does by itself when the battery runs low."""

from typing import Optional, Tuple

from uav_sim.phase import Phase
from uav_sim.preset import FlightController


class LowBattery:
    """DJI's two thresholds: fly home, which the pilot may end, and land, which nobody may.

    ``percent`` is the state of charge, ``is_low`` whether that is below a threshold.
    """

    def __init__(self, settings: FlightController) -> None:
        self._home, self._land = settings.battery_go_home, settings.battery_land
        self.take(100.0)
        self._sent_home = False

    def start(self) -> None:
        """Begin a flight."""
        self._sent_home = False

    def take(self, percent: float) -> None:
        """Take a new state of charge [percent]."""
        self.percent = percent
        self.is_low = percent <= self._home or percent <= self._land

    @property
    def lands(self) -> bool:
        """Whether the charge is below the threshold for landing."""
        return self.percent <= self._land

    def demand(self, phase: Phase, has_position: bool) -> Optional[Tuple[Phase, str]]:
        """Return what a low battery begins instead of a phase, and the reason; None: nothing."""
        if self.lands:
            if phase not in (Phase.FLYING, Phase.GOING_HOME):
                return None
            return Phase.LANDING, f"battery at {self.percent:.0f} %: landing, whoever is in control"
        if phase is not Phase.FLYING or not has_position or self._sent_home:
            return None
        self._sent_home = True
        return Phase.GOING_HOME, f"battery at {self.percent:.0f} %: flying home"
