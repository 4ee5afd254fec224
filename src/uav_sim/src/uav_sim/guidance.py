# SPDX-License-Identifier: MIT
"""From setpoints and sticks to attitude, thrust and yaw rate commands of the plant."""

import math
from typing import Optional, Tuple

from uav_sim.flight_loops import FlightLoops
from uav_sim.plant import Plant
from uav_sim.remote_control import RemoteControl
from uav_sim.setpoint import Frame, Horizontal, Setpoint, Vertical, Yaw

Command = Tuple[float, float, float, float]  # roll, pitch [rad], thrust [percent], yaw rate [rad/s]


class Guidance:
    """Follows one setpoint at a time, or the pilot's sticks; positions are world ENU."""

    def __init__(self, plant: Plant, loops: FlightLoops) -> None:
        self._plant = plant
        self._loops = loops
        self._limits = plant.preset.flight_controller.limits
        self._undocumented = plant.preset.flight_controller.undocumented

    def accept(self, setpoint: Setpoint, has_position: bool = True) -> None:
        """Make a setpoint the one to follow; a position is an offset from where we are now."""
        self._setpoint = setpoint
        if setpoint.horizontal is Horizontal.POSITION:
            east, north = self._east_north(setpoint.x, setpoint.y, setpoint.frame)
            x, y, _ = self._plant.position
            self._target = (x + east, y + north)
        angle_holds = self._undocumented.stable_angle_holds and has_position
        can_hold = setpoint.horizontal is Horizontal.VELOCITY or (
            setpoint.horizontal is Horizontal.ANGLE and angle_holds
        )
        self._holds = can_hold and setpoint.stable and setpoint.x == setpoint.y == 0.0
        if not self._holds:
            self._loops.release_position()
        self._loops.release_height()
        # What depends on no state is the same command until the next setpoint.
        self._fixed: Optional[Command] = self.follow(0.0) if self._is_fixed(setpoint) else None

    def _is_fixed(self, setpoint: Setpoint) -> bool:
        self._fixed = None
        is_angle = setpoint.horizontal is Horizontal.ANGLE and setpoint.frame is Frame.BODY
        is_open_loop = setpoint.vertical is Vertical.THRUST and setpoint.yaw_mode is Yaw.RATE
        return is_angle and is_open_loop and not self._holds

    def follow(self, takeoff_height: float) -> Command:
        """Return the command for the setpoint; heights count from ``takeoff_height`` [m]."""
        if self._fixed is not None:
            return self._fixed
        setpoint, loops = self._setpoint, self._loops
        if setpoint.vertical is Vertical.THRUST:
            percent = setpoint.z
        elif setpoint.vertical is Vertical.VELOCITY:
            percent = loops.climb(setpoint.z)
        else:
            percent = loops.height(takeoff_height + setpoint.z, self._limits.vertical_velocity)
        if setpoint.yaw_mode is Yaw.RATE:
            yaw_rate = -math.radians(setpoint.yaw)
        else:
            yaw_rate = loops.turn_to(math.radians(90.0 - setpoint.yaw))
        roll, pitch = self._tilt(setpoint)
        return roll, pitch, percent, yaw_rate

    def follow_sticks(self, rc: RemoteControl, has_position: bool) -> Command:
        """Return the command for the sticks: velocity, hold when centred; in A they are tilt."""
        loops, limits = self._loops, self._limits
        roll_stick, pitch_stick, yaw_stick, throttle = rc.sticks()
        silent = rc.mode == "F" and self._undocumented.silence == "level"
        if rc.mode == "A" or not has_position or (silent and not (roll_stick or pitch_stick)):
            loops.release_position()
            tilt_limit = self._plant.preset.tilt_limit
            roll, pitch = roll_stick * tilt_limit, pitch_stick * tilt_limit
        elif roll_stick or pitch_stick:
            loops.release_position()
            speed = limits.horizontal_velocity
            ahead, right = pitch_stick * speed, roll_stick * speed
            roll, pitch = loops.velocity(*self._east_north(ahead, right, Frame.BODY))
        else:
            roll, pitch = loops.hold()
        if throttle:
            loops.release_height()
            percent = loops.climb(throttle * limits.vertical_velocity)
        else:
            percent = loops.hold_height()
        return roll, pitch, percent, -yaw_stick * limits.yaw_rate

    def _tilt(self, setpoint: Setpoint) -> Tuple[float, float]:
        loops = self._loops
        if self._holds:
            return loops.hold()
        if setpoint.horizontal is Horizontal.ANGLE:
            right, ahead = math.radians(setpoint.x), -math.radians(setpoint.y)
            if setpoint.frame is Frame.BODY:
                return right, ahead
            # In the GROUND frame an angle, too, is relative to north and east (3.3).
            cos_yaw, sin_yaw = math.cos(self._plant.yaw), math.sin(self._plant.yaw)
            return sin_yaw * right - cos_yaw * ahead, cos_yaw * right + sin_yaw * ahead
        if setpoint.horizontal is Horizontal.VELOCITY:
            velocity = self._east_north(setpoint.x, setpoint.y, setpoint.frame)
            return loops.velocity(*velocity, resist_wind=setpoint.stable)
        return loops.position(*self._target, speed=self._limits.horizontal_velocity)

    def _east_north(self, x: float, y: float, frame: Frame) -> Tuple[float, float]:
        """Return east and north of a vector: north and east, or ahead and right."""
        if frame is Frame.GROUND:
            return y, x
        cos_yaw, sin_yaw = math.cos(self._plant.yaw), math.sin(self._plant.yaw)
        return cos_yaw * x + sin_yaw * y, sin_yaw * x - cos_yaw * y
