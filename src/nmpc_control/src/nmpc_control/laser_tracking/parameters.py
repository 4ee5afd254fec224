# SPDX-License-Identifier: MIT
"""Parameters of the laser tracker; values live in ``config/laser_tracker.yaml``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional, Tuple

from nmpc_control.config import config_directory, from_dict, load_yaml
from nmpc_control.errors import ConfigError


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _not_negative() -> float:
    return field(metadata={"min": 0.0})


@dataclass(frozen=True)
class Mount:
    """Where the scanner sits."""

    position: Tuple[float, float, float] = field(metadata={"length": 3})  # [m] body axes, FLU
    rpy: Tuple[float, float, float] = field(metadata={"length": 3})  # [rad] in body axes
    level: bool = field()  # a gimbal keeps the scan plane horizontal


@dataclass(frozen=True)
class PoseParameters:
    """How far the aircraft's pose is to be trusted."""

    delay: float = field(metadata={"min": 0.0, "max": 1.0})  # [s] telemetry shows what was then
    max_age: float = _positive()  # [s] of telemetry at the time of a beam
    frame_time: float = _positive()  # [s] in which what is told follows a wandering position
    position_time: float = _positive()  # [s] in which a position wins over carried-on velocity
    attitude_time: float = _positive()  # [s] in which an attitude wins over carried-on body rates
    position_sigma: float = _not_negative()  # [m]
    heading_sigma: float = _not_negative()  # [rad]


@dataclass(frozen=True)
class EchoParameters:
    """What of a scan is believed."""

    max_beams: int = field(metadata={"min": 8, "max": 20000})  # [1] a longer scan is refused
    min_range: float = _not_negative()  # [m] nearer is the aircraft itself
    max_range: float = _positive()  # [m] farther is not tracked
    sigma: float = _positive()  # [m] of a range
    ground_height: float = field()  # [m] of flat ground in the world frame
    ground_margin: float = _not_negative()  # [m] echoes lower than this above it are ground
    ground_angle: float = _not_negative()  # [rad] the margin grows by this with range


@dataclass(frozen=True)
class ShapeParameters:
    """How echoes become cylinders."""

    jump: float = _positive()  # [m] gap within one surface, plus
    jump_slope: float = _positive()  # [1] this times the distance of two beams there
    max_skip: int = field(metadata={"min": 1, "max": 10})  # [1] neighbours looked at on each side
    min_points: int = field(metadata={"min": 2, "max": 100})  # [1] of a cluster
    radius: float = _positive()  # [m] expected, where the arc says little
    radius_sigma: float = _positive()  # [m]
    radius_min: float = _positive()  # [m]
    radius_max: float = _positive()  # [m] what is wider is a wall
    wall_piece: float = _positive()  # [m] length of wall for one cylinder
    wall_radius: float = _positive()  # [m] of that cylinder
    wall_bend: float = _positive()  # [m] off the straight line before a wall is split there
    max_detections: int = field(metadata={"min": 1, "max": 256})  # [1] nearest first
    headroom: float = _not_negative()  # [m] a cylinder reaches this far above its highest echo


@dataclass(frozen=True)
class TrackParameters:
    """How cylinders become tracks."""

    position_sigma: float = _positive()  # [m] least of a measured centre
    acceleration: float = _positive()  # [m^2/s^3] density of the white noise that turns velocity
    velocity_sigma: float = _positive()  # [m/s] of a new track
    gate: float = _positive()  # [1] squared Mahalanobis distance
    gate_distance: float = _positive()  # [m]
    confirm_hits: int = field(metadata={"min": 1, "max": 64})  # [1] of the last
    confirm_scans: int = field(metadata={"min": 1, "max": 64})  # [1] scans
    confirm_velocity_sigma: float = _positive()  # [m/s]
    missed_time: float = _positive()  # [s] seen through before it is gone
    coast_time: float = _positive()  # [s] hidden before it is forgotten
    coast_sigma: float = _positive()  # [m] of position, the same
    moving_speed: float = _positive()  # [m/s] above it for
    moving_time: float = _positive()  # [s] it moves
    static_speed: float = _positive()  # [m/s] below it for
    static_time: float = _positive()  # [s] it stands
    growth_sigmas: float = _positive()  # [1] sigmas of velocity that are told as growth
    max_growth: float = _positive()  # [m/s]
    max_tracks: int = field(metadata={"min": 1, "max": 256})  # [1]


@dataclass(frozen=True)
class LaserTrackerParameters:
    """Everything the laser tracker needs."""

    world_frame: str = field()
    scan_timeout: float = _positive()  # [s] without scans before it is said
    mount: Mount = field()
    pose: PoseParameters = field()
    echoes: EchoParameters = field()
    shapes: ShapeParameters = field()
    tracks: TrackParameters = field()


def load_laser_parameters(directory: Optional[Path] = None) -> LaserTrackerParameters:
    """Return the parameters of ``config/laser_tracker.yaml``.

    Raises:
        ConfigError: the file is missing, or a value is wrong or contradicts another.
    """
    path = (directory or config_directory()) / "laser_tracker.yaml"
    parameters = from_dict(LaserTrackerParameters, load_yaml(path), path.name)
    shapes, tracks, echoes = parameters.shapes, parameters.tracks, parameters.echoes
    for key, low, high in (
        ("shapes.radius", shapes.radius_min, shapes.radius),
        ("shapes.radius_max", shapes.radius, shapes.radius_max),
        ("shapes.wall_radius", 0.5 * shapes.wall_piece, shapes.wall_radius),
        ("tracks.confirm_scans", tracks.confirm_hits, tracks.confirm_scans),
        ("tracks.moving_speed", tracks.static_speed, tracks.moving_speed),
        ("echoes.max_range", echoes.min_range, echoes.max_range),
    ):
        if low > high:
            raise ConfigError(path.name, key, high, f"at least {low:g}")
    return parameters
