# SPDX-License-Identifier: MIT
"""Watchdogs over the state: position against velocity, fence, speed, tilt.

The position must go where the velocity leads. What it is off by is summed up and forgotten slowly,
so that both a jump and a position that stands still while the aircraft moves are seen. At rest the
latter looks good again: whoever is off a second time soon is not believed any more in that flight.
"""

import math
from dataclasses import dataclass, field
from typing import Optional

import numpy as np

from nmpc_control.distrust import Distrust
from nmpc_control.estimator import StateEstimate
from nmpc_control.params import Limits
from nmpc_control.state import PITCH, POSITION, ROLL, VELOCITY

LONGEST = 0.5  # [s] over which a position is compared with the one before
MEMORY = 1.0  # [s] in which what it was off by is forgotten
RECENT = 2.0  # [s] for which a jump stands against a start
OUTWARD = 0.3  # [m/s] from which on it leaves the fence; slower may be noise


def _positive() -> float:
    return field(metadata={"min": 1e-3})


@dataclass(frozen=True)
class WatchParameters:
    """From when on a state is not believed, or not flown on; and what is at rest."""

    position_jump: float = _positive()  # [m] off what the velocity made expect
    fence_margin: float = _positive()  # [m] beyond the fence, moving outward
    tilt: float = _positive()  # [rad] more than DJI's own control ever tilts
    speed: float = _positive()  # [m/s]
    effect_tilt: float = _positive()  # [rad] rms of commands that must show an effect
    rest_speed: float = _positive()  # [m/s] of an aircraft that stands on the ground
    start_height: float = _positive()  # [m] of one, above or below the local origin
    yaw_agreement: float = _positive()  # [rad] between motion capture and dji_sdk
    loop_rate: float = field(metadata={"min": 0.1, "max": 1.0})  # [1] of `rate`, least for a start


class Watch:
    """Compares every state with the one before, and with limits."""

    def __init__(self, params: WatchParameters, limits: Limits) -> None:
        self.params = params
        self.limits = limits
        self.jumps = 0  # [1] since start-up
        self._distrust = Distrust()
        self.forget()

    def forget(self) -> None:
        """Drop what carries a time."""
        self.alarm = ""  # why to brake; empty: nothing is wrong
        self.tilt_time = 0.0  # [s] for which the tilt has been beyond its limit
        self._before: Optional[StateEstimate] = None
        self._off = np.zeros(3)  # [m] that velocity does not explain
        self._jumped = -math.inf
        self._distrust.forget()
        self._tilted_since: Optional[float] = None

    def begin_flight(self) -> None:
        """Believe the position again: somebody has asked for automatic flight."""
        self._distrust.forgive()

    def look(self, estimate: Optional[StateEstimate]) -> None:
        """Judge a state; None: there is none, which its age tells."""
        self.alarm, self.tilt_time = "", 0.0
        if estimate is None:
            return
        tilt, jump = self._tilt(estimate), self._jump(estimate)
        distrust = "the position was off twice, it is not believed any more"
        self.alarm = tilt or jump or (distrust if self._distrust.stands else "")
        self.alarm = self.alarm or self._motion(estimate.vector)
        self._before = estimate

    def has_jumped(self, t: float) -> bool:
        """Return whether the position has jumped lately."""
        return t - self._jumped <= RECENT

    def _jump(self, estimate: StateEstimate) -> str:
        before = self._before
        dt = math.inf if before is None else estimate.t - before.t
        if not 0.0 < dt <= LONGEST:
            return ""
        moved = estimate.vector[POSITION] - before.vector[POSITION]
        self._off = self._off * math.exp(-dt / MEMORY) + moved - dt * before.vector[VELOCITY]
        off = float(np.linalg.norm(self._off))
        if off <= self.params.position_jump:
            return ""
        since = estimate.t - self._jumped
        self.jumps += since > dt * 1.5
        self._distrust.note(estimate.t, True)
        self._jumped = estimate.t
        return f"the position is {off:.1f} m from where the velocity leads"

    def _motion(self, x: np.ndarray) -> str:
        p = self.params
        speed = float(np.linalg.norm(x[VELOCITY]))
        if speed > p.speed:
            return f"the speed is {speed:.1f} m/s"
        beyond = self._beyond(x[POSITION], x[VELOCITY])
        if beyond > p.fence_margin:
            return f"the aircraft is {beyond:.1f} m outside of the fence and leaves it"
        return ""

    def _beyond(self, position: np.ndarray, velocity: np.ndarray) -> float:
        """Return how far [m] it is outside of the fence on a side towards which it moves."""
        low, high = self.limits.fence_min - position, position - self.limits.fence_max
        sides = [*low[velocity < -OUTWARD], *high[velocity > OUTWARD], 0.0]
        return float(max(sides))

    def _tilt(self, estimate: StateEstimate) -> str:
        roll, pitch = float(estimate.vector[ROLL]), float(estimate.vector[PITCH])
        upright = math.cos(roll) * math.cos(pitch)
        if upright >= math.cos(self.params.tilt):
            self._tilted_since = None
            return ""
        self._tilted_since = estimate.t if self._tilted_since is None else self._tilted_since
        self.tilt_time = estimate.t - self._tilted_since
        return f"the tilt is {math.degrees(math.acos(upright)):.0f} degrees"
