# SPDX-License-Identifier: MIT
"""When the guard brakes although there is a plan: no room to stop later, obstacles too long unseen.

It holds the aircraft back inside the mode that it is in, so the goal is kept, and lets the plans go
on as soon as the reason is gone.
"""

import math
from typing import Optional

import numpy as np

from nmpc_control.braking import BrakeParameters
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Vehicle
from nmpc_control.state import GRAVITY, VELOCITY
from nmpc_control.stopping import StoppingParameters, clearance_of, shortfall, way_to_stop
from nmpc_control.verdict import PlanCheckParameters, Verdict

# [1] on the braking distance at full deceleration: what it takes on both plants, not at worst
EXPECTED = 1.1


class Override:
    """Remembers since when it brakes; ``reason`` once per tick in which a plan would be flown."""

    def __init__(
        self,
        params: StoppingParameters,
        brake: BrakeParameters,
        vehicle: Vehicle,
        period: float,
        plan_check: PlanCheckParameters,
    ) -> None:
        """Begin without braking.

        Args:
            params: of the stopping distance.
            brake: the guard's own.
            vehicle: for hull and lags.
            period: [s] between two ticks.
            plan_check: for how long a plan is flown, and over which time it is judged.
        """
        self.params = params
        self.brake = brake
        self.vehicle = vehicle
        self.period = period
        self.horizon = plan_check.clearance_horizon
        self.plan_timeout = plan_check.timeout
        self.forget()

    def forget(self) -> None:
        """Brake no more, as when no plan is flown or the clock went backwards."""
        self.active = False
        self.remark = ""  # why it would brake, but the plan is better
        self._until = -math.inf
        self._reason = ""
        self._evades = False  # obstacles that are too long unseen, because braking is worse

    def brake_clearance(self, state: np.ndarray, t: float, obstacles: ObstacleField) -> float:
        """Return how near [m] a brake comes to an obstacle, and standing still after it.

        Args:
            state: (10,) when the brake takes effect.
            t: [s] of that.
            obstacles: as known now.
        """
        swing = math.atan(self.brake.deceleration / GRAVITY) / self.brake.tilt_rate
        latency = self.period + swing / 2.0
        way = way_to_stop(state, self.vehicle, self.brake, latency, EXPECTED)
        return clearance_of(way, self.horizon, t, obstacles, self.vehicle.radius)

    def time_to_stop(self, state: np.ndarray) -> float:
        """Return how long [s] a stop takes at most, counted from the command.

        Args:
            state: (10,) when a command sent now takes effect.
        """
        way = way_to_stop(state, self.vehicle, self.brake, self.period, self.params.factor)
        return self.vehicle.delay + way.duration

    def reason(
        self,
        t: float,
        stale: str,
        state: Optional[np.ndarray],
        obstacles: ObstacleField,
        verdict: Verdict,
    ) -> str:
        """Return why to brake at ``t`` [s]; empty: the plan may be flown.

        Args:
            t: [s] now.
            stale: why the obstacles are not known well enough; empty: they are.
            state: (10,) when a command sent now takes effect; None: unknown.
            obstacles: as known now.
            verdict: now, on the plan that would be flown.
        """
        self.remark = ""
        if stale and self._must_evade(t, state, obstacles, verdict):
            self.active, self._until = False, -math.inf
            self.remark = f"{stale}, but braking would come nearer to them than the plan"
            return ""
        self._evades = self._evades and bool(stale)
        reason = stale or self._no_room(t, state, obstacles, verdict)
        if reason and (stale or not self.active):
            self._until = t + self.params.dwell
        self._reason = reason or self._reason
        self.active = bool(reason) or (self.active and t < self._until)
        return self._reason if self.active else ""

    def _must_evade(
        self,
        t: float,
        state: Optional[np.ndarray],
        obstacles: ObstacleField,
        verdict: Verdict,
    ) -> bool:
        """Return whether who brakes is met by what is expected to come, and who flies is not."""
        p, evaded = self.params, self._evades
        self._evades = False
        if state is None or not verdict.ok or verdict.flown is None or obstacles.unusable:
            return False
        clearance = self.brake_clearance(state, t + self.vehicle.delay, obstacles)
        if clearance >= p.evasion + (p.release if evaded else 0.0):
            return False
        self._evades = verdict.nearest - clearance > (-p.advantage if evaded else p.advantage)
        return self._evades

    def _no_room(
        self,
        t: float,
        state: Optional[np.ndarray],
        obstacles: ObstacleField,
        verdict: Verdict,
    ) -> str:
        p = self.params
        if not p.enabled or state is None or verdict.flown is None or obstacles.unusable:
            return ""
        if float(np.linalg.norm(state[VELOCITY])) < p.least_speed:
            return ""
        age = max(0.0, t - verdict.flown.t)
        way = way_to_stop(state, self.vehicle, self.brake, self.period + age, p.factor)
        in_effect, radius = t + self.vehicle.delay, self.vehicle.radius
        room = p.release if self.active else 0.0
        found = shortfall(way, in_effect, obstacles, radius, p.margin, room)
        if found is None:
            return ""
        kept = self._kept(in_effect, age, verdict, obstacles)
        gain = self.brake_clearance(state, in_effect, obstacles) - kept
        if self.active:
            gain += 2.0 * p.advantage
        if (kept < p.margin or self.active) and gain > p.advantage:
            return str(found)
        self.remark = f"{found}; the plan keeps {kept:.2f} m"
        return ""

    def _kept(self, t: float, age: float, verdict: Verdict, obstacles: ObstacleField) -> float:
        """Return how far [m] from obstacles one stays who flies the plan.

        One that has just come and leads past them at a good distance is taken at its word. Of any
        other the guard must be able to make the best should no more plans come: it flies it until
        it is too old, and then brakes.
        """
        p = self.params
        leads_past = verdict.nearest >= p.evasion and verdict.speed >= p.least_speed
        if leads_past and age <= p.evasion_age:
            return verdict.nearest
        later = t + max(0.0, self.plan_timeout - age)
        after = self.brake_clearance(verdict.flown.state_at(later), later, obstacles)
        return min(verdict.nearest, after)
