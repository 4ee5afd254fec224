# SPDX-License-Identifier: MIT
"""The upper rungs of the ladder: which verified plan is flown now, if any, and why not."""

import math
from dataclasses import replace
from enum import IntEnum
from typing import Callable, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.approach import Approach
from nmpc_control.clearance_check import Obstacles
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Limits, Vehicle
from nmpc_control.plan_check import check_flown, check_plan
from nmpc_control.state import Goal, Plan
from nmpc_control.verdict import NOT_INSIDE, Finding, PlanCheckParameters, Verdict

# [m] a plan that is too near must keep this much farther off than the brake to be flown instead
ADVANTAGE = 0.1
SPARE = 0.3  # [s] beyond the time to stop that a conflict must be ahead for a plan to be flown on


class Rung(IntEnum):
    """Values of ControllerStatus.RUNG_*: what the aircraft is flown on."""

    NONE = 0
    NEW_PLAN = 1
    LAST_PLAN = 2
    BRAKE = 3
    BRAKE_BLIND = 4
    RELEASE = 5
    LANDING = 6


BRAKES = (Rung.BRAKE, Rung.BRAKE_BLIND)


class PlanLadder:
    """The last verified plan, for how long plans have been usable, and where it became too near."""

    def __init__(
        self, params: PlanCheckParameters, hold_timeout: float, vehicle: Vehicle, limits: Limits
    ) -> None:
        """Begin without a plan.

        Args:
            params: of the plan check.
            hold_timeout: [s] in which plans must turn to holding after ``expect_hold``.
            vehicle: the guard's own model.
            limits: bounds of the inputs.
        """
        self.params = params
        self.hold_timeout = hold_timeout
        self.vehicle = vehicle
        self.limits = limits
        self.received = 0  # [1] plans since start-up
        self.rejected = 0  # [1] of these
        self.forget()

    def forget(self) -> None:
        """Drop everything that carries a time; the counts remain."""
        self.plan: Optional[Plan] = None
        self.flown: Optional[Plan] = None  # with the states to which its inputs really lead
        self.goal = Goal.HOLD
        self.verified = 0  # [1] in a row
        self._verdict = Verdict(Finding.NOT_FOUND, "no plan has come")
        self._seen: Obstacles = ()  # when the plan was checked
        self._way: Optional[Approach] = None  # of the plan to these
        self._inside = NOT_INSIDE
        self._came = -math.inf  # [s] the newest plan, verified or not
        self._evades = False  # on a plan that is too near, because braking is worse
        self._is_new = False
        self._too_near_since: Optional[float] = None
        self._usable_since: Optional[float] = None
        self._hold_since: Optional[float] = None

    def take(
        self,
        plan: Plan,
        goal: Goal,
        *,
        t: float,
        state: Optional[np.ndarray],
        inputs: Sequence[Tuple[float, Sequence[float]]],
        obstacles: Obstacles,
        brake_clearance: Callable[[], float] = lambda: math.inf,
    ) -> None:
        """Check a plan that has just come.

        Refusing it for an obstacle means to brake, so one that is too near is flown all the same
        where the brake would come nearer still: who is met by something fast must not stand still.

        Args:
            plan: what the solver offers.
            goal: what it serves.
            t: [s] now.
            state: (10,) at ``t``, None where unknown.
            inputs: as of ``check_plan``.
            obstacles: as known now.
            brake_clearance: how near [m] a brake begun now comes to an obstacle.
        """
        self.received += 1
        self._came = t
        if state is None:
            self._verdict = Verdict(Finding.JUMP, "the state is not known")
        else:
            self._verdict = check_plan(
                plan,
                t=t,
                state=state,
                inputs=inputs,
                vehicle=self.vehicle,
                limits=self.limits,
                obstacles=obstacles,
                params=self.params,
                before=self._inside,
            )
            self._verdict = self._lesser_evil(self._verdict, brake_clearance)
        if self._verdict.inside is not None:
            self._inside = self._verdict.inside.since(self._inside)
        if not self._verdict.ok:
            self.rejected += 1
            self.verified = 0
            return
        self.plan, self.goal, self._is_new = plan, goal, True
        self.flown = self._verdict.flown or plan
        self._seen, self._way = obstacles, self._verdict.way
        self.verified += 1
        if goal is Goal.HOLD:
            self._hold_since = None

    def refuse(self, sentence: str, finding: Finding = Finding.SHAPE) -> None:
        """Count a plan that could not even be read, or whose times mean nothing."""
        self.received += 1
        self.rejected += 1
        self.verified = 0
        self._verdict = Verdict(finding, sentence)

    def expect_hold(self, t: float) -> None:
        """Accept plans towards a goal only for ``hold_timeout`` more, until one holds position."""
        self._hold_since = t

    def stop_expecting(self) -> None:
        """Accept every goal again."""
        self._hold_since = None

    def assess(
        self,
        t: float,
        obstacles: Obstacles,
        brake_clearance: Callable[[], float] = lambda: math.inf,
        time_to_stop: Callable[[], float] = lambda: math.inf,
    ) -> Tuple[Rung, Verdict]:
        """Return the rung at ``t`` [s], NONE without a usable plan, and the verdict behind it.

        Arguments as of ``take``, and how long [s] a stop takes that is begun now.
        """
        rung, verdict = self._assess(t, obstacles, brake_clearance, time_to_stop)
        if rung is Rung.NONE:
            self._usable_since = None
        elif self._usable_since is None:
            self._usable_since = t
        self._is_new = False
        return rung, verdict

    def is_blocked(self, t: float) -> bool:
        """Return whether plans come, and the newest one was refused for obstacles alone."""
        return self._verdict.is_near and t - self._came <= self.params.timeout

    def usable_time(self, t: float) -> float:
        """Return for how long [s] plans have been usable without interruption."""
        return 0.0 if self._usable_since is None else t - self._usable_since

    def age(self, t: float) -> float:
        """Return the age [s] of the last verified plan; inf without."""
        return math.inf if self.plan is None else t - self.plan.t

    def _assess(
        self,
        t: float,
        obstacles: Obstacles,
        brake_clearance: Callable[[], float],
        time_to_stop: Callable[[], float],
    ) -> Tuple[Rung, Verdict]:
        if self.plan is None:
            return Rung.NONE, self._verdict
        rung = Rung.NEW_PLAN if self._is_new else Rung.LAST_PLAN
        if self._is_new and t == self._came and obstacles is self._seen:
            verdict = self._verdict
        else:
            unchanged = obstacles is self._seen and isinstance(obstacles, ObstacleField)
            verdict = check_flown(
                self.flown,
                t=t,
                vehicle=self.vehicle,
                obstacles=obstacles,
                params=self.params,
                before=self._inside,
                way=self._way if unchanged else None,
            )
            verdict = self._lesser_evil(verdict, brake_clearance)
        verdict = self._flown_on(t, verdict, time_to_stop)
        if not verdict.ok:
            if self._is_new:
                self.rejected, self._verdict = self.rejected + 1, verdict
            self.verified = 0
            return Rung.NONE, self._with_rejection(verdict)
        if self._hold_since is not None and t - self._hold_since > self.hold_timeout:
            sentence = f"the controller did not hold within {self.hold_timeout:g} s"
            return Rung.NONE, Verdict(Finding.TOO_OLD, sentence, verdict.clearance)
        return rung, verdict

    def _with_rejection(self, verdict: Verdict) -> Verdict:
        """Return the verdict on the last verified plan, led by why the newest one was refused."""
        if self._verdict.ok or self._verdict is verdict:
            return verdict
        sentence = f"{self._verdict.sentence}, and {verdict.sentence}"
        return replace(verdict, finding=self._verdict.finding, sentence=sentence)

    def _flown_on(self, t: float, verdict: Verdict, time_to_stop: Callable[[], float]) -> Verdict:
        """Return the verdict on a plan that is too near only beyond where a stop would end.

        Something has come to be known that it did not, as another aircraft's new plan; the next
        one answers it, and to brake before there is need would end the mode and hold up the goal.
        """
        if verdict.ok:
            self._too_near_since = None
            return verdict
        if self._too_near_since is None:
            self._too_near_since = t
        left = verdict.conflict - t
        is_awaited = t - self._too_near_since < self.params.grace
        if not verdict.is_near or not is_awaited or not left > time_to_stop() + SPARE:
            return verdict
        sentence = f"{verdict.sentence} in {left:.1f} s, another plan is awaited"
        return replace(verdict, finding=Finding.OK, sentence=sentence)

    def _lesser_evil(self, verdict: Verdict, brake_clearance: Callable[[], float]) -> Verdict:
        """Return the verdict on a plan that is too near, seeing what braking would do instead."""
        if not verdict.is_near or not math.isfinite(verdict.nearest):
            self._evades = False
            return verdict
        clearance = brake_clearance()
        gain = verdict.nearest - clearance
        self._evades = gain > (-ADVANTAGE if self._evades else ADVANTAGE)
        if not self._evades:
            return verdict
        sentence = f"{verdict.sentence}, but braking would come to {clearance:.2f} m"
        return replace(verdict, finding=Finding.OK, sentence=sentence)
