# SPDX-License-Identifier: MIT
"""The list ``obstacles:`` of a scenario file."""

from dataclasses import dataclass, field
from typing import Any, Tuple

import numpy as np

from nmpc_control.config import from_dict
from nmpc_control.errors import ConfigError
from nmpc_control.obstacle import Obstacle

_REACH = 1e4  # [m]


def _size() -> float:
    return field(metadata={"min": 1e-3, "max": _REACH})


@dataclass(frozen=True)
class _Entry:
    id: str
    position: np.ndarray = field(metadata={"length": 3, "min": -_REACH, "max": _REACH})


@dataclass(frozen=True)
class _Moves:
    """How it moves: the simulator's matter; here only messages tell where a moving one goes."""

    velocity: np.ndarray = field(
        default_factory=lambda: np.zeros(3), metadata={"length": 3, "min": -_REACH, "max": _REACH}
    )
    motion: Any = None
    appear: Any = None


@dataclass(frozen=True)
class _Sphere(_Entry):
    radius: float = _size()

    def lengths(self) -> Tuple[float, ...]:
        return (self.radius,)


@dataclass(frozen=True)
class _Cylinder(_Entry):
    radius: float = _size()
    height: float = _size()

    def lengths(self) -> Tuple[float, ...]:
        return (self.radius, self.height)


@dataclass(frozen=True)
class _Box(_Entry):
    size: np.ndarray = field(metadata={"length": 3, "min": 1e-3, "max": _REACH})

    def lengths(self) -> Tuple[float, ...]:
        return tuple(self.size)


_MOVES = ("velocity", "motion", "appear")
_SHAPES = {"sphere": _Sphere, "cylinder": _Cylinder, "box": _Box}


def load_obstacles(data: Any, source: str) -> Tuple[Obstacle, ...]:
    """Return the obstacles of a list of mappings; None is an empty list.

    Those that move are returned where they begin, those that appear later not at all.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if data is None:
        return ()
    if not isinstance(data, list):
        raise ConfigError(source, "obstacles", data, "a list of mappings")
    obstacles = []
    for i, item in enumerate(data):
        key = f"obstacles[{i}]"
        if not isinstance(item, dict):
            raise ConfigError(source, key, item, "a mapping with id, shape, position and size")
        options = dict(item)
        shape = options.pop("shape", "sphere")
        if not isinstance(shape, str) or shape not in _SHAPES:
            raise ConfigError(source, f"{key}.shape", shape, f"one of {', '.join(_SHAPES)}")
        given = {name: options.pop(name) for name in _MOVES if name in options}
        moves = from_dict(_Moves, given, source, key)
        entry = from_dict(_SHAPES[shape], options, source, key)
        if not entry.id or entry.id in [other.id for other in obstacles]:
            raise ConfigError(source, f"{key}.id", entry.id, "a name that no other obstacle has")
        if moves.appear is None:
            size = np.array(entry.lengths())
            obstacles.append(Obstacle(entry.id, entry.position, size, shape, moves.velocity))
    return tuple(obstacles)
