# SPDX-License-Identifier: MIT
"""What is the same for all flights of a campaign."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Tuple

import yaml

from nmpc_control.config import from_dict
from nmpc_control.errors import ConfigError
from nmpc_control.params import Parameters, load_parameters
from uav_sim.closed_loop.campaign.draw import WEIGHTS
from uav_sim.spread import PREFIX

SPREAD = "spread"  # each flight with a random aircraft of its own
_MODEL_OF_SPREAD = "dji_hil"
_PATIENCE = 10.0  # [s] for a solve: a busy machine must not change a flight, iterations are limited


@dataclass(frozen=True)
class Settings:
    """Aircraft, disturbance and control of a campaign; the same flights with the same settings."""

    suite: str
    seed: int
    plant: str = "dji_hil"
    disturbance: str = "none"
    avoidance: bool = True  # False: neither controller nor guard knows of any obstacle
    check: bool = True  # a flight that failed goes to the feasibility checker
    changes: Tuple[str, ...] = ()  # KEY=VALUE of the controller's parameters

    def preset(self, flight_seed: int) -> str:
        """Return the name of the simulated aircraft of a flight."""
        return f"{PREFIX}{flight_seed}" if self.plant == SPREAD else self.plant

    def parameters(self) -> Parameters:
        """Return the controller's parameters.

        Raises:
            ConfigError: a preset that does not exist, a change that is wrong.
        """
        vehicle = _MODEL_OF_SPREAD if self.plant == SPREAD else self.plant
        parameters = load_parameters(vehicle, WEIGHTS)
        for change in self.changes:
            parameters = changed(parameters, change)
        avoidance = dataclasses.replace(
            parameters.avoidance, enabled=self.avoidance and parameters.avoidance.enabled
        )
        solver = parameters.solver.with_budget(time_budget=_PATIENCE)
        return dataclasses.replace(parameters, avoidance=avoidance, solver=solver)


def changed(parameters: Parameters, change: str) -> Parameters:
    """Return parameters with one value changed: ``avoidance.eta=2000``.

    Raises:
        ConfigError: no such key, or a value that does not fit.
    """
    key, equals, text = change.partition("=")
    if not equals:
        raise ConfigError("--set", "change", change, "KEY=VALUE, like avoidance.eta=2000")
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ConfigError("--set", key, text, "a YAML value") from None
    data = _plain(dataclasses.asdict(parameters))
    place: Any = data
    *folders, name = key.split(".")
    for folder in folders:
        place = place.get(folder) if isinstance(place, dict) else None
    if not isinstance(place, dict) or name not in place:
        raise ConfigError("--set", key, value, f"a key below one of {', '.join(data)}")
    place[name] = float(value) if isinstance(place[name], float) and _is_int(value) else value
    return from_dict(Parameters, data, "--set")


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _plain(data: Mapping[str, Any]) -> Dict[str, Any]:
    """Return a tree with lists for arrays."""
    return {
        key: _plain(value)
        if isinstance(value, dict)
        else value.tolist()
        if hasattr(value, "tolist")
        else value
        for key, value in data.items()
    }
