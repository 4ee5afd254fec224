# SPDX-License-Identifier: MIT
"""From inputs of the model to axes of DJI's setpoint, as the launch commands the vertical axis."""

from typing import Sequence

from nmpc_control import dji
from nmpc_control.battery_thrust import BatteryThrust
from nmpc_control.guard_data import Command
from nmpc_control.guard_params import GuardParameters
from nmpc_control.ladder import Rung
from nmpc_control.params import Vehicle
from nmpc_control.state import THRUST


class Setpoints:
    """Makes axes within the limits."""

    def __init__(self, params: GuardParameters, vehicle: Vehicle) -> None:
        self.limits = params.setpoint_limits
        self.vertical_command = params.vertical_command
        self.vehicle = vehicle
        self.battery = BatteryThrust(vehicle.battery)

    def of_input(self, rung: Rung, u: Sequence[float], up: float) -> Command:
        """Return the command for an input (4,); ``up`` [m/s] counts where thrust is not sent."""
        if self.vertical_command == "velocity":
            axes = dji.attitude_velocity_axes(u[1:], up, self.vehicle, self.limits)
            return Command(rung, axes, (float(u[THRUST]), axes[0], axes[1], axes[3]))
        gain = self.battery.gain
        axes = dji.attitude_thrust_axes(u, self.vehicle, self.limits, gain)
        return Command(rung, axes, dji.input_from_axes(axes, self.vehicle, gain))

    def hold(self, rung: Rung, velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> Command:
        """Return the command of DJI's own hold, or for a velocity (3,) [m/s]; needs good GPS."""
        return Command(rung, dji.velocity_axes(velocity, 0.0, self.limits))
