# SPDX-License-Identifier: MIT
"""How the flight controller's own tasks fly: take-off, landing, return home (doc 3.5)."""

import math
from typing import Tuple

from uav_sim.flight_loops import FlightLoops
from uav_sim.plant import Plant, Vector

HOME_RADIUS = 0.5  # [m]

Command = Tuple[float, float, float, float]  # roll, pitch [rad], thrust [percent], yaw rate [rad/s]


class AutoFlight:
    """Commands of the tasks; ``has_position`` says whether there is a GPS position to hold."""

    def __init__(self, plant: Plant, loops: FlightLoops) -> None:
        self._plant = plant
        self._loops = loops
        self._settings = plant.preset.flight_controller

    def take_off(self, z: float, has_position: bool) -> Command:
        """Return the command that climbs to a height [m] of the world."""
        percent = self._loops.height(z, self._settings.takeoff_speed)
        return (*self._hold_or_level(has_position), percent, 0.0)

    def descend(self, height: float, has_position: bool) -> Command:
        """Return the command that sinks, slower near the take-off height."""
        settings = self._settings
        speed = height / settings.descent_time_constant
        speed = min(max(speed, settings.landing_speed), settings.descent_speed)
        return (*self._hold_or_level(has_position), self._loops.climb(-speed), 0.0)

    def is_home(self, home: Vector) -> bool:
        """Whether the aircraft is above its take-off spot (3,) [m]."""
        x, y, _ = self._plant.position
        return math.hypot(x - home[0], y - home[1]) < HOME_RADIUS

    def go_home(self, home: Vector) -> Command:
        """Return the command that climbs to a safe height, then flies home level."""
        settings, loops = self._settings, self._loops
        height = home[2] + settings.go_home_height
        if self._plant.position[2] < height - 1.0:
            percent = loops.height(height, settings.limits.vertical_velocity)
            return (*loops.hold(), percent, 0.0)
        percent = loops.hold_height()
        tilt = loops.position(*home[:2], speed=settings.limits.horizontal_velocity)
        return (*tilt, percent, 0.0)

    def _hold_or_level(self, has_position: bool) -> Tuple[float, float]:
        return self._loops.hold() if has_position else (0.0, 0.0)
