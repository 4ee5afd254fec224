# SPDX-License-Identifier: MIT
"""What the guard has heard, and when: turns telemetry into the inputs of one tick."""

import math
from typing import Optional, Sequence, Tuple

from nmpc_control import dji
from nmpc_control.estimator import Estimator
from nmpc_control.guard_data import GuardInputs
from nmpc_control.guard_params import GuardParameters
from nmpc_control.mode_inputs import ModeInputs, Request
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import Goal, Plan


class GuardInbox:
    """Newest message of each kind.

    ``inputs(t)`` gives what a tick at ``t`` sees and empties plan and request.
    """

    def __init__(self, params: GuardParameters) -> None:
        self.estimator = Estimator()
        self.obstacles: Sequence[Obstacle] = ()
        self.obstacles_stale = ""  # why they are not known well enough
        self.authority = False  # as far as the last answer of dji_sdk tells
        self.failure = ""  # how a service call failed, until the next tick
        self.request: Optional[Request] = None
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
        """Take the axes of ``dji_sdk/rc``."""
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
        self._battery = (t, percent / 100.0)

    def add_height(self, height: float) -> None:
        """Take a height [m] of ``dji_sdk/height_above_takeoff``."""
        self._height = height

    def add_plan(self, plan: Plan, goal: Goal) -> None:
        """Take a plan; an older one that no tick has seen is dropped."""
        self._plan = (plan, goal)

    def add_plan_error(self, sentence: str) -> None:
        """Note that a plan came that could not be read."""
        self._plan_error = sentence

    def inputs(self, t: float) -> GuardInputs:
        """Return what a tick at ``t`` [s] sees."""
        estimate = self.estimator.estimate(t)
        e, (rc_t, rc) = self.estimator, self._rc
        telemetry = ModeInputs(
            attitude_age=max(e.age("attitude", t), e.age("imu", t)),
            velocity_age=e.age("velocity", t),
            position_age=e.age("position", t),
            rc_age=t - rc_t,
            rc=self._left_f or dji.rc_mode(rc, self._switch),
            sticks=dji.stick_deflection(rc),
            status_age=t - self._status[0],
            flight_status=dji.flight_status(self._status[1]),
            gps_age=t - self._gps[0],
            gps_health=self._gps[1],
            battery_age=t - self._battery[0],
            battery=self._battery[1],
            authority=self.authority,
            failure=self.failure,
            request=self.request,
        )
        (plan, goal), error = self._plan or (None, Goal.HOLD), self._plan_error
        self._plan, self._plan_error, self.failure, self.request = None, "", "", None
        self._left_f = None
        return GuardInputs(
            t=t,
            telemetry=telemetry,
            estimate=estimate,
            height=self._height,
            plan=plan,
            plan_error=error,
            goal=goal,
            obstacles=self.obstacles,
            obstacles_stale=self.obstacles_stale,
        )
