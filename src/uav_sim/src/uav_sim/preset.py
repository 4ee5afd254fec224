# SPDX-License-Identifier: MIT
"""What the simulated aircraft is: parameters of plant, link and flight controller."""

import math
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Union

from uav_sim.config import config_directory, from_dict, load_yaml, merged
from uav_sim.errors import ConfigError

PACKET_PERIOD = 0.01  # [s] between two packets of the M100's serial link (doc/dji_sdk.md 2.1)


def _number(low: float = 0.0, high: float = math.inf) -> float:
    return field(metadata={"min": low, "max": high})


def _whole(low: int, high: int) -> int:
    return field(metadata={"min": low, "max": high})


@dataclass(frozen=True)
class FirstOrder:
    """Response ``time_constant * x' = gain * reference - x``."""

    gain: float = _number()  # [1]
    time_constant: float = _number(1e-3)  # [s]


@dataclass(frozen=True)
class SecondOrder:
    """Response ``x'' = omega^2 (gain * reference - x) - 2 zeta omega x'``."""

    gain: float = _number()  # [1]
    omega: float = _number(1e-3)  # [rad/s]
    zeta: float = _number()  # [1]


Response = Union[FirstOrder, SecondOrder]


@dataclass(frozen=True)
class Thrust:
    """Affine map from DJI's thrust percentage to acceleration along body z, up to a limit."""

    slope: float = _number(1e-6)  # [m/s^2 per percent]
    offset: float = _number(-math.inf)  # [m/s^2]
    limit: float = _number()  # [m/s^2] what the rotors give at most

    def acceleration(self, percent: float) -> float:
        """Return the acceleration [m/s^2] of a percentage; propellers never push, 0 is idle."""
        if percent <= 0.0:
            return 0.0
        return min(max(0.0, self.slope * percent + self.offset), self.limit)

    def percent(self, acceleration: float) -> float:
        """Return the percentage for an acceleration [m/s^2]."""
        return (acceleration - self.offset) / self.slope


@dataclass(frozen=True)
class Drag:
    """Linear drag: deceleration per speed relative to the air, along the axes of a frame."""

    frame: str = field(metadata={"choices": ("heading", "world")})  # heading: forward, left, up
    x: float = _number()  # [1/s]
    y: float = _number()  # [1/s]
    z: float = _number()  # [1/s]


@dataclass(frozen=True)
class GroundEffect:
    """More thrust near the ground: Cheeseman and Bennett, 1955, 1 / (1 - (R / 4 z)^2)."""

    strength: float = _number(0.0, 4.0)  # [1] on the squared ratio; 0: off
    rotor_radius: float = _number(0.01)  # [m]
    rotor_height: float = _number(0.01)  # [m] of the rotors above the ground, standing

    def gain(self, z: float) -> float:
        """Return the thrust at a height [m] of the legs above the ground by that far away."""
        ratio = 0.25 * self.rotor_radius / (max(z, 0.0) + self.rotor_height)
        return 1.0 / (1.0 - min(self.strength * ratio * ratio, 0.5))


@dataclass(frozen=True)
class Touchdown:
    """What a touch-down may be; a harder one is a crash, after which the motors stay off."""

    speed: float = _number()  # [m/s] norm of the velocity
    tilt: float = _number()  # [rad] norm of roll and pitch

    def is_crash(self, speed: float, tilt: float) -> bool:
        """Whether a speed [m/s] or a tilt [rad] is too much."""
        return speed > self.speed or tilt > self.tilt


@dataclass(frozen=True)
class BatteryModel:
    """Discharge over time, and what a charge takes from the thrust."""

    flight_time: float = _number(1.0)  # [s] hover of the nominal aircraft from 100 to 0 percent
    idle_power: float = _number()  # [1] of the hover's, motors idle
    hover_full: float = _number(1.0, 100.0)  # [percent] of thrust, above the knee
    sag_slope: float = _number()  # [percent of thrust per percent of charge] below the knee
    sag_knee: float = _number(0.0, 100.0)  # [percent]
    cutoff: float = _number(0.1, 100.0)  # [percent] the voltage collapses from here
    empty_gain: float = _number(0.0, 1.0)  # [1] of the thrust that is left at 0 percent


@dataclass(frozen=True)
class Delay:
    """Dead times of the link, one per channel of the command and one for all telemetry."""

    attitude: float = _number()  # [s]
    thrust: float = _number()  # [s]
    yaw_rate: float = _number()  # [s]
    telemetry: float = _number()  # [s]


@dataclass(frozen=True)
class Limits:
    """Range of setpoints that the flight controller follows, beside the tilt limit."""

    angle: float = _number()  # [rad] of roll and of pitch, before the vector is limited
    yaw_rate: float = _number()  # [rad/s]
    thrust_min: float = _number(0.0, 100.0)  # [percent]
    thrust_max: float = _number(0.0, 100.0)  # [percent]
    vertical_velocity: float = _number()  # [m/s]
    horizontal_velocity: float = _number()  # [m/s]
    height: float = _number()  # [m] above take-off


@dataclass(frozen=True)
class RcValues:
    """Raw values of the RC's mode switch (P, A, F) and landing gear switch."""

    P: float = _number(-math.inf)
    A: float = _number(-math.inf)
    F: float = _number(-math.inf)
    gear_up: float = _number(-math.inf)
    gear_down: float = _number(-math.inf)


@dataclass(frozen=True)
class Loops:
    """Gains of the flight controller's own velocity, position, height and heading loops."""

    position: float = _number()  # [1/s]
    velocity: float = _number()  # [1/s]
    integral: float = _number()  # [1/s^2]
    height: float = _number()  # [1/s]
    vertical_velocity: float = _number()  # [1/s]
    vertical_integral: float = _number()  # [1/s^2]
    trim_limit: float = _number()  # [m/s^2]
    yaw: float = _number()  # [1/s]
    anchor_speed: float = _number()  # [m/s]


@dataclass(frozen=True)
class Undocumented:
    """What DJI's code and documents leave open; each choice stands in ``common.yaml``."""

    silence: str = field(metadata={"choices": ("hover", "level")})  # flown after cmd_timeout, in F
    stable_angle_holds: bool = field()
    tasks_need_authority: bool = field()
    authority_survives_toggle: bool = field()
    authority_time: float = _number()  # [s]
    wrong_mode_ack: int = _whole(0, 6)
    activation_ack: int = _whole(0, 0xFFFF)
    idle_flight_status: int = _whole(0, 5)
    velocity_z_sign: float = _number(-1.0, 1.0)  # [1]


@dataclass(frozen=True)
class FlightController:
    """Behaviour of the flight controller; what each number rests on stands in ``common.yaml``."""

    cmd_timeout: float = _number()  # [s]
    clamp: bool = field()
    setpoints_need_air: bool = field()
    limits: Limits = field()
    takeoff_height: float = _number()  # [m]
    takeoff_speed: float = _number()  # [m/s]
    spin_up_time: float = _number()  # [s]
    landing_speed: float = _number(0.05)  # [m/s]
    descent_speed: float = _number(0.05)  # [m/s]
    descent_time_constant: float = _number(1e-3)  # [s]
    touchdown_time: float = _number()  # [s]
    landed_time: float = _number()  # [s]
    go_home_height: float = _number()  # [m]
    rc_lost_time: float = _number()  # [s]
    battery_go_home: float = _number(0.0, 100.0)  # [percent] 0: never
    battery_land: float = _number(0.0, 100.0)  # [percent] 0: never
    rc: RcValues = field()
    loops: Loops = field()
    undocumented: Undocumented = field()


@dataclass(frozen=True)
class GeoPoint:
    """A place on earth."""

    latitude: float = _number(-90.0, 90.0)  # [deg]
    longitude: float = _number(-180.0, 180.0)  # [deg]
    altitude: float = _number(-math.inf)  # [m]


@dataclass(frozen=True)
class PlantPreset:
    """Everything that makes one simulated M100 different from another."""

    name: str
    mass: float = _number(0.1)  # [kg]
    radius: float = _number()  # [m] hull: centre to the outermost propeller tip
    roll: Response = field()
    pitch: Response = field()
    yaw_rate: Response = field()
    thrust: Thrust = field()
    rotor_time_constant: float = _number()  # [s] lag of the thrust behind its command; 0: none
    drag: Drag = field()
    tilt_limit: float = _number()  # [rad] norm of the commanded (roll, pitch)
    delay: Delay = field()
    step: float = _number(1e-4, PACKET_PERIOD)  # [s]
    gravity: float = _number()  # [m/s^2]
    gravity_const: float = _number()  # [m/s^2 per g] scale of the accelerometer
    ground_friction: float = _number()  # [1]
    ground_effect: GroundEffect = field()
    touchdown: Touchdown = field()
    payload: float = _number()  # [kg] on top of the mass
    battery: BatteryModel = field()
    home: GeoPoint = field()  # the world's origin
    flight_controller: FlightController = field()

    @property
    def hover_percent(self) -> float:
        """Thrust percentage that carries the nominal aircraft."""
        return self.thrust.percent(self.gravity)


def preset_names() -> List[str]:
    """Return the names of the presets that exist."""
    return sorted(path.stem for path in (config_directory() / "presets").glob("*.yaml"))


def load_preset(
    name: str, changes: Optional[Dict[str, Any]] = None, source: str = "changes"
) -> PlantPreset:
    """Return the preset of ``config/presets/<name>.yaml`` with the rest from ``common.yaml``.

    Args:
        name: of the preset.
        changes: values of the same keys that win over both files.
        source: where the changes come from, for the words of an error.

    Raises:
        ConfigError: no such preset, or one that is wrong.
    """
    if name not in preset_names():
        raise ConfigError("preset", "name", name, f"one of {', '.join(preset_names())}")
    directory = config_directory()
    path = directory / "presets" / f"{name}.yaml"
    data = {**load_yaml(directory / "common.yaml"), **load_yaml(path)}
    preset = from_dict(PlantPreset, data, path.name)
    if changes:
        preset = from_dict(PlantPreset, merged(data, changes), source)
    steps = PACKET_PERIOD / preset.step
    if abs(steps - round(steps)) > 1e-9:
        raise ConfigError(path.name, "step", preset.step, f"a divisor of {PACKET_PERIOD} s")
    return preset
