# SPDX-License-Identifier: MIT
"""Outcome of the check of a plan, its parameters, and what is remembered from one to the next."""

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Mapping, Optional

from nmpc_control.approach import Approach
from nmpc_control.state import Plan


def _positive() -> float:
    return field(metadata={"min": 1e-6})


@dataclass(frozen=True)
class PlanCheckParameters:
    """How much a plan may differ from perfect, and how far it must stay away from obstacles."""

    timeout: float = _positive()  # [s] a plan made longer ago is not flown
    lead: float = _positive()  # [s] a plan may begin this much in the future
    input_tolerance: float = _positive()  # [1] fraction of each input's range
    position_residual: float = _positive()  # [m] per stage, against the guard's own model
    attitude_residual: float = _positive()  # [rad]
    velocity_residual: float = _positive()  # [m/s]
    yaw_rate_residual: float = _positive()  # [rad/s]
    position_jump: float = _positive()  # [m] from where the aircraft is expected
    velocity_jump: float = _positive()  # [m/s]
    attitude_jump: float = _positive()  # [rad] of roll and of pitch
    minimum_clearance: float = field(metadata={"min": 0.0})  # [m] hull to surface
    growth_tolerance: float = field(metadata={"min": 0.0})  # [m] nearer than where it was entered
    clearance_horizon: float = _positive()  # [s] ahead of now; a plan is replaced long before
    grace: float = field(metadata={"min": 0.0})  # [s] one too near far ahead is flown on


class Finding(Enum):
    """Why a plan was refused."""

    OK = "ok"
    NOT_FOUND = "not_found"
    SHAPE = "shape"
    CLOCK = "clock"
    NOT_FINITE = "not_finite"
    TOO_OLD = "too_old"
    TOO_EARLY = "too_early"
    INPUT_BOUNDS = "input_bounds"
    DYNAMICS = "dynamics"
    JUMP = "jump"
    COLLISION = "collision"
    CLEARANCE = "clearance"
    ENVELOPE = "envelope"


@dataclass(frozen=True)
class Inside:
    """Where the aircraft is nearer than it should be: how near it was when that began.

    What is tolerated counts from there, not from where it is now: else many small steps, each
    within the tolerance, would lead through it.
    """

    clearance: Mapping[str, float] = field(default_factory=dict)  # [m] to surfaces, by obstacle id
    fence: float = 0.0  # [m] beyond the fence; 0 within it

    def since(self, before: "Inside") -> "Inside":
        """Return where it began: as remembered, as now for what is new; forgets what is left."""
        clearance = {name: before.clearance.get(name, c) for name, c in self.clearance.items()}
        return Inside(clearance, (before.fence or self.fence) if self.fence else 0.0)


NOT_INSIDE = Inside()


@dataclass(frozen=True)
class Verdict:
    """Outcome of a check."""

    finding: Finding
    sentence: str
    clearance: float = math.inf  # [m] hull to the nearest surface over the rest of the plan
    flown: Optional[Plan] = None  # the plan with the states to which its inputs take this aircraft
    nearest: float = math.inf  # [m] as clearance, within the horizon that is judged
    speed: float = 0.0  # [m/s] of the plan there, the greatest where it is as near
    inside: Optional[Inside] = None  # now; None where that was not looked at
    conflict: float = math.inf  # [s] when it is nearer than the minimum for the first time
    way: Optional[Approach] = None  # to the obstacles, over the rest of the plan

    @property
    def ok(self) -> bool:
        """Whether the plan may be flown."""
        return self.finding is Finding.OK

    @property
    def is_near(self) -> bool:
        """Whether the plan was refused for the obstacles alone."""
        return self.finding in (Finding.COLLISION, Finding.CLEARANCE) and self.flown is not None
