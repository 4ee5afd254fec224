# SPDX-License-Identifier: MIT
"""The flight controller's own loops: position over velocity over tilt, height over thrust, heading.

DJI publishes neither structure nor gains: cascaded loops with an integral on velocity are an
assumption, the gains are in ``common.yaml``.
"""

import math
from typing import Optional, Tuple

from uav_sim.plant import Plant, limit_norm

# [m/s] integrals rest while the velocity error is larger, as when braking from a fast flight; a
# steady wind of 14 m/s stays within it
INTEGRATION_BAND = 3.0


def _clamp(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)


class FlightLoops:
    """Turns wanted velocities, positions and headings into attitude and thrust commands of a plant.

    Each axis is to be asked once per step, because integrals advance with it.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        preset = plant.preset
        self._gains = preset.flight_controller.loops
        self._limits = preset.flight_controller.limits
        self._step = preset.step
        self._gravity, self._tilt_limit = preset.gravity, preset.tilt_limit
        self.start()

    def start(self, vertical_trim: float = 0.0) -> None:
        """Begin a flight, with an integral of the vertical loop [m/s^2]."""
        self._trim = (0.0, 0.0, vertical_trim)
        self.release_position()
        self.release_height()

    def release_position(self) -> None:
        """Let go of the held position, so that the next hold brakes and takes a new one."""
        self._anchor: Optional[Tuple[float, float]] = None

    def take_height(self, z: float) -> None:
        """Hold this height [m] from now on."""
        self._height_anchor = z

    def release_height(self) -> None:
        """Let go of the held height, so that the next hold brakes and takes a new one."""
        self._height_anchor: Optional[float] = None

    def velocity(self, vx: float, vy: float, resist_wind: bool = True) -> Tuple[float, float]:
        """Return roll and pitch [rad] for a horizontal velocity [m/s] in the world frame."""
        plant, gains = self._plant, self._gains
        error_x, error_y = vx - plant.velocity[0], vy - plant.velocity[1]
        ax, ay = gains.velocity * error_x, gains.velocity * error_y
        if resist_wind:
            near = math.hypot(error_x, error_y) < INTEGRATION_BAND
            gain = gains.integral * self._step if near else 0.0
            trim = limit_norm(
                self._trim[0] + gain * error_x, self._trim[1] + gain * error_y, gains.trim_limit
            )
            self._trim = (trim[0], trim[1], self._trim[2])
            ax, ay = ax + trim[0], ay + trim[1]
        cos_yaw, sin_yaw = math.cos(plant.yaw), math.sin(plant.yaw)
        pitch = math.atan2(cos_yaw * ax + sin_yaw * ay, self._gravity)
        roll = math.atan2(sin_yaw * ax - cos_yaw * ay, self._gravity)
        return limit_norm(roll, pitch, self._tilt_limit)

    def position(self, x: float, y: float, speed: float) -> Tuple[float, float]:
        """Return roll and pitch [rad] towards a position [m], at most at ``speed`` [m/s]."""
        here, gain = self._plant.position, self._gains.position
        return self.velocity(*limit_norm(gain * (x - here[0]), gain * (y - here[1]), speed))

    def hold(self) -> Tuple[float, float]:
        """Return roll and pitch [rad] that brake, then hold the position where that ended."""
        position, velocity = self._plant.position, self._plant.velocity
        if self._anchor is None:
            if math.hypot(velocity[0], velocity[1]) > self._gains.anchor_speed:
                return self.velocity(0.0, 0.0)
            self._anchor = (position[0], position[1])
        return self.position(*self._anchor, speed=self._limits.horizontal_velocity)

    def climb(self, vz: float) -> float:
        """Return the thrust [percent] for a vertical velocity [m/s], tilt compensated."""
        plant, gains = self._plant, self._gains
        error = vz - plant.velocity[2]
        gain = gains.vertical_integral * self._step if abs(error) < INTEGRATION_BAND else 0.0
        trim = _clamp(self._trim[2] + gain * error, gains.trim_limit)
        self._trim = (self._trim[0], self._trim[1], trim)
        roll, pitch, _ = plant.rpy
        lift = self._gravity + gains.vertical_velocity * error + trim
        percent = plant.preset.thrust.percent(lift / (math.cos(roll) * math.cos(pitch)))
        return min(max(percent, self._limits.thrust_min), self._limits.thrust_max)

    def height(self, z: float, speed: float) -> float:
        """Return the thrust [percent] towards a height [m], not faster than ``speed`` [m/s]."""
        return self.climb(_clamp(self._gains.height * (z - self._plant.position[2]), speed))

    def hold_height(self) -> float:
        """Return the thrust [percent] that brakes, then holds the height where that ended."""
        if self._height_anchor is None:
            if abs(self._plant.velocity[2]) > self._gains.anchor_speed:
                return self.climb(0.0)
            self._height_anchor = self._plant.position[2]
        return self.height(self._height_anchor, self._limits.vertical_velocity)

    def turn_to(self, yaw: float) -> float:
        """Return the yaw rate [rad/s] towards a yaw [rad]."""
        error = math.remainder(yaw - self._plant.yaw, 2.0 * math.pi)
        return _clamp(self._gains.yaw * error, self._limits.yaw_rate)
