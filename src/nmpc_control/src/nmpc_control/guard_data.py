# SPDX-License-Identifier: MIT
"""What one tick of the guard sees and decides."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Optional, Sequence, Tuple

from nmpc_control.dji import Axes
from nmpc_control.estimator import StateEstimate
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode, ModeInputs
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import Goal, Plan


class Action(Enum):
    """What the node is asked to do beside sending the setpoint."""

    OBTAIN_AUTHORITY = "obtain authority"
    RELEASE_AUTHORITY = "release authority"
    TAKE_OFF = "take off"
    LAND = "land"
    SET_REFERENCE = "set the local position reference"
    HOLD = "tell the controller to hold"


@dataclass(frozen=True)
class GuardInputs:
    """What one tick sees."""

    t: float  # [s]
    telemetry: ModeInputs  # ages, RC, status, GPS, battery, authority, failure, request
    estimate: Optional[StateEstimate] = None
    height: float = math.nan  # [m] above take-off
    plan: Optional[Plan] = None  # came since the last tick
    plan_error: str = ""  # a plan came since the last tick that could not be read: why
    goal: Goal = Goal.HOLD  # of the plan
    obstacles: Sequence[Obstacle] = ()
    obstacles_stale: str = ""  # what is known of them is too old to be flown on: why


@dataclass(frozen=True)
class Command:
    """What one tick sends to the aircraft, and by which rung of the ladder."""

    rung: Rung
    axes: Optional[Axes] = None  # Joy axes to publish; None: silence
    applied: Optional[Tuple[float, ...]] = None  # (4,) input that the axes command, where known


@dataclass(frozen=True)
class GuardOutput:
    """What one tick decided."""

    mode: Mode
    rung: Rung
    reason: str
    axes: Optional[Axes] = None  # Joy axes to publish; None: silence
    applied: Optional[Tuple[float, ...]] = None  # (4,) input that the axes command, where known
    actions: Tuple[Action, ...] = ()
    answer: Optional[Tuple[bool, str]] = None  # to the request
    clearance: float = math.inf  # [m] least along the plan
