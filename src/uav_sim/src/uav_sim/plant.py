# SPDX-License-Identifier: MIT
"""The aircraft below its flight controller: attitude, translation, drag, wind and the ground.

World ENU, body FLU, roll-pitch-yaw about x, y, z; positive pitch is nose down. The ground is z = 0.
"""

import math
from typing import Sequence, Tuple

from uav_sim.preset import PlantPreset
from uav_sim.response import DeadTime, make_lag, make_response

Vector = Tuple[float, float, float]
Command = Tuple[float, float, float, float]  # roll, pitch [rad], thrust [percent], yaw rate [rad/s]


def limit_norm(x: float, y: float, limit: float) -> Tuple[float, float]:
    """Return the vector (x, y) shortened to a norm."""
    norm = math.hypot(x, y)
    if norm <= limit:
        return x, y
    return x * limit / norm, y * limit / norm


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
        self.reference_bias: Vector = (0.0, 0.0, 0.0)
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
        self._roll_line = DeadTime(delay.attitude, step)
        self._pitch_line = DeadTime(delay.attitude, step)
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
        for line in (self._roll_line, self._pitch_line, self._yaw_rate_line):
            line.fill(0.0)
        self._thrust_line.fill(self._thrust_ref)
        self._rotors = make_lag(preset.rotor_time_constant, preset.step, self._thrust_ref)

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
        if not self.motors_on:
            return 0.0
        return self._rotors.value * self.thrust_gain * self.battery_gain / self._gravity

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
        self._roll_ref, self._pitch_ref = limit_norm(roll, pitch, self.preset.tilt_limit)
        self._thrust_ref = self.preset.thrust.acceleration(percent)
        self._yaw_rate_ref = yaw_rate

    def step(self) -> None:
        """Advance by ``preset.step``."""
        thrust = self._rotors.advance(self._thrust_line.push(self._thrust_ref))
        z = self.position[2]
        if not self.motors_on:
            thrust = 0.0
        else:
            thrust *= self.thrust_gain * self.battery_gain / (self.mass_factor * self._laden)
            if self._ground_effect is not None:
                thrust *= self._ground_effect.gain(z)
        force, cos_yaw, sin_yaw = self._turn(thrust)
        if z <= 0.0 and force[2] <= self._gravity and self.velocity[2] <= 0.0:
            self._slide(force)
        else:
            self._fly(force, cos_yaw, sin_yaw)

    def _turn(self, thrust: float) -> Tuple[Vector, float, float]:
        """Advance the attitude; return mean thrust acceleration, cosine and sine of mean yaw."""
        roll, pitch, yaw_rate = self._roll, self._pitch, self._yaw_rate
        roll_ref = self._roll_line.push(self._roll_ref)
        pitch_ref = self._pitch_line.push(self._pitch_ref)
        yaw_rate_ref = self._yaw_rate_line.push(self._yaw_rate_ref)
        if self.on_ground:  # legs keep the aircraft level and its heading fixed
            roll_ref = pitch_ref = yaw_rate_ref = 0.0
        else:
            bias = self.reference_bias
            roll_ref, pitch_ref = roll_ref + bias[0], pitch_ref + bias[1]
            yaw_rate_ref += bias[2]
        yaw_before, rate_before = self.yaw, yaw_rate.value
        phi = 0.5 * (roll.value + roll.advance(roll_ref))
        theta = 0.5 * (pitch.value + pitch.advance(pitch_ref))
        turned = 0.5 * self._step * (rate_before + yaw_rate.advance(yaw_rate_ref))
        self.yaw = yaw_before + turned
        psi = yaw_before + 0.5 * turned
        ahead, right = thrust * math.cos(phi), thrust * math.sin(phi)
        up, ahead = ahead * math.cos(theta), ahead * math.sin(theta)
        cos_yaw, sin_yaw = math.cos(psi), math.sin(psi)
        force = (ahead * cos_yaw + right * sin_yaw, ahead * sin_yaw - right * cos_yaw, up)
        return force, cos_yaw, sin_yaw

    def _fly(self, force: Vector, cos_yaw: float, sin_yaw: float) -> None:
        h = self._step
        half = 0.5 * h
        vx, vy, vz = self.velocity
        ax, ay, az = self._accelerate(force, vx, vy, vz, cos_yaw, sin_yaw)
        mx, my, mz = vx + half * ax, vy + half * ay, vz + half * az
        ax, ay, az = self._accelerate(force, mx, my, mz, cos_yaw, sin_yaw)
        x, y, z = self.position
        z += h * mz
        vz_next = vz + h * az
        self.on_ground = z <= 0.0 and vz_next <= 0.0
        if self.on_ground:
            self.impact_speed = -vz_next
            z, vz_next = 0.0, 0.0
        self.position = (x + h * mx, y + h * my, z)
        self.velocity = (vx + h * ax, vy + h * ay, vz_next)
        self.acceleration = (ax, ay, (vz_next - vz) / h)

    def _accelerate(
        self, force: Vector, vx: float, vy: float, vz: float, cos_yaw: float, sin_yaw: float
    ) -> Vector:
        """Return the acceleration (3,) of thrust, drag and gravity in free air."""
        (wx, wy, wz), (gx, gy, gz), (dx, dy, dz) = self.wind, self.gust, self._drag
        vx, vy, vz = vx - wx - gx, vy - wy - gy, vz - wz - gz
        up = force[2] - dz * vz - self._gravity
        if not self._heading_drag:
            return force[0] - dx * vx, force[1] - dy * vy, up
        ahead = dx * (cos_yaw * vx + sin_yaw * vy)
        left = dy * (cos_yaw * vy - sin_yaw * vx)
        return (
            force[0] - cos_yaw * ahead + sin_yaw * left,
            force[1] - sin_yaw * ahead - cos_yaw * left,
            up,
        )

    def _slide(self, force: Vector) -> None:
        """Advance on the ground: friction carries what pushes sideways, up to its limit."""
        h = self._step
        self.on_ground = True
        vx, vy = self.velocity[0], self.velocity[1]
        grip = h * self.preset.ground_friction * (self._gravity - force[2])
        px, py = vx + h * force[0], vy + h * force[1]
        speed = math.hypot(px, py)
        keep = 1.0 - grip / speed if speed > grip else 0.0
        x, y, _ = self.position
        next_vx, next_vy = keep * px, keep * py
        self.position = (x + 0.5 * h * (vx + next_vx), y + 0.5 * h * (vy + next_vy), 0.0)
        self.velocity = (next_vx, next_vy, 0.0)
        self.acceleration = ((next_vx - vx) / h, (next_vy - vy) / h, 0.0)
