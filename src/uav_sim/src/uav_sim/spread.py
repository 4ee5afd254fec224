# SPDX-License-Identifier: MIT
"""Random aircraft between and around the presets: one seed, one aircraft."""

import dataclasses
from random import Random
from typing import Any, Dict, Optional

from uav_sim.config import config_directory, from_dict, load_yaml, merged, numbers
from uav_sim.errors import ConfigError
from uav_sim.preset import PlantPreset, load_preset

PREFIX = "spread:"  # name of a random aircraft: this and its seed


def any_preset(
    name: str, changes: Optional[Dict[str, Any]] = None, source: str = "changes"
) -> PlantPreset:
    """Return the preset of a name, or a random aircraft: ``spread:7`` is that of seed 7.

    Args:
        name: of a preset, or ``spread:`` and a whole number.
        changes: values that win over those of the preset.
        source: where the changes come from, for the words of an error.

    Raises:
        ConfigError: no such preset, or changes that are wrong.
    """
    if not name.startswith(PREFIX):
        return load_preset(name, changes, source)
    text = name[len(PREFIX) :]
    if not text.isdecimal():
        raise ConfigError("preset", "name", name, f"{PREFIX} and a whole number")
    preset = spread(int(text))
    if changes:
        preset = from_dict(PlantPreset, merged(dataclasses.asdict(preset), changes), source)
    return preset


def spread(seed: int) -> PlantPreset:
    """Return the random aircraft of a seed, within the ranges of ``config/spread.yaml``.

    Raises:
        ConfigError: a range that is wrong.
    """
    path = config_directory() / "spread.yaml"
    drawn = _draw(load_yaml(path), Random(f"spread/{seed}"), path.name)
    attitude, delay, thrust = drawn["attitude"], drawn["delay"], drawn["thrust"]
    coins = Random(f"spread/{seed}/kind")
    ratio = attitude["pitch_by_roll"]
    if coins.random() < 0.5:
        key, pitch = "time_constant", attitude["time_constant"] * ratio
        shape: Dict[str, float] = {"gain": attitude["gain"]}
    else:
        key, pitch = "omega", attitude["omega"] / ratio
        shape = {"gain": attitude["gain"], "zeta": attitude["zeta"]}
    common = load_yaml(config_directory() / "common.yaml")
    slope = thrust["slope"]
    data = {
        **common,
        "name": f"{PREFIX}{seed}",
        "mass": drawn["mass"],
        "radius": load_preset("dji_hil").radius,
        "roll": {**shape, key: attitude[key]},
        "pitch": {**shape, key: pitch},
        "yaw_rate": drawn["yaw_rate"],
        "thrust": {
            "slope": slope,
            "offset": common["gravity"] - slope * thrust["hover"],
            "limit": load_preset("eth").thrust.limit,
        },
        "rotor_time_constant": drawn["rotor_time_constant"],
        "drag": {"frame": coins.choice(("heading", "world")), **drawn["drag"]},
        "tilt_limit": drawn["tilt_limit"],
        "delay": {
            "attitude": delay["attitude"],
            "thrust": delay["attitude"] + delay["thrust_beyond"],
            "yaw_rate": delay["attitude"],
            "telemetry": delay["telemetry"],
        },
    }
    return from_dict(PlantPreset, data, f"{PREFIX}{seed}")


def _draw(ranges: Dict[str, Any], draw: Random, source: str, key: str = "") -> Dict[str, Any]:
    """Return a number within each range, in the order of the keys."""
    drawn: Dict[str, Any] = {}
    for name in sorted(ranges):
        value, full = ranges[name], f"{key}{name}"
        if isinstance(value, dict):
            drawn[name] = _draw(value, draw, source, f"{full}.")
            continue
        low, high = numbers(value, source, full, 2)
        if low > high:
            raise ConfigError(source, full, value, "the lower bound first")
        drawn[name] = draw.uniform(low, high)
    return drawn
