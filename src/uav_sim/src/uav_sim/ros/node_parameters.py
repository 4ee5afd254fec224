# SPDX-License-Identifier: MIT
"""The simulator node's private ROS parameters."""

from dataclasses import dataclass
from typing import Any, Tuple

import rospy

from uav_sim.config import load_yaml, number
from uav_sim.errors import ConfigError
from uav_sim.faults.schedule import load_fault_file
from uav_sim.fleet import Fleet, FleetSettings, VehicleEntry, load_vehicles, make_fleet, one_vehicle
from uav_sim.obstacle import load_obstacles
from uav_sim.scene import Scene

_SOURCE = "parameter"


@dataclass(frozen=True)
class Settings:
    """What concerns the node, not the aircraft."""

    speed_factor: float
    paused: bool
    frame_id: str
    vicon_frame: str
    publish_clock: bool


def read_settings() -> Settings:
    """Return the node's own parameters; raises ConfigError."""
    speed_factor = rospy.get_param("~speed_factor", 1.0)
    return Settings(
        speed_factor=number(speed_factor, _SOURCE, "speed_factor", 0.0),
        paused=_flag("paused", False),
        frame_id=_name("frame_id", "world"),
        vicon_frame=_name("vicon_frame", "vicon_frame"),
        publish_clock=_flag("publish_clock", True),
    )


def read_fleet() -> Tuple[Fleet, bool]:
    """Return the vehicles in their places with all faults scheduled; True: in namespaces.

    Raises:
        ConfigError: a parameter or a file is wrong.
    """
    vehicles = rospy.get_param("~vehicles", []) or []
    path = _text("scenario_file")
    scenario = load_yaml(path) if path else {}
    source = path or _SOURCE
    scene = Scene(load_obstacles(scenario.get("obstacles"), source))
    changes = _text("settings_file")
    settings = FleetSettings(
        preset=_text("preset", "dji_hil"),
        disturbance=_text("disturbance", "none"),
        laser=_text("laser"),
        seed=_whole("seed"),
        changes=load_yaml(changes) if changes else None,
        source=changes,
    )
    entries: Tuple[VehicleEntry, ...]
    if vehicles:
        entries = load_vehicles(vehicles, _SOURCE)
        source = _SOURCE
    else:
        entries = (one_vehicle(scenario.get("spawn", [0.0, 0.0, 0.0]), source),)
    fleet = make_fleet(entries, settings, scene, source)
    faults = _text("fault_file")
    if faults:
        fleet.schedule(load_fault_file(faults))
    return fleet, bool(vehicles)


def _text(name: str, default: str = "") -> str:
    value: Any = rospy.get_param(f"~{name}", default)
    if not isinstance(value, str):
        raise ConfigError(_SOURCE, name, value, "text")
    return value


def _name(name: str, default: str) -> str:
    value = _text(name, default)
    if not value:
        raise ConfigError(_SOURCE, name, value, "a frame's name")
    return value


def _flag(name: str, default: bool) -> bool:
    value = rospy.get_param(f"~{name}", default)
    if not isinstance(value, bool):
        raise ConfigError(_SOURCE, name, value, "true or false")
    return value


def _whole(name: str) -> int:
    value = rospy.get_param(f"~{name}", 0)
    if not isinstance(value, int) or isinstance(value, bool):
        raise ConfigError(_SOURCE, name, value, "a whole number")
    return value
