# SPDX-License-Identifier: MIT
"""Obstacles of the simulated world: spheres, vertical cylinders and axis-aligned boxes.

Interface: ``Obstacle`` is what a scenario says (shape, place, how it moves); where it is now, also
when it chases or has just appeared, is a ``scene.Body``. ``load_obstacles`` reads the YAML list.
"""

import math
from dataclasses import dataclass
from typing import Any, Mapping, Optional, Tuple

from uav_sim.config import number, numbers
from uav_sim.errors import ConfigError
from uav_sim.motion import STILL, Appear, Line, Motion, Vector
from uav_sim.motion_entry import load_appear, load_motion

GROUND = "ground"  # id of the collision that a crash on the ground is; no obstacle's
# Keys that give the size [m] of each shape, with how many numbers each.
_SIZE_KEYS = {
    "sphere": (("radius", 1),),
    "cylinder": (("radius", 1), ("height", 1)),
    "box": (("size", 3),),
}
_OPTIONAL_KEYS = ("shape", "velocity", "motion", "appear")
_MIN_SIZE = 1e-3  # [m]
_SEARCH_STEPS = 40  # golden section: shrinks a step's path to 4e-9 of itself
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Obstacle:
    """A body that must not be touched, and how it moves."""

    id: str
    shape: str  # sphere, cylinder or box
    size: Tuple[float, ...]  # [m] (radius,), (radius, height) or full edge lengths (3,)
    position: Vector  # [m] centre when its motion begins, world frame
    velocity: Vector = STILL  # [m/s] of an obstacle without ``motion``
    motion: Optional[Motion] = None  # None: straight at ``velocity``
    appear: Optional[Appear] = None  # None: there from t = 0 on

    @property
    def path(self) -> Motion:
        """How it moves."""
        return self.motion or Line(self.position, self.velocity)

    def distance(self, x: float, y: float, z: float) -> float:
        """Return the distance [m] to the surface at an offset [m] from the centre; < 0 inside."""
        if self.shape == "sphere":
            return math.sqrt(x * x + y * y + z * z) - self.size[0]
        if self.shape == "cylinder":
            a, b, c = math.hypot(x, y) - self.size[0], abs(z) - 0.5 * self.size[1], -math.inf
        else:
            sx, sy, sz = self.size
            a, b, c = abs(x) - 0.5 * sx, abs(y) - 0.5 * sy, abs(z) - 0.5 * sz
        outside = math.sqrt(max(a, 0.0) ** 2 + max(b, 0.0) ** 2 + max(c, 0.0) ** 2)
        return outside + min(max(a, b, c), 0.0)

    def nearest(self, start: Vector, end: Vector) -> Tuple[float, float]:
        """Return the least distance [m] along a straight path, and where on it in 0..1.

        Args:
            start: offset (3,) [m] to the centre at the beginning.
            end: the same at the end.
        """
        ax, ay, az = start
        dx, dy, dz = end[0] - ax, end[1] - ay, end[2] - az
        if self.shape == "sphere":
            length = dx * dx + dy * dy + dz * dz
            s = -(ax * dx + ay * dy + az * dz) / length if length > 0.0 else 0.0
            s = min(max(s, 0.0), 1.0)
            return self.distance(ax + s * dx, ay + s * dy, az + s * dz), s

        def at(s: float) -> float:
            return self.distance(ax + s * dx, ay + s * dy, az + s * dz)

        # Distance to a convex body is convex along a line: golden section finds the minimum.
        low, high = 0.0, 1.0
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        d_left, d_right = at(left), at(right)
        for _ in range(_SEARCH_STEPS):
            if d_left < d_right:
                high, right, d_right = right, left, d_left
                left = high - _GOLDEN * (high - low)
                d_left = at(left)
            else:
                low, left, d_left = left, right, d_right
                right = low + _GOLDEN * (high - low)
                d_right = at(right)
        return min((at(0.0), 0.0), (d_left, left), (at(1.0), 1.0))


def load_obstacles(data: Any, source: str) -> Tuple[Obstacle, ...]:
    """Return the obstacles of a scenario's list; None is an empty one.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if data is None:
        return ()
    if not isinstance(data, list):
        raise ConfigError(source, "obstacles", data, "a list of mappings")
    obstacles = []
    for i, item in enumerate(data):
        obstacle = _load(item, source, f"obstacles[{i}]")
        if obstacle.id in [other.id for other in obstacles]:
            raise ConfigError(source, f"obstacles[{i}].id", obstacle.id, "an id used only once")
        obstacles.append(obstacle)
    return tuple(obstacles)


def _load(item: Any, source: str, key: str) -> Obstacle:
    if not isinstance(item, Mapping):
        raise ConfigError(source, key, item, "a mapping with id, shape, position and size")
    shape = item.get("shape", "sphere")
    if not isinstance(shape, str) or shape not in _SIZE_KEYS:
        raise ConfigError(source, f"{key}.shape", shape, f"one of {', '.join(_SIZE_KEYS)}")
    size_keys = _SIZE_KEYS[shape]
    names = [name for name, _ in size_keys]
    known = ["id", "position", *names, *_OPTIONAL_KEYS]
    for name in item:
        if name not in known:
            raise ConfigError(source, f"{key}.{name}", item[name], f"one of {', '.join(known)}")
    for name in ("id", "position", *names):
        if name not in item:
            raise ConfigError(source, f"{key}.{name}", None, "a value, but the key is missing")
    if not isinstance(item["id"], str) or item["id"] in ("", GROUND):
        raise ConfigError(source, f"{key}.id", item["id"], f"a name, and not {GROUND!r}")
    size = []
    for name, length in size_keys:
        value = item[name] if length > 1 else [item[name]]
        if length == 1:
            number(item[name], source, f"{key}.{name}", _MIN_SIZE)
        size.extend(numbers(value, source, f"{key}.{name}", length, _MIN_SIZE))
    position: Vector = numbers(item["position"], source, f"{key}.position", 3)
    motion = load_motion(item, position, source, key)
    velocity = motion.step if isinstance(motion, Line) else STILL
    motion = motion if item.get("motion") else None
    appear = load_appear(item.get("appear"), source, f"{key}.appear")
    return Obstacle(item["id"], shape, tuple(size), position, velocity, motion, appear)
