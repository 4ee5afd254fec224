# SPDX-License-Identifier: MIT
"""Flights of the simulated M100 with known parameters, as logs and as bags."""

from dataclasses import dataclass, field

import numpy as np
from analysis_bags import BagBuilder, header, xyz

from nmpc_control.analysis.identification.log import Log
from nmpc_control.analysis.record import Series
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset

PERIOD = 0.02  # [s] between commands
START = 100.0  # [s] of the stamps


@dataclass
class Recorded:
    """Rows of a simulated flight: (time [s], values)."""

    commands: list = field(default_factory=list)  # thrust, roll, pitch, yaw rate
    packets: list = field(default_factory=list)

    def rows(self, topic):
        return [(p.t, p.value) for p in self.packets if p.topic == topic]

    def log(self, **changes):
        """Return the flight as a log."""
        attitude = self.rows("imu")
        rpy = np.array([rpy_of(value.orientation) for _, value in attitude])
        rpy[:, 2] = np.unwrap(rpy[:, 2])
        fields = {
            "bag": "simulated.bag",
            "source": "simulation",
            "commands": series(self.commands),
            "attitude": Series([t for t, _ in attitude], rpy),
            "velocity": series(self.rows("velocity")),
            "battery": series([(t, (v,)) for t, v in self.rows("battery_state")]),
            "flight_status": series([(t, (v,)) for t, v in self.rows("flight_status")]),
        }
        return Log(**{**fields, **changes})

    def bag(self, is_simulation=True):
        """Return a builder with the flight's messages."""
        builder = BagBuilder(delay=0.0)
        for t, (percent, roll, pitch, yaw_rate) in self.commands:
            builder.setpoint(START + t, roll, pitch, percent, yaw_rate)
        for packet in self.packets:
            self._add(builder, START + packet.t, packet.topic, packet.value)
        if is_simulation:
            builder.odometry("uav_sim/ground_truth", START, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return builder

    @staticmethod
    def _add(builder, t, topic, value):
        if topic == "imu":
            values = {
                "header": header(t),
                "orientation": dict(zip("xyzw", value.orientation)),
                "angular_velocity": xyz(value.angular_velocity),
                "linear_acceleration": xyz(value.linear_acceleration),
            }
            builder.add("dji_sdk/imu", "sensor_msgs/msg/Imu", t, values)
        elif topic == "velocity":
            values = {"header": header(t), "vector": xyz(value)}
            builder.add("dji_sdk/velocity", "geometry_msgs/msg/Vector3Stamped", t, values)
        elif topic == "battery_state":
            values = {"header": header(t), "percentage": float(value)}
            builder.add("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState", t, values)


def series(rows):
    return Series([t for t, _ in rows], [values for _, values in rows])


def rpy_of(quaternion):
    x, y, z, w = quaternion
    return (
        np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        np.arcsin(2.0 * (w * y - z * x)),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def excite(duration, tilt=0.55, thrust=10.0, yaw_rate=1.0, hover=38.4, seed=0):
    """Return a function of time to commands that jump at random moments, as percent and rad."""
    generator = np.random.default_rng(seed)

    def jumps(amplitude):
        times = np.cumsum(generator.uniform(0.3, 0.9, int(duration / 0.3) + 2))
        return times, amplitude * generator.uniform(-1.0, 1.0, len(times))

    plans = [jumps(amplitude) for amplitude in (thrust, tilt, tilt, yaw_rate)]

    def at(t):
        u = [values[np.searchsorted(times, t)] for times, values in plans]
        return (hover + u[0], *u[1:])

    return at


def fly(preset, duration, commands, obeys=lambda t: True, thrust_gain=None):
    """Return a flight that starts in hover high above the ground.

    ``obeys(t)``: the flight controller gets the commands; ``thrust_gain(t)`` of the plant.
    """
    preset = load_preset(preset) if isinstance(preset, str) else preset
    m100 = SimulatedM100(preset)
    m100.place((0.0, 0.0, 500.0), authority=True)
    recorded = Recorded()
    steps = round(PERIOD / preset.step)
    for k in range(round(duration / PERIOD)):
        t = k * PERIOD
        percent, roll, pitch, yaw_rate = commands(t)
        recorded.commands.append((t, (percent, roll, pitch, yaw_rate)))
        if obeys(t):
            m100.setpoint("generic", (roll, pitch, percent, yaw_rate, 43.0))
        if thrust_gain is not None:
            m100.plant.thrust_gain = thrust_gain(t)
        for _ in range(steps):
            recorded.packets += m100.step()
    return recorded
