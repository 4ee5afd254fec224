# SPDX-License-Identifier: MIT
"""Parameters of the guard; values live in ``config/guard.yaml``, here is what they mean."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Optional

from nmpc_control.braking import BrakeParameters
from nmpc_control.config import config_directory, from_dict, load_profile, load_yaml, overlay
from nmpc_control.dji import SetpointLimits, Switch
from nmpc_control.evasion import EvasionParameters
from nmpc_control.link_watch import LinkParameters
from nmpc_control.mode_inputs import ModeParameters
from nmpc_control.params import Disturbance
from nmpc_control.stopping import StoppingParameters
from nmpc_control.verdict import PlanCheckParameters
from nmpc_control.watch import WatchParameters


def _positive() -> float:
    return field(metadata={"min": 1e-3})


@dataclass(frozen=True)
class GuardParameters:
    """Everything the guard needs beside vehicle and input limits."""

    rate: float = field(metadata={"min": 10.0, "max": 50.0})  # [Hz] of commands
    world_frame: str = field()  # frame of plans and obstacles
    vertical_command: str = field(metadata={"choices": ("thrust", "velocity")})
    vertical_lead: float = field(metadata={"min": 0.0, "max": 1.0})  # [s] of that velocity loop
    hold_timeout: float = _positive()  # [s] in which the controller must obey `hover`
    reference_retry: float = _positive()  # [s] between requests for a local position reference
    height_speed: float = _positive()  # [m/s] below it a height counts as steady
    rc_switch: Switch = field()
    setpoint_limits: SetpointLimits = field()
    modes: ModeParameters = field()
    plan_check: PlanCheckParameters = field()
    link: LinkParameters = field()
    brake: BrakeParameters = field()
    stopping: StoppingParameters = field()
    evasion: EvasionParameters = field()
    disturbance: Disturbance = field()
    watch: WatchParameters = field()


def load_guard_parameters(directory: Optional[Path] = None, profile: str = "") -> GuardParameters:
    """Return the parameters of ``config/guard.yaml``; raises ConfigError.

    ``profile`` names a file of ``config/profiles`` whose values win over guard.yaml's.
    """
    directory = directory or config_directory()
    path = directory / "guard.yaml"
    changes = load_profile(profile, "guard", directory)
    data = overlay(load_yaml(path), changes, f"{profile}.yaml", "guard")
    return from_dict(GuardParameters, data, path.name)
