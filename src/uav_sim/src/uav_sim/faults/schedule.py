# SPDX-License-Identifier: MIT
"""Faults as lines of YAML: what, when, for how long, and of which vehicle."""

import math
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Tuple

from uav_sim.config import load_yaml, number
from uav_sim.errors import ConfigError
from uav_sim.faults.engine import Faults
from uav_sim.faults.kinds import make_fault

_OWN_KEYS = ("fault", "start", "duration", "id", "vehicle")


@dataclass(frozen=True)
class FaultLine:
    """One line of a schedule; it has been checked."""

    kind: str
    parameters: Mapping[str, Any]
    start: float  # [s] simulated time
    duration: float  # [s] infinite: to the end
    id: str  # empty: made up
    vehicle: Optional[str]  # None: every vehicle
    source: str  # file and key, for the words of an error

    def apply(self, faults: Faults) -> str:
        """Schedule this fault; returns its id. Raises ConfigError if the id is in use."""
        return faults.inject(
            self.kind, self.parameters, self.start, self.duration, self.id, self.source
        )


def load_fault_file(path: str) -> Tuple[FaultLine, ...]:
    """Return the lines under ``faults`` of a YAML file.

    Raises:
        ConfigError: naming file, key, value and what was expected.
    """
    data = load_yaml(path)
    for key in data:
        if key not in ("faults", "description"):
            raise ConfigError(path, str(key), data[key], "only the keys description and faults")
    return load_faults(data.get("faults"), path)


def load_faults(data: Any, source: str) -> Tuple[FaultLine, ...]:
    """Return the faults of a list of mappings; None is an empty one.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if data is None:
        return ()
    if not isinstance(data, list):
        raise ConfigError(source, "faults", data, "a list of mappings")
    return tuple(_line(item, source, f"faults[{i}]") for i, item in enumerate(data))


def _line(item: Any, source: str, key: str) -> FaultLine:
    if not isinstance(item, dict) or "fault" not in item:
        raise ConfigError(source, key, item, "a mapping with fault, start and the fault's own keys")
    parameters: Dict[str, Any] = {k: v for k, v in item.items() if k not in _OWN_KEYS}
    place = f"{source}: {key}"
    make_fault(item["fault"], parameters, place)
    start = number(item.get("start", 0.0), place, "start", 0.0)
    duration = item.get("duration", math.inf)
    if duration != math.inf:
        duration = number(duration, place, "duration", 1e-3)
    for name in ("id", "vehicle"):
        if name in item and (not isinstance(item[name], str) or not item[name]):
            raise ConfigError(place, name, item[name], "a name")
    return FaultLine(
        item["fault"], parameters, start, duration, item.get("id", ""), item.get("vehicle"), place
    )
