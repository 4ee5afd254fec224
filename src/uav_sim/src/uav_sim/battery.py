# SPDX-License-Identifier: MIT
"""The battery: discharge over time, and the thrust that a charge leaves."""

from uav_sim.preset import BatteryModel

INDUCED_POWER = 1.5  # exponent of power over thrust in hover, by momentum theory


class Battery:
    """State of charge of a flight battery."""

    def __init__(self, model: BatteryModel, percent: float = 100.0) -> None:
        self.percent = percent  # [percent] of charge
        self._model = model
        self._hover_rate = 100.0 / model.flight_time  # [percent/s]

    def discharge(self, thrust: float, duration: float) -> None:
        """Take what motors that are on need.

        Args:
            thrust: [1] of the nominal aircraft's weight.
            duration: [s].
        """
        power = max(thrust, 0.0) ** INDUCED_POWER
        power = power if power > self._model.idle_power else self._model.idle_power
        self.percent = max(0.0, self.percent - self._hover_rate * power * duration)

    @property
    def thrust_gain(self) -> float:
        """Thrust [1] for a command by that of a full battery for the same command."""
        model, percent = self._model, self.percent
        if percent >= model.sag_knee:
            return 1.0
        gain = model.hover_full / hover_thrust(model, percent)
        if percent < model.cutoff:
            gain *= model.empty_gain + (1.0 - model.empty_gain) * percent / model.cutoff
        return gain


def hover_thrust(model: BatteryModel, percent: float) -> float:
    """Return the hover thrust [percent] of the flights that the sag was fitted to, at a charge."""
    return model.hover_full + model.sag_slope * max(0.0, model.sag_knee - percent)
