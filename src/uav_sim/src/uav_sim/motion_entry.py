# SPDX-License-Identifier: MIT
"""The keys ``velocity``, ``motion`` and ``appear`` of an obstacle in a scenario file."""

import math
from typing import Any, Callable, Dict, Mapping, Optional, Tuple

from uav_sim.config import number, numbers
from uav_sim.errors import ConfigError
from uav_sim.motion import STILL, Appear, Chase, Circle, Line, Motion, Spline, Vector

_SMALL = 1e-3  # [m], [m/s], [m/s^2]: what counts as no distance, speed or acceleration
_FASTEST = 100.0  # [m/s]


def load_motion(item: Mapping[str, Any], position: Vector, source: str, key: str) -> Motion:
    """Return the motion of an obstacle's mapping; without ``motion``, straight at ``velocity``.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    step = numbers(item.get("velocity", STILL), source, f"{key}.velocity", 3)
    entry = item.get("motion")
    if entry is None:
        return Line(position, step)
    if not isinstance(entry, Mapping):
        raise ConfigError(source, f"{key}.motion", entry, "a mapping with type and its keys")
    kind = entry.get("type")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ConfigError(source, f"{key}.motion.type", kind, f"one of {', '.join(_KINDS)}")
    keys, load = _KINDS[kind]
    _check_keys(entry, ("type", *keys), source, f"{key}.motion")
    if kind != "line" and "velocity" in item:
        raise ConfigError(source, f"{key}.velocity", item["velocity"], f"no velocity with {kind}")
    return load(entry, position, step, source, f"{key}.motion")


def load_appear(entry: Any, source: str, key: str) -> Optional[Appear]:
    """Return when an obstacle appears; None: it is there from the beginning.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if entry is None:
        return None
    if not isinstance(entry, Mapping) or not entry:
        raise ConfigError(source, key, entry, "a mapping with at [s], within [m] or both")
    for name in entry:
        if name not in ("at", "within"):
            raise ConfigError(source, f"{key}.{name}", entry[name], "one of at, within")
    return Appear(**{k: number(v, source, f"{key}.{k}", 0.0) for k, v in entry.items()})


def _line(entry: Mapping, position: Vector, step: Vector, source: str, key: str) -> Line:
    if math.sqrt(sum(v * v for v in step)) < _SMALL:
        raise ConfigError(source, key, list(step), "a velocity beside it that is not zero")
    distance = number(entry["distance"], source, f"{key}.distance", _SMALL)
    return Line(position, step, distance, _end(entry, ("stop", "bounce"), source, key))


def _circle(entry: Mapping, position: Vector, step: Vector, source: str, key: str) -> Circle:
    x, y = numbers(entry["center"], source, f"{key}.center", 2)
    speed = number(entry["speed"], source, f"{key}.speed", -_FASTEST, _FASTEST)
    circle = Circle(position, (x, y), speed)
    if circle.radius < _SMALL:
        raise ConfigError(source, f"{key}.center", entry["center"], "a point beside the position")
    return circle


def _spline(entry: Mapping, position: Vector, step: Vector, source: str, key: str) -> Spline:
    given = entry["points"]
    if not isinstance(given, (list, tuple)) or not given:
        raise ConfigError(source, f"{key}.points", given, "a list of points after the position")
    points = [position]
    for i, point in enumerate(given):
        points.append(numbers(point, source, f"{key}.points[{i}]", 3))
        if math.dist(points[-1], points[-2]) < _SMALL:
            raise ConfigError(source, f"{key}.points[{i}]", point, "a point apart from the last")
    end = _end(entry, ("stop", "bounce", "loop"), source, key)
    if end == "loop" and math.dist(points[-1], position) < _SMALL:
        raise ConfigError(source, f"{key}.points", given, "a last point apart from the position")
    speed = number(entry["speed"], source, f"{key}.speed", _SMALL, _FASTEST)
    return Spline(tuple(points), speed, end)


def _chase(entry: Mapping, position: Vector, step: Vector, source: str, key: str) -> Chase:
    return Chase(
        number(entry["speed"], source, f"{key}.speed", _SMALL, _FASTEST),
        number(entry["acceleration"], source, f"{key}.acceleration", _SMALL),
    )


_KINDS: Dict[str, Tuple[Tuple[str, ...], Callable[..., Motion]]] = {
    "line": (("distance", "end"), _line),
    "circle": (("center", "speed"), _circle),
    "spline": (("points", "speed", "end"), _spline),
    "chase": (("speed", "acceleration"), _chase),
}


def _check_keys(entry: Mapping, keys: Tuple[str, ...], source: str, key: str) -> None:
    for name in entry:
        if name not in keys:
            raise ConfigError(source, f"{key}.{name}", entry[name], f"one of {', '.join(keys)}")
    for name in keys:
        if name not in entry:
            raise ConfigError(source, f"{key}.{name}", None, "a value, but the key is missing")


def _end(entry: Mapping, choices: Tuple[str, ...], source: str, key: str) -> str:
    if entry["end"] not in choices:
        raise ConfigError(source, f"{key}.end", entry["end"], f"one of {', '.join(choices)}")
    return str(entry["end"])
