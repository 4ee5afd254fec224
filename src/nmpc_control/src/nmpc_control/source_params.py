# SPDX-License-Identifier: MIT
"""Parameters of the state's sources; values live in ``config/sources.yaml``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional, Tuple

from nmpc_control.config import config_directory, from_dict, load_yaml
from nmpc_control.errors import ConfigError

GPS, VICON, WORLD_POSITION = "gps", "vicon", "world_position"
SOURCES = (GPS, VICON, WORLD_POSITION)


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _latency() -> float:
    return field(metadata={"min": 0.0, "max": 0.5})


@dataclass(frozen=True)
class SourceParameters:
    """One source of positions: how late, how exact, and what of it is believed."""

    latency: float = _latency()  # [s] from motion to stamp
    velocity: str = field(metadata={"choices": ("telemetry", "filter")})
    sigma: float = _positive()  # [m] white noise of a sample
    jerk: float = _positive()  # [m/s^2.5] density of the acceleration's random walk
    gate: float = _positive()  # [m] off the expected place: not believed
    gate_speed: float = _positive()  # [m/s] by which that widens while nothing is heard
    still: float = _positive()  # [m] that the velocity leads while samples repeat: not believed
    jump_time: float = _positive()  # [s] of samples that agree with each other: the new truth


@dataclass(frozen=True)
class SwitchingParameters:
    """When one source may follow another in flight, and how softly."""

    max_distance: float = _positive()  # [m] farther apart they are not in the same frame
    max_speed: float = _positive()  # [m/s] by which their velocities may differ
    blend_time: float = _positive()  # [s] least time in which the difference is let go
    blend_speed: float = _positive()  # [m/s] most by which position is moved for it


@dataclass(frozen=True)
class SourcesParameters:
    """All sources, and which of them is flown on."""

    position_source: str = field(metadata={"choices": SOURCES})  # at start
    standby: str = field()  # heard beside it; names with commas between them
    vicon_frame: str = field()  # child frame on /tf
    telemetry_latency: float = _latency()  # [s] of dji_sdk's attitude, IMU, velocity
    alive_time: float = _positive()  # [s] a source silent for longer is dead
    switching: SwitchingParameters = field()
    yaw_time: float = _positive()  # [s] over which the yaws of Vicon and dji_sdk are compared
    gps: SourceParameters = field()
    vicon: SourceParameters = field()
    world_position: SourceParameters = field()

    def __post_init__(self) -> None:
        """Raise ConfigError for a name in ``standby`` that is no source."""
        for name in self._standby:
            if name not in SOURCES:
                expected = f"names among {', '.join(SOURCES)}, with commas between them"
                raise ConfigError("sources", "standby", self.standby, expected)

    @property
    def heard(self) -> Tuple[str, ...]:
        """The sources that are listened to: the one flown on first."""
        others = (name for name in SOURCES if name in self._standby)
        return (self.position_source, *(n for n in others if n != self.position_source))

    def of(self, name: str) -> SourceParameters:
        """Return the parameters of one source."""
        return getattr(self, name)

    @property
    def _standby(self) -> Tuple[str, ...]:
        return tuple(name.strip() for name in self.standby.split(",") if name.strip())


def load_source_parameters(
    directory: Optional[Path] = None,
    position_source: str = "",
    standby: str = "",
    vicon_frame: str = "",
) -> SourcesParameters:
    """Return the parameters of ``config/sources.yaml``, with what is given in its place.

    Raises ConfigError.
    """
    path = (directory or config_directory()) / "sources.yaml"
    given = {"position_source": position_source, "standby": standby, "vicon_frame": vicon_frame}
    data = {**load_yaml(path), **{key: value for key, value in given.items() if value}}
    return from_dict(SourcesParameters, data, path.name)
