# SPDX-License-Identifier: MIT
"""Parameters of what is heard of obstacles; values live in ``config/obstacles.yaml``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

from nmpc_control.config import config_directory, from_dict, load_yaml
from nmpc_control.errors import ConfigError


def _positive() -> float:
    return field(metadata={"min": 1e-3})


@dataclass(frozen=True)
class ObstacleParameters:
    """Ages and rates."""

    age_limit: float = _positive()  # [s] older information about a moving one counts as missing
    default_growth: float = field(metadata={"min": 0.0})  # [m/s] at least, from then on
    stale_after: float = _positive()  # [s] older: the guard reacts
    future_tolerance: float = field(metadata={"min": 0.0})  # [s] stamps farther ahead count as now
    message_rate: float = _positive()  # [Hz] most messages of one sender that are read


def load_obstacle_parameters(directory: Optional[Path] = None) -> ObstacleParameters:
    """Return the parameters of ``config/obstacles.yaml``; raises ConfigError."""
    path = (directory or config_directory()) / "obstacles.yaml"
    params = from_dict(ObstacleParameters, load_yaml(path), path.name)
    if params.stale_after < params.age_limit:
        expected = f"at least age_limit, {params.age_limit}"
        raise ConfigError(path.name, "stale_after", params.stale_after, expected)
    return params
