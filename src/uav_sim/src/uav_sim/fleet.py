# SPDX-License-Identifier: MIT
"""Several simulated M100 in one world and on one clock, each an obstacle to the others."""

import math
from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

from uav_sim.config import from_dict, numbers
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.errors import ConfigError
from uav_sim.faults.schedule import FaultLine
from uav_sim.laser import Laser, load_laser
from uav_sim.m100 import SimulatedM100
from uav_sim.plant import Vector
from uav_sim.preset import PACKET_PERIOD
from uav_sim.scene import Scene
from uav_sim.spread import any_preset
from uav_sim.telemetry import Packet
from uav_sim.world import World

ONLY = "aircraft"  # name of a vehicle that is alone


@dataclass(frozen=True)
class VehicleEntry:
    """One vehicle of a fleet."""

    name: str  # also its namespace
    spawn: Tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] in the air: hovering, motors on
    yaw: float = field(default=0.0, metadata={"min": -math.pi, "max": math.pi})  # [rad]
    preset: str = ""  # plant preset; empty: the fleet's
    disturbance: str = ""  # level; empty: the fleet's


@dataclass(frozen=True)
class FleetSettings:
    """What all vehicles share unless an entry says otherwise."""

    preset: str = "dji_hil"
    disturbance: str = "none"
    laser: str = ""  # scanner of ``config/lasers``; empty: none
    seed: int = 0
    changes: Optional[Dict[str, Any]] = None  # values that win over all presets
    source: str = "changes"  # where these come from, for the words of an error


class Fleet:
    """Vehicles by name; ``step`` advances all of them.

    They are placed first: what moves in the world begins anew with every vehicle placed.
    """

    def __init__(self, vehicles: Mapping[str, SimulatedM100]) -> None:
        self.vehicles: Dict[str, SimulatedM100] = dict(vehicles)
        self._first = next(iter(self.vehicles.values()))
        self._steps = 0
        delay = round(self._first.preset.delay.telemetry / self.step_time)
        self._phase = delay % self.steps_per_packet

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self._first.t

    @property
    def step_time(self) -> float:
        """Duration of a step [s]."""
        return self._first.preset.step

    @property
    def steps_per_packet(self) -> int:
        """Number of steps from one telemetry packet to the next."""
        return round(PACKET_PERIOD / self.step_time)

    @property
    def in_phase(self) -> bool:
        """Whether the last step ended when the first vehicle's undisturbed packets arrive."""
        return self._steps % self.steps_per_packet == self._phase

    def step(self) -> Dict[str, List[Packet]]:
        """Advance by a step; return the packets received in it, by vehicle, oldest first.

        Collisions are known when all have moved: in ``world.new_collisions`` of each.
        """
        self._steps += 1
        return {name: vehicle.step() for name, vehicle in self.vehicles.items()}

    def schedule(self, lines: Sequence[FaultLine]) -> None:
        """Schedule faults; one that names no vehicle befalls all. Raises ConfigError."""
        for line in lines:
            if line.vehicle is not None and line.vehicle not in self.vehicles:
                known = ", ".join(self.vehicles)
                raise ConfigError(line.source, "vehicle", line.vehicle, f"one of {known}")
            for name, vehicle in self.vehicles.items():
                if line.vehicle in (None, name):
                    line.apply(vehicle.faults)


def load_vehicles(data: Any, source: str) -> Tuple[VehicleEntry, ...]:
    """Return the entries of a list of mappings.

    Raises:
        ConfigError: naming source, key, value and what was expected.
    """
    if not isinstance(data, list) or not data:
        raise ConfigError(source, "vehicles", data, "a list of mappings with name and spawn")
    entries: List[VehicleEntry] = []
    for i, item in enumerate(data):
        key = f"vehicles[{i}]"
        entry = from_dict(VehicleEntry, item, source, key)
        if not entry.name.isidentifier() or entry.name in [other.name for other in entries]:
            expected = "letters, digits and _, used only once"
            raise ConfigError(source, f"{key}.name", entry.name, expected)
        if entry.spawn[2] < 0.0:
            raise ConfigError(source, f"{key}.spawn[2]", entry.spawn[2], "0 m or higher")
        entries.append(entry)
    return tuple(entries)


def one_vehicle(spawn: Any, source: str) -> VehicleEntry:
    """Return the only vehicle, at a place (3,) [m]; raises ConfigError."""
    place: Vector = numbers(spawn, source, "spawn", 3)
    if place[2] < 0.0:
        raise ConfigError(source, "spawn[2]", place[2], "a height not below the ground")
    return VehicleEntry(ONLY, place)


def make_fleet(
    entries: Sequence[VehicleEntry], settings: FleetSettings, scene: Scene, source: str
) -> Fleet:
    """Return vehicles in their places, with the obstacles of a scene around them.

    Raises:
        ConfigError: an unknown preset, level or laser, presets with different steps, a name that an
            obstacle has, or vehicles that touch each other.
    """
    vehicles: Dict[str, SimulatedM100] = {}
    for i, entry in enumerate(entries):
        key, preset_name = f"vehicles[{i}]", entry.preset or settings.preset
        preset = any_preset(preset_name, settings.changes, settings.source)
        for other, vehicle in zip(entries, vehicles.values()):
            gap = math.dist(entry.spawn, other.spawn) - preset.radius - vehicle.preset.radius
            if gap <= 0.0:
                raise ConfigError(source, f"{key}.spawn", entry.spawn, f"a place off {other.name}")
            if preset.step != vehicle.preset.step:
                expected = f"a preset with step {vehicle.preset.step:g} s"
                raise ConfigError(source, f"{key}.preset", preset_name, expected)
        if entry.name in [obstacle.id for obstacle in scene.obstacles]:
            raise ConfigError(source, f"{key}.name", entry.name, "a name that no obstacle has")
        level = load_disturbance(entry.disturbance or settings.disturbance)
        disturbance = Disturbance(level, settings.seed, entry.name)
        world = World(scene, preset.radius, entry.name)
        vehicle = vehicles[entry.name] = SimulatedM100(preset, world, disturbance)
        if settings.laser:
            vehicle.laser = Laser(load_laser(settings.laser), f"{settings.seed}/{entry.name}")
    for entry in entries:
        airborne = entry.spawn[2] > 0.0
        vehicles[entry.name].place(entry.spawn, yaw=entry.yaw, airborne=airborne)
    return Fleet(vehicles)
