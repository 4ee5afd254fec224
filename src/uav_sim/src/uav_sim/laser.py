# SPDX-License-Identifier: MIT
"""A 2D laser scanner on the aircraft that sees obstacles, other aircraft and the ground.

Interface: ``Laser(load_laser(name_or_path), seed)``; ``due(t)`` says when to scan, ``scan(position,
rpy, states)`` returns ranges (n,) [m] for ``angles`` (n,) [rad], counter-clockwise, 0 ahead.

The scan plane is fixed to the airframe and tilts with it, so that a tilted plane cuts a sphere
beside its equator and meets the ground; with ``level`` a gimbal keeps it horizontal. One scan is
taken at one instant. As in REP 117, inf: nothing within range; -inf: nearer than ``range_min``.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import List, Sequence, Tuple

import numpy as np

from uav_sim.body import BodyState
from uav_sim.config import config_directory, from_dict, load_yaml
from uav_sim.errors import ConfigError
from uav_sim.motion import Vector
from uav_sim.noise import generator


@dataclass(frozen=True)
class LaserParameters:
    """One scanner and its mount; ``config/lasers/utm_30lx.yaml`` has the sources."""

    name: str
    rate: float = field(metadata={"min": 0.1, "max": 200.0})  # [Hz]
    angle_min: float = field(metadata={"min": -math.pi, "max": math.pi})  # [rad]
    angle_max: float = field(metadata={"min": -math.pi, "max": math.pi})  # [rad]
    angle_increment: float = field(metadata={"min": 1e-4})  # [rad]
    range_min: float = field(metadata={"min": 0.0})  # [m]
    range_max: float = field(metadata={"min": 1e-2})  # [m]
    noise: float = field(metadata={"min": 0.0})  # [m] sigma
    level: bool = field()  # the scan plane is kept horizontal
    sees_ground: bool = field()
    mount_position: Tuple[float, float, float] = field()  # [m] in body axes, FLU
    mount_rpy: Tuple[float, float, float] = field()  # [rad] of the scanner in body axes


class Laser:
    """The scanner of one aircraft."""

    def __init__(self, parameters: LaserParameters, seed: str = "0") -> None:
        self.parameters = p = parameters
        count = math.floor((p.angle_max - p.angle_min) / p.angle_increment + 1e-6) + 1
        self.angles = p.angle_min + p.angle_increment * np.arange(count)  # (n,) [rad]
        plane = np.stack([np.cos(self.angles), np.sin(self.angles), np.zeros(count)])
        self._beams = rotation(p.mount_rpy) @ plane  # (3, n) in body axes
        self._noise = generator(f"{seed}/laser")
        self._scans = 0

    def due(self, t: float) -> bool:
        """Return whether a scan is due at ``t`` [s]; True once for each scan."""
        if t + 1e-9 < self._scans / self.parameters.rate:
            return False
        self._scans += 1
        return True

    @np.errstate(divide="ignore", invalid="ignore")  # beams beside or along a surface
    def scan(self, position: Vector, rpy: Vector, states: Sequence[BodyState]) -> np.ndarray:
        """Return ranges (n,) [m].

        Args:
            position: true position (3,) [m] of the aircraft, world frame.
            rpy: its true roll, pitch, yaw [rad].
            states: what there is to see.
        """
        p = self.parameters
        attitude = rotation((0.0, 0.0, rpy[2]) if p.level else rpy)
        origin = np.asarray(position) + attitude @ np.asarray(p.mount_position)
        beams = attitude @ self._beams
        ranges = np.full(beams.shape[1], np.inf)
        if p.sees_ground:
            ranges = np.where(beams[2] < 0.0, -origin[2] / beams[2], np.inf)
        for state in states:
            obstacle = state.obstacle
            offset = origin - np.asarray(state.position)
            if obstacle.distance(*offset) <= p.range_max:
                enter = _INTERSECTIONS[obstacle.shape](offset, beams, obstacle.size)
                ranges = np.minimum(ranges, enter)
        if p.noise > 0.0:
            ranges = ranges + self._noise.normal(0.0, p.noise, ranges.shape)
        ranges[ranges > p.range_max] = np.inf
        ranges[ranges < p.range_min] = -np.inf
        return ranges


def rotation(rpy: Sequence[float]) -> np.ndarray:
    """Return the matrix (3, 3) from body to world axes, Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def load_laser(name_or_path: str) -> LaserParameters:
    """Return a scanner of ``config/lasers``, or by path: what ends in .yaml or has a separator.

    Raises:
        ConfigError: no such scanner, or one that is wrong.
    """
    names = laser_names()
    if name_or_path.endswith((".yaml", ".yml")) or "/" in name_or_path:
        path = Path(name_or_path).expanduser()
    elif name_or_path in names:
        path = config_directory() / "lasers" / f"{name_or_path}.yaml"
    else:
        expected = f"a path to a .yaml file, or one of {', '.join(names)}"
        raise ConfigError("laser", "name", name_or_path, expected)
    laser = from_dict(LaserParameters, load_yaml(path), path.name)
    if laser.angle_max <= laser.angle_min:
        expected = f"more than angle_min {laser.angle_min:g}"
        raise ConfigError(path.name, "angle_max", laser.angle_max, expected)
    if laser.range_max <= laser.range_min:
        expected = f"more than range_min {laser.range_min:g}"
        raise ConfigError(path.name, "range_max", laser.range_max, expected)
    return laser


def laser_names() -> List[str]:
    """Return the names of the scanners that exist."""
    return sorted(path.stem for path in (config_directory() / "lasers").glob("*.yaml"))


def _round(offset: np.ndarray, beams: np.ndarray, radius: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return where beams (k, n) enter and leave a ball of k dimensions about the origin."""
    a, b = (beams * beams).sum(axis=0), offset @ beams
    c = float(offset @ offset) - radius * radius
    root = np.sqrt(b * b - a * c)
    enter, leave = (-b - root) / a, (-b + root) / a
    parallel = a < 1e-15  # along the axis of a cylinder: inside for ever, or never
    enter = np.where(parallel, -np.inf if c < 0.0 else np.inf, enter)
    return enter, np.where(parallel, np.inf if c < 0.0 else -np.inf, leave)


def _slab(offset: float, beams: np.ndarray, half: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return where beams (n,) enter and leave the slab between -half and half of one axis."""
    with np.errstate(over="ignore"):  # nearly parallel: infinitely far
        near, far = (-half - offset) / beams, (half - offset) / beams
    parallel, inside = beams == 0.0, abs(offset) < half
    enter = np.where(parallel, -np.inf if inside else np.inf, np.minimum(near, far))
    return enter, np.where(parallel, np.inf if inside else -np.inf, np.maximum(near, far))


def _first(parts: Sequence[Tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return where beams first meet what lies in all parts; 0 inside it, inf where never."""
    enter = np.max([part[0] for part in parts], axis=0)
    leave = np.min([part[1] for part in parts], axis=0)
    return np.where((enter < leave) & (leave > 0.0), np.maximum(enter, 0.0), np.inf)


def _sphere(offset: np.ndarray, beams: np.ndarray, size: Sequence[float]) -> np.ndarray:
    return _first([_round(offset, beams, size[0])])


def _cylinder(offset: np.ndarray, beams: np.ndarray, size: Sequence[float]) -> np.ndarray:
    side = _round(offset[:2], beams[:2], size[0])
    return _first([side, _slab(offset[2], beams[2], 0.5 * size[1])])


def _box(offset: np.ndarray, beams: np.ndarray, size: Sequence[float]) -> np.ndarray:
    return _first([_slab(offset[k], beams[k], 0.5 * size[k]) for k in range(3)])


_INTERSECTIONS = {"sphere": _sphere, "cylinder": _cylinder, "box": _box}
