# SPDX-License-Identifier: MIT
"""Levels of disturbance: wind, sensors with errors, links that jitter, an aircraft off nominal.

Interface: ``Disturbance(load_disturbance(name_or_path), seed, vehicle)`` is given to
``SimulatedM100``; ``disturbance_names()`` lists ``config/disturbances``. What a level leaves at
zero is None here and costs nothing. Each concern draws from a random stream of its own, seeded by
seed, vehicle and concern: the same seed gives the same flight bit for bit, and changing one concern
does not change the others. Mean wind and gusts depend on the seed only, one air for all vehicles.
"""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any, List, Mapping, Optional

from uav_sim.config import config_directory, from_dict, load_yaml
from uav_sim.errors import ConfigError
from uav_sim.link import Channel, LinkParameters, TelemetryLink
from uav_sim.motion import Vector
from uav_sim.sensors import SensorParameters, Sensors
from uav_sim.vicon import Vicon, ViconParameters
from uav_sim.wind import Wind, WindParameters

# those that a packet brings; local_position is computed from gps_position when that arrives
TOPICS = (
    "rc",
    "attitude",
    "imu",
    "gps_health",
    "gps_position",
    "height_above_takeoff",
    "velocity",
    "battery_state",
    "flight_status",
    "gimbal_angle",
)


@dataclass(frozen=True)
class Spread:
    """The aircraft is drawn evenly within +- these shares of the nominal one."""

    thrust_gain: float = field(metadata={"min": 0.0, "max": 0.9})  # [1]
    mass: float = field(metadata={"min": 0.0, "max": 0.9})  # [1]


@dataclass(frozen=True)
class DisturbanceParameters:
    """One level."""

    name: str
    wind: WindParameters = field()
    sensors: SensorParameters = field()
    gps_health: int = field(metadata={"min": 0, "max": 5})  # [1] as the aircraft reports it
    obstacles_share_drift: bool = field()  # obstacles are sensed from the aircraft
    telemetry: LinkParameters = field()
    command: LinkParameters = field()
    vicon: ViconParameters = field()
    spread: Spread = field()
    topics: Any = None  # topic -> LinkParameters, in addition to telemetry


class Disturbance:
    """One draw of a level, for one aircraft; None stands for what is not disturbed."""

    def __init__(
        self, parameters: DisturbanceParameters, seed: int = 0, vehicle: str = "aircraft"
    ) -> None:
        self.parameters = p = parameters
        self.seed = seed
        self._vehicle = vehicle
        draw, spread = self.stream("aircraft"), p.spread
        self.thrust_gain = 1.0 + draw.uniform(-spread.thrust_gain, spread.thrust_gain)  # [1]
        self.mass_factor = 1.0 + draw.uniform(-spread.mass, spread.mass)  # [1]
        self.sensors: Optional[Sensors] = None
        if not p.sensors.is_perfect:
            self.sensors = Sensors(p.sensors, self._key("sensors"))
        self.telemetry: Optional[TelemetryLink] = None
        if not p.telemetry.is_perfect or not all(t.is_perfect for t in p.topics.values()):
            self.telemetry = TelemetryLink(p.telemetry, p.topics, self._key("telemetry"))
        self.command: Optional[Channel] = None
        if not p.command.is_perfect:
            self.command = Channel(p.command, self.stream("command"))
        self.vicon = Vicon(p.vicon, self._key("vicon")) if p.vicon.enabled else None

    @property
    def shift(self) -> Optional[Vector]:
        """How far (3,) [m] obstacles seem to be off their places; None: they never are."""
        is_shared = self.sensors is not None and self.parameters.obstacles_share_drift
        return self.sensors.shared_shift if is_shared else None

    def wind(self, step: float) -> Optional[Wind]:
        """Return the wind for a plant with steps of ``step`` [s]."""
        p = self.parameters.wind
        return None if p.is_calm else Wind(p, f"{self.seed}/wind", step)

    def stream(self, concern: str) -> Random:
        """Return the random stream of a concern, from its beginning."""
        return Random(self._key(concern))

    def _key(self, concern: str) -> str:
        return f"{self.seed}/{self._vehicle}/{concern}"


def disturbance_names() -> List[str]:
    """Return the names of the levels that exist, the mildest first."""
    order = ["none", "indoor", "outdoor", "harsh"]
    found = {path.stem for path in (config_directory() / "disturbances").glob("*.yaml")}
    return [name for name in order if name in found] + sorted(found - set(order))


def load_disturbance(name_or_path: str) -> DisturbanceParameters:
    """Return a level by its name, or by path: what ends in .yaml or contains a separator.

    Raises:
        ConfigError: no such level, or one that is wrong.
    """
    if name_or_path.endswith((".yaml", ".yml")) or "/" in name_or_path:
        path = Path(name_or_path).expanduser()
    elif name_or_path in disturbance_names():
        path = config_directory() / "disturbances" / f"{name_or_path}.yaml"
    else:
        expected = f"a path to a .yaml file, or one of {', '.join(disturbance_names())}"
        raise ConfigError("disturbance", "level", name_or_path, expected)
    data = load_yaml(path)
    topics = _topics(data.pop("topics", None), path.name)
    return dataclasses.replace(from_dict(DisturbanceParameters, data, path.name), topics=topics)


def _topics(data: Any, source: str) -> Mapping[str, LinkParameters]:
    if not isinstance(data, Mapping):
        raise ConfigError(source, "topics", data, "a mapping of topics to links, {} for none")
    for name in data:
        if name not in TOPICS:
            raise ConfigError(source, f"topics.{name}", data[name], f"one of {', '.join(TOPICS)}")
    return {k: from_dict(LinkParameters, v, source, f"topics.{k}") for k, v in data.items()}
