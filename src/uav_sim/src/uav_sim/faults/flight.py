# SPDX-License-Identifier: MIT
"""Faults of the aircraft itself and of the air: GPS, battery, motors, thrust, mass, gusts."""

import math
from dataclasses import dataclass, field
from typing import Dict, List, Tuple

from uav_sim.faults.base import Context, Fault
from uav_sim.faults.values import shifted
from uav_sim.plant import Vector
from uav_sim.telemetry import Packet

ROTORS = 4
MIN_MASS_FACTOR = 0.2  # [1] whatever falls off, so much of the aircraft is left
# Roll and pitch towards the weak motor, yaw as its reaction torque is missing: front right and
# back left turn counter-clockwise (PX4's description of the M100), their torque is clockwise.
CORNERS = {
    "front_right": (1.0, 1.0, 1.0),
    "front_left": (-1.0, 1.0, -1.0),
    "back_left": (-1.0, -1.0, 1.0),
    "back_right": (1.0, -1.0, -1.0),
}


@dataclass
class GpsLost(Fault):
    """gps_health falls, positions freeze or drift away, velocities drift.

    What an M100 sends then is not documented; all numbers are assumptions.
    """

    health: int = field(default=0, metadata={"min": 0, "max": 5})
    position: str = field(
        default="frozen", metadata={"choices": ("frozen", "drifting", "unchanged")}
    )
    drift: float = field(default=0.5, metadata={"min": 0.0})  # [m/s] of a drifting position
    velocity_drift: float = field(default=0.05, metadata={"min": 0.0})  # [m/s^2]

    def begin(self, context: Context) -> None:
        """Choose the direction of the drift."""
        self._since = context.since
        heading = context.random.uniform(-math.pi, math.pi)
        self._direction = (math.cos(heading), math.sin(heading))
        self._values: Dict[str, object] = {}
        context.overrides.add(self, context.aircraft.autopilot, "gps_health", lambda _: self.health)

    def filter(self, t: float, packets: List[Packet]) -> List[Packet]:
        """Spoil positions and velocity."""
        return [self._spoilt(t - self._since, packet) for packet in packets]

    def _spoilt(self, age: float, packet: Packet) -> Packet:
        topic, value = packet.topic, packet.value
        if topic == "velocity":
            return packet._replace(
                value=shifted(topic, value, self._offset(self.velocity_drift * age))
            )
        if topic not in ("gps_position", "local_position") or self.position == "unchanged":
            return packet
        if self.position == "frozen":
            return packet._replace(value=self._values.setdefault(topic, value))
        return packet._replace(value=shifted(topic, value, self._offset(self.drift * age)))

    def _offset(self, length: float) -> Vector:
        return (length * self._direction[0], length * self._direction[1], 0.0)


@dataclass
class BatteryLow(Fault):
    """The state of charge falls to a percentage; it discharges from there."""

    percent: float = field(default=15.0, metadata={"min": 0.0, "max": 100.0})

    def begin(self, context: Context) -> None:
        """Take the charge away."""
        context.overrides.add(self, context.aircraft, "battery", lambda _: self.percent)


@dataclass
class BatteryEmpty(BatteryLow):
    """The battery is empty."""

    percent: float = field(default=0.0, metadata={"min": 0.0, "max": 100.0})


@dataclass
class MotorWeak(Fault):
    """One motor gives less thrust.

    Assumption: the total falls by its share, the flight controller keeps level but for a tilt
    towards that motor and a slow turn, both in proportion to the loss.
    """

    motor: str = field(default="front_right", metadata={"choices": tuple(CORNERS)})
    loss: float = field(default=0.3, metadata={"min": 0.0, "max": 1.0})  # [1] of its thrust
    tilt: float = field(default=0.1, metadata={"min": 0.0, "max": 1.0})  # [rad] roll, pitch at 1
    yaw_rate: float = field(default=0.3, metadata={"min": 0.0, "max": 3.0})  # [rad/s] at 1

    def begin(self, context: Context) -> None:
        """Weaken the motor."""
        plant, (roll, pitch, yaw) = context.aircraft.plant, CORNERS[self.motor]
        tilt, turn = self.loss * self.tilt, self.loss * self.yaw_rate
        bias = (roll * tilt, pitch * tilt, yaw * turn)
        left = 1.0 - self.loss / ROTORS

        def biased(before: Vector) -> Vector:
            return (before[0] + bias[0], before[1] + bias[1], before[2] + bias[2])

        context.overrides.add(self, plant, "thrust_gain", lambda gain: gain * left)
        context.overrides.add(self, plant, "reference_bias", biased)


@dataclass
class ThrustGain(Fault):
    """The same percentage gives more or less thrust."""

    factor: float = field(metadata={"min": 0.05, "max": 5.0})  # [1]

    def begin(self, context: Context) -> None:
        """Change the gain."""
        context.overrides.add(
            self, context.aircraft.plant, "thrust_gain", lambda gain: gain * self.factor
        )


@dataclass
class MassChange(Fault):
    """Something heavy is added, or falls off; nothing else changes with it."""

    added: float = field(metadata={"min": -2.0, "max": 5.0})  # [kg]

    def begin(self, context: Context) -> None:
        """Change the mass."""
        plant = context.aircraft.plant
        preset = plant.preset
        part = self.added / (preset.mass + preset.payload)  # the factor is on both
        context.overrides.add(
            self, plant, "mass_factor", lambda factor: max(factor + part, MIN_MASS_FACTOR)
        )


@dataclass
class WindGust(Fault):
    """Wind on top of the weather's; it rises and falls like a cosine."""

    velocity: Tuple[float, float, float]  # [m/s] of the air, world ENU
    rise: float = field(default=0.5, metadata={"min": 0.0})  # [s]

    def begin(self, context: Context) -> None:
        """Begin to blow."""
        self._since, self._until = context.since, context.until

    def gust(self, t: float) -> Vector:
        """Blow harder or less."""
        inside = min(t - self._since, self._until - t)
        part = 1.0 if inside >= self.rise else 0.5 - 0.5 * math.cos(math.pi * inside / self.rise)
        return (part * self.velocity[0], part * self.velocity[1], part * self.velocity[2])
