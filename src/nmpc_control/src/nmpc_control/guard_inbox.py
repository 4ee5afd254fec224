# SPDX-License-Identifier: MIT
"""What the guard has heard, and when: turns telemetry into the inputs of one tick."""

import math
from collections import Counter
from dataclasses import replace
from typing import Dict, Optional, Sequence, Tuple

from nmpc_control import dji
from nmpc_control.estimator import Estimator
from nmpc_control.guard_data import GuardInputs
from nmpc_control.guard_params import GuardParameters
from nmpc_control.liveness import Liveness
from nmpc_control.mode_inputs import ModeInputs, Request
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import Goal, Plan

_STATE = ("attitude", "imu", "velocity", "position")
_FAR = 1e6  # [s]


class GuardInbox:
    """Newest message of each kind.

    ``inputs(t)`` gives what a tick at ``t`` sees and empties plan and request; ``plan_inputs(t)``
    the plan alone, before the tick.
    """

    def __init__(self, params: GuardParameters) -> None:
        self.estimator = Estimator()
        self.obstacles: Sequence[Obstacle] = ()
        self.obstacles_stale = ""  # why they are not known well enough
        self.authority = False  # as far as the last answer of dji_sdk tells
        self.failure = ""  # how a service call failed, until the next tick
        self.landing_granted = False  # dji_sdk has answered a call to land, until the next tick
        self.request: Optional[Request] = None
        self.leaving = False  # the guard was told to end
        self.needs_gps = True  # the position comes from GPS
        self.yaw_disagreement = math.nan  # [rad] motion capture's less dji_sdk's
        self.rejected: Dict[str, int] = Counter()  # values that are not finite, per source
        self._liveness = Liveness()
        self._switch = params.rc_switch
        self._rc: Tuple[float, Sequence[float]] = (-math.inf, ())
        self._left_f: Optional[dji.RcMode] = None  # since the last tick, however briefly
        self._status: Tuple[float, int] = (-math.inf, 0)
        self._gps: Tuple[float, int] = (-math.inf, 0)
        self._battery: Tuple[float, float] = (-math.inf, math.nan)
        self._height = math.nan
        self._plan: Optional[Tuple[Plan, Goal]] = None
        self._plan_error = ""

    def add_rc(self, t: float, axes: Sequence[float]) -> None:
        """Take the axes of ``dji_sdk/rc``; what is not finite is no position of the switch."""
        self._count("rc", axes)
        self._rc = (t, tuple(axes))
        mode = dji.rc_mode(axes, self._switch)
        if mode is not dji.RcMode.F:
            self._left_f = mode

    def add_flight_status(self, t: float, value: int) -> None:
        """Take a value of ``dji_sdk/flight_status``."""
        self._status = (t, value)

    def add_gps_health(self, t: float, value: int) -> None:
        """Take a value 0..5 of ``dji_sdk/gps_health``."""
        self._gps = (t, value)

    def add_battery(self, t: float, percent: float) -> None:
        """Take a state of charge [percent] of ``dji_sdk/battery_state``."""
        if self._count("battery", (percent,)):
            return
        self._battery = (t, percent / 100.0)

    def add_height(self, height: float) -> None:
        """Take a height [m] of ``dji_sdk/height_above_takeoff``."""
        self._count("height", (height,))
        self._height = height

    def add_plan(self, plan: Plan, goal: Goal) -> None:
        """Take a plan; an older one that no tick has seen is dropped."""
        self._plan = (plan, goal)

    def add_plan_error(self, sentence: str) -> None:
        """Note that a plan came that could not be read."""
        self._plan_error = sentence

    @property
    def refused(self) -> Dict[str, int]:
        """How many values of which source were not finite, or no attitude."""
        return dict(Counter(self.estimator.rejected) + Counter(self.rejected))

    def inputs(self, t: float, steady: Optional[float] = None) -> GuardInputs:
        """Return what a tick at ``t`` [s] sees; ``steady`` [s] is a clock that nobody sets."""
        seen = self.plan_inputs(t, steady)
        rc = self._rc[1]
        ages = {name: self._state_age(name, t, steady) for name in _STATE}
        telemetry = ModeInputs(
            attitude_age=max(ages["attitude"], ages["imu"]),
            velocity_age=ages["velocity"],
            position_age=ages["position"],
            rc_age=self._age("rc", self._rc[0], t, steady),
            rc=self._left_f or dji.rc_mode(rc, self._switch),
            sticks=dji.stick_deflection(rc),
            status_age=self._age("status", self._status[0], t, steady),
            flight_status=dji.flight_status(self._status[1]),
            gps_age=self._age("gps", self._gps[0], t, steady),
            gps_health=self._gps[1],
            needs_gps=self.needs_gps,
            battery_age=self._age("battery", self._battery[0], t, steady),
            battery=self._battery[1],
            authority=self.authority,
            leaving=self.leaving,
            failure=self.failure,
            landing_granted=self.landing_granted,
            request=self.request,
        )
        self.failure, self.request = "", None
        self._left_f, self.landing_granted = None, False
        return replace(
            seen,
            telemetry=telemetry,
            height=self._height,
            obstacles_stale=self.obstacles_stale,
            yaw_disagreement=self.yaw_disagreement,
        )

    def plan_inputs(self, t: float, steady: Optional[float] = None) -> GuardInputs:
        """Return what is needed to look at a plan before the next tick, and empty the plan."""
        (plan, goal), error = self._plan or (None, Goal.HOLD), self._plan_error
        self._plan, self._plan_error = None, ""
        return GuardInputs(
            t=t,
            telemetry=ModeInputs(velocity_age=self._state_age("velocity", t, steady)),
            estimate=self.estimator.estimate(t),
            plan=plan,
            plan_error=error,
            goal=goal,
            obstacles=self.obstacles,
            steady=steady,
        )

    def _age(self, name: str, stamp: float, t: float, steady: Optional[float]) -> float:
        return self._liveness.age(name, stamp, t, t if steady is None else steady)

    def _state_age(self, name: str, t: float, steady: Optional[float]) -> float:
        later = t + _FAR  # an age now is cut off at 0, where a stamp lies ahead
        return self._age(name, later - self.estimator.age(name, later), t, steady)

    def _count(self, name: str, values: Sequence[float]) -> bool:
        """Return whether a value is not finite, and count it."""
        is_bad = not all(map(math.isfinite, values))
        self.rejected[name] += is_bad
        return is_bad
