# SPDX-License-Identifier: MIT
"""Scenarios: what is flown, how fast, among which obstacles; read from hand-written YAML.

``config/scenario_template.yaml`` explains every key.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, Optional, Tuple

import numpy as np

from nmpc_control.config import config_directory, from_dict, load_yaml, number
from nmpc_control.curves import CurveError
from nmpc_control.errors import ConfigError
from nmpc_control.obstacle_entry import load_obstacles
from nmpc_control.reference_types import Pace, build_trajectory
from nmpc_control.trajectory import Trajectory, waypoints

VEHICLE_RADIUS = 0.5  # [m] hull that must be free at the start and at the end
WAYPOINT_SPEED = 0.35  # [m/s] where waypoints come without a speed, the paper's

_MAX_SPEED = 20.0  # [m/s]
_MAX_DURATION = 3600.0  # [s]
_CHECK_SAMPLES = 2000


@dataclass(frozen=True)
class Scenario:
    """One flight to fly: reference, surroundings and tuning."""

    name: str
    description: str
    trajectory: Trajectory
    obstacles: tuple  # of state.Obstacle
    room: Optional[Tuple[np.ndarray, np.ndarray]]  # [m] least and greatest corner (3,), or None
    weights: str  # preset: a file under config/weights
    initial_position: np.ndarray  # (3,) [m] where a simulation without take-off begins, at rest
    spawn: np.ndarray  # (3,) [m] where the simulated aircraft stands before take-off
    variant: Optional[str] = None

    @property
    def speed(self) -> float:
        """Mean speed [m/s]: length of the reference by its duration."""
        return self.trajectory.length / self.trajectory.duration

    @property
    def start(self) -> np.ndarray:
        """First point (3,) [m] of the reference."""
        return self.trajectory.start

    @property
    def start_yaw(self) -> float:
        """Yaw [rad] at the start of the reference."""
        return float(self.trajectory.sample(0.0).yaw[0])

    @property
    def end(self) -> np.ndarray:
        """Last point (3,) [m] of the reference."""
        return self.trajectory.end


@dataclass(frozen=True)
class _Room:
    min: np.ndarray = field(metadata={"length": 3})
    max: np.ndarray = field(metadata={"length": 3})


@dataclass(frozen=True)
class _File:
    reference: Any
    name: Optional[str] = None
    description: str = ""
    speed: Optional[float] = field(default=None, metadata={"min": 0.01, "max": _MAX_SPEED})
    duration: Optional[float] = field(default=None, metadata={"min": 0.1, "max": _MAX_DURATION})
    yaw: Any = 0.0
    obstacles: Any = None
    room: Optional[_Room] = None
    weights: str = "outdoor"
    initial_position: Optional[np.ndarray] = field(default=None, metadata={"length": 3})
    spawn: np.ndarray = field(default_factory=lambda: np.zeros(3), metadata={"length": 3})


def scenario_directory() -> Path:
    """Return the folder of the named scenarios."""
    return config_directory() / "scenarios"


def list_scenarios() -> Tuple[str, ...]:
    """Return the names of all scenarios that come with the package."""
    return tuple(sorted(path.stem for path in scenario_directory().glob("*.yaml")))


def scenario_path(name_or_path: str) -> Path:
    """Return the file of a scenario: what ends in .yaml or contains a separator is a path.

    Raises:
        ConfigError: no scenario of that name.
    """
    if name_or_path.endswith((".yaml", ".yml")) or "/" in name_or_path or "\\" in name_or_path:
        if name_or_path.isprintable():
            return Path(name_or_path).expanduser()
    elif name_or_path in list_scenarios():
        return scenario_directory() / f"{name_or_path}.yaml"
    expected = f"a path to a .yaml file, or one of {', '.join(list_scenarios())}"
    raise ConfigError("scenario", "name", name_or_path, expected)


def load_scenario(
    name_or_path: str,
    variant: Optional[str] = None,
    speed: Optional[float] = None,
    duration: Optional[float] = None,
    vehicle_radius: float = VEHICLE_RADIUS,
) -> Scenario:
    """Return a scenario by name, or by path: what ends in .yaml or contains a separator.

    Args:
        name_or_path: one of ``list_scenarios()``, or a path.
        variant: key under ``variants:`` whose values replace those of the file.
        speed: mean speed [m/s] instead of the file's speed or duration.
        duration: [s] instead of the file's speed or duration.
        vehicle_radius: hull [m] that must be free of obstacles at the start and at the end.

    Raises:
        ConfigError: naming file, key, value and what was expected.
    """
    path = scenario_path(name_or_path)
    data = load_yaml(path)
    source = path.name
    data = _overlay(data, data.pop("variants", {}), variant, source)
    given = {"speed": speed, "duration": duration}
    for key, value in given.items():
        if value is not None:
            data = {k: v for k, v in data.items() if k not in given}
            data[key] = value
    if speed is not None and duration is not None:
        raise ConfigError(
            source, "speed", speed, f"a speed or a duration, not both (duration {duration!r})"
        )
    return _build(data, source, path.stem, variant, vehicle_radius)


def scenario_from_waypoints(points: np.ndarray, speed: Optional[float] = None) -> Scenario:
    """Return flying the B-spline through points (n, 3) [m] at a mean speed [m/s], no obstacles.

    Raises:
        ConfigError: naming what cannot be used.
    """
    speed = number(
        WAYPOINT_SPEED if speed is None else speed, "waypoints", "speed", 0.01, _MAX_SPEED
    )
    try:
        trajectory = waypoints(points, speed)
    except CurveError as error:
        raise ConfigError("waypoints", error.argument, error.value, error.expected) from None
    description = f"{len(points)} waypoints given by the operator"
    return Scenario(
        "waypoints", description, trajectory, (), None, "outdoor", trajectory.start, np.zeros(3)
    )


def _overlay(
    data: Dict[str, Any], variants: Any, variant: Optional[str], source: str
) -> Dict[str, Any]:
    """Return the data with a variant's values; a reference without a type keeps its other keys."""
    if not isinstance(variants, dict) or not all(isinstance(v, dict) for v in variants.values()):
        raise ConfigError(
            source, "variants", variants, "a mapping of names to mappings of keys to values"
        )
    if variant is None:
        return data
    if variant not in variants:
        known = ", ".join(str(name) for name in variants) or "none: this scenario has no variants"
        raise ConfigError(source, "variants", variant, f"one of {known}")
    changes = variants[variant]
    if "speed" in changes or "duration" in changes:
        data = {key: value for key, value in data.items() if key not in ("speed", "duration")}
    result = {**data, **changes}
    old, new = data.get("reference"), changes.get("reference")
    if isinstance(old, dict) and isinstance(new, dict) and "type" not in new:
        result["reference"] = {**old, **new}
    return result


def _build(
    data: Dict[str, Any], source: str, stem: str, variant: Optional[str], vehicle_radius: float
) -> Scenario:
    entry = from_dict(_File, data, source)
    name = stem if entry.name is None else entry.name
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]{0,63}", name):
        raise ConfigError(source, "name", name, "a letter, then letters, digits, _ or -")
    if (entry.speed is None) == (entry.duration is None):
        expected = "a speed or a duration, and not both"
        raise ConfigError(source, "speed", entry.speed, expected)
    presets = sorted(path.stem for path in (config_directory() / "weights").glob("*.yaml"))
    if entry.weights not in presets:
        raise ConfigError(source, "weights", entry.weights, f"one of {', '.join(presets)}")
    trajectory = build_trajectory(
        entry.reference, Pace(entry.speed, entry.duration), entry.yaw, source
    )
    scenario = Scenario(
        name=name,
        description=entry.description,
        trajectory=trajectory,
        obstacles=load_obstacles(entry.obstacles, source),
        room=None if entry.room is None else (entry.room.min, entry.room.max),
        weights=entry.weights,
        initial_position=trajectory.start
        if entry.initial_position is None
        else entry.initial_position,
        spawn=entry.spawn,
        variant=variant,
    )
    _check_room(scenario, source)
    _check_free(scenario, source, vehicle_radius)
    return scenario


def _check_room(scenario: Scenario, source: str) -> None:
    if scenario.room is None:
        return
    low, high = scenario.room
    if not (low < high).all():
        raise ConfigError(
            source, "room.max", high.tolist(), f"more than room.min {low.tolist()} on every axis"
        )
    times = np.linspace(0.0, scenario.trajectory.duration, _CHECK_SAMPLES)
    for point in scenario.trajectory.sample(times).position:
        if (point < low - 1e-6).any() or (point > high + 1e-6).any():
            box = f"{low.tolist()} to {high.tolist()}"
            where = np.round(point, 2).tolist()
            raise ConfigError(
                source, "room", box, f"a box that holds the whole reference, also its point {where}"
            )


def _check_free(scenario: Scenario, source: str, vehicle_radius: float) -> None:
    places = {
        "start": scenario.start,
        "end": scenario.end,
        "initial_position": scenario.initial_position,
    }
    for obstacle in scenario.obstacles:
        for place, point in places.items():
            clearance = float(obstacle.distance(point))
            if clearance < vehicle_radius:
                where = f"the {place} {np.round(point, 2).tolist()}"
                expected = f"{vehicle_radius:g} m or more from its surface to {where}"
                raise ConfigError(
                    source, f"obstacles.{obstacle.id}", f"{clearance:.2f} m", expected
                )
