# SPDX-License-Identifier: MIT
"""The aircraft below its flight controller: attitude, translation, drag, wind and the ground.

World ENU, body FLU, roll-pitch-yaw about x, y, z; positive pitch is nose down. The ground is z = 0.
"""

import math
from math import cos, sin
from typing import Optional, Sequence, Tuple

from uav_sim.preset import FirstOrder, PlantPreset
from uav_sim.response import DeadTime, LagState, PairDeadTime, make_response

Vector = Tuple[float, float, float]
Command = Tuple[float, float, float, float]  # roll, pitch [rad], thrust [percent], yaw rate [rad/s]
UNBIASED: Vector = (0.0, 0.0, 0.0)


def limit_norm(x: float, y: float, limit: float) -> Tuple[float, float]:
    """Return the vector (x, y) shortened to a norm."""
    norm = math.hypot(x, y)
    if norm <= limit:
        return x, y
    return x * limit / norm, y * limit / norm


def limit_tilt(x: float, y: float, angle: float, limit: float) -> Tuple[float, float]:
    """Return roll and pitch, each limited to ``angle``, then both as a vector to ``limit``."""
    return limit_norm(min(max(x, -angle), angle), min(max(y, -angle), angle), limit)


class Plant:
    """Rigid body that follows attitude, thrust and yaw rate commands as identified.

    Advances in fixed steps: attitude responses exactly, translation by the midpoint rule.
    ``thrust_gain`` and ``battery_gain`` multiply the force, ``mass_factor`` the mass; ``wind`` and
    ``gust`` add up to the air's velocity; ``reference_bias`` is added to what roll, pitch [rad] and
    yaw rate [rad/s] follow.
    """

    def __init__(self, preset: PlantPreset) -> None:
        self.preset = preset
        self.wind: Vector = (0.0, 0.0, 0.0)
        self.gust: Vector = (0.0, 0.0, 0.0)
        self.reference_bias: Vector = UNBIASED
        self.thrust_gain = 1.0
        self.battery_gain = 1.0
        self.mass_factor = 1.0
        step, delay = preset.step, preset.delay
        self._step = step
        self._gravity = preset.gravity
        self._drag = (preset.drag.x, preset.drag.y, preset.drag.z)
        self._heading_drag = preset.drag.frame == "heading"
        self._ground_effect = preset.ground_effect if preset.ground_effect.strength else None
        self._laden = 1.0 + preset.payload / preset.mass
        self._midpoint = tuple(1.0 - 0.5 * step * drag for drag in self._drag)
        self._tilt_line = PairDeadTime(delay.attitude, step)
        self._thrust_line = DeadTime(delay.thrust, step)
        self._yaw_rate_line = DeadTime(delay.yaw_rate, step)
        self.place((0.0, 0.0, 0.0), airborne=False)

    def place(
        self,
        position: Sequence[float],
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        airborne: bool = True,
    ) -> None:
        """Put the vehicle level at a position (3,) [m], hovering with motors on or standing."""
        preset = self.preset
        self.position: Vector = tuple(float(v) for v in position)
        self.velocity: Vector = tuple(float(v) for v in velocity)
        self.acceleration: Vector = (0.0, 0.0, 0.0)
        self.yaw = yaw
        self._roll = make_response(preset.roll, preset.step)
        self._pitch = make_response(preset.pitch, preset.step)
        self._yaw_rate = make_response(preset.yaw_rate, preset.step)
        self.motors_on = airborne
        self.on_ground = not airborne
        self.impact_speed = 0.0  # [m/s] of the last touch-down
        hover = self.hover_percent if airborne else 0.0
        self._command: Command = (math.nan,) * 4
        self.command(0.0, 0.0, hover, 0.0)
        self._tilt_line.fill(0.0, 0.0)
        self._yaw_rate_line.fill(0.0)
        self._thrust_line.fill(self._thrust_ref)
        self._rotors: Optional[LagState] = None
        if preset.rotor_time_constant:
            self._rotors = LagState(FirstOrder(1.0, preset.rotor_time_constant), preset.step)
            self._rotors.value = self._thrust_ref
        self._force = self._thrust_ref

    def set_motion(
        self, velocity: Sequence[float], rpy: Sequence[float], rpy_rates: Sequence[float]
    ) -> None:
        """Go on from a velocity (3,) [m/s], roll, pitch, yaw (3,) [rad] and their rates [rad/s].

        Position and commands under way stay.
        """
        self.velocity = tuple(float(v) for v in velocity)
        self._roll.value, self._pitch.value, self.yaw = (float(v) for v in rpy)
        self._roll.rate, self._pitch.rate, self._yaw_rate.value = (float(v) for v in rpy_rates)
        self._yaw_rate.rate = 0.0

    @property
    def hover_percent(self) -> float:
        """Thrust percentage that carries this aircraft as it is, away from the ground."""
        preset = self.preset
        return preset.thrust.percent(preset.gravity / self._thrust_factor)

    @property
    def thrust_force(self) -> float:
        """Thrust [1] of the rotors as a part of the nominal aircraft's weight."""
        return self._force / self._gravity if self.motors_on else 0.0

    @property
    def rpy(self) -> Vector:
        """Roll, pitch, yaw [rad]; yaw is not wrapped."""
        return self._roll.value, self._pitch.value, self.yaw

    @property
    def rpy_rates(self) -> Vector:
        """Time derivatives of roll, pitch, yaw [rad/s]."""
        return self._roll.rate, self._pitch.rate, self._yaw_rate.value

    @property
    def _thrust_factor(self) -> float:
        """Acceleration of this aircraft by that of the nominal one, for the same command."""
        return self.thrust_gain * self.battery_gain / (self.mass_factor * self._laden)

    def command(self, roll: float, pitch: float, percent: float, yaw_rate: float) -> None:
        """Hold from now on roll, pitch [rad], thrust [percent] (0: idle) and yaw rate [rad/s]."""
        command = (roll, pitch, percent, yaw_rate)
        if command == self._command:
            return
        self._command = command
        angle = self.preset.flight_controller.limits.angle
        self._roll_ref, self._pitch_ref = limit_tilt(roll, pitch, angle, self.preset.tilt_limit)
        self._thrust_ref = self.preset.thrust.acceleration(percent)
        self._yaw_rate_ref = yaw_rate

    def step(self) -> None:
        """Advance by ``preset.step``."""
        roll_ref, pitch_ref = self._tilt_line.push(self._roll_ref, self._pitch_ref)
        yaw_rate_ref = self._yaw_rate_line.push(self._yaw_rate_ref)
        if self.on_ground:  # legs keep the aircraft level and its heading fixed
            roll_ref = pitch_ref = yaw_rate_ref = 0.0
        elif self.reference_bias is not UNBIASED:
            bias = self.reference_bias
            roll_ref, pitch_ref = roll_ref + bias[0], pitch_ref + bias[1]
            yaw_rate_ref += bias[2]
        # Thrust acts along the mean attitude of the step.
        roll, pitch, yaw_rate = self._roll, self._pitch, self._yaw_rate
        phi = 0.5 * (roll.value + roll.advance(roll_ref))
        theta = 0.5 * (pitch.value + pitch.advance(pitch_ref))
        half_turn = 0.25 * self._step * (yaw_rate.value + yaw_rate.advance(yaw_rate_ref))
        psi = self.yaw + half_turn
        self.yaw = psi + half_turn
        thrust, z = self._thrust_line.push(self._thrust_ref), self.position[2]
        if self._rotors is not None:
            thrust = self._rotors.advance(thrust)
        self._force = thrust = thrust * self.thrust_gain * self.battery_gain
        thrust = thrust / (self.mass_factor * self._laden) if self.motors_on else 0.0
        if self._ground_effect is not None:
            thrust *= self._ground_effect.gain(z)
        upright = thrust * cos(phi)
        ahead, left, up = upright * sin(theta), -thrust * sin(phi), upright * cos(theta)
        if z <= 0.0 and up <= self._gravity and self.velocity[2] <= 0.0:
            self._slide(ahead, left, up, psi)
        else:
            self._fly(ahead, left, up, psi)

    def _fly(self, ahead: float, left: float, up: float, psi: float) -> None:
        """Advance in free air under a thrust acceleration in heading axes, by the midpoint rule."""
        h, cos_yaw, sin_yaw = self._step, cos(psi), sin(psi)
        vx, vy, vz = self.velocity
        (wx, wy, wz), (gx, gy, gz), (dx, dy, dz) = self.wind, self.gust, self._drag
        air_x, air_y = vx - wx - gx, vy - wy - gy
        # Drag is linear: half a step later, acceleration has changed by this factor.
        kx, ky, kz = self._midpoint
        if self._heading_drag:
            ahead = kx * (ahead - dx * (cos_yaw * air_x + sin_yaw * air_y))
            left = ky * (left - dy * (cos_yaw * air_y - sin_yaw * air_x))
            ax, ay = cos_yaw * ahead - sin_yaw * left, sin_yaw * ahead + cos_yaw * left
        else:
            ax = kx * (cos_yaw * ahead - sin_yaw * left - dx * air_x)
            ay = ky * (sin_yaw * ahead + cos_yaw * left - dy * air_y)
        az = kz * (up - dz * (vz - wz - gz) - self._gravity)
        x, y, z = self.position
        vx_next, vy_next, vz_next = vx + h * ax, vy + h * ay, vz + h * az
        z += 0.5 * h * (vz + vz_next)
        self.on_ground = z <= 0.0 and vz_next <= 0.0
        if self.on_ground:
            self.impact_speed = -vz_next
            z, vz_next = 0.0, 0.0
            az = -vz / h
        self.position = (x + 0.5 * h * (vx + vx_next), y + 0.5 * h * (vy + vy_next), z)
        self.velocity = (vx_next, vy_next, vz_next)
        self.acceleration = (ax, ay, az)

    def _slide(self, ahead: float, left: float, up: float, psi: float) -> None:
        """Advance on the ground: friction carries what pushes sideways, up to its limit."""
        h = self._step
        self.on_ground = True
        vx, vy = self.velocity[0], self.velocity[1]
        grip = h * self.preset.ground_friction * (self._gravity - up)
        px = vx + h * (cos(psi) * ahead - sin(psi) * left)
        py = vy + h * (sin(psi) * ahead + cos(psi) * left)
        speed = math.hypot(px, py)
        keep = 1.0 - grip / speed if speed > grip else 0.0
        x, y, _ = self.position
        next_vx, next_vy = keep * px, keep * py
        self.position = (x + 0.5 * h * (vx + next_vx), y + 0.5 * h * (vy + next_vy), 0.0)
        self.velocity = (next_vx, next_vy, 0.0)
        self.acceleration = ((next_vx - vx) / h, (next_vy - vy) / h, 0.0)
