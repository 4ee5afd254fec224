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
from nmpc_control.state import VELOCITY
from nmpc_control.stopping import StoppingParameters, clearance_of, shortfall, way_to_stop


class Override:
    """Remembers since when it brakes; ``reason`` once per tick in which a plan would be flown."""

    def __init__(
        self,
        params: StoppingParameters,
        brake: BrakeParameters,
        vehicle: Vehicle,
        period: float,
        horizon: float,
    ) -> None:
        """Begin without braking.

        Args:
            params: of the stopping distance.
            brake: the guard's own.
            vehicle: for hull and lags.
            period: [s] between two ticks.
            horizon: [s] over which brake and plan are compared.
        """
        self.params = params
        self.brake = brake
        self.vehicle = vehicle
        self.period = period
        self.horizon = horizon
        self.forget()

    def forget(self) -> None:
        """Brake no more, as when no plan is flown or the clock went backwards."""
        self.active = False
        self.remark = ""  # why it would brake, but the plan is better
        self._until = -math.inf
        self._reason = ""

    def brake_clearance(self, state: np.ndarray, t: float, obstacles: ObstacleField) -> float:
        """Return how near [m] a brake comes to an obstacle, and standing still after it.

        Args:
            state: (10,) when the brake takes effect.
            t: [s] of that.
            obstacles: as known now.
        """
        way = way_to_stop(state, self.vehicle, self.brake, self.period, 1.0)
        return clearance_of(way, self.horizon, t, obstacles, self.vehicle.radius)

    def reason(
        self,
        t: float,
        stale: str,
        state: Optional[np.ndarray],
        obstacles: ObstacleField,
        plan_age: float,
        plan_clearance: float,
    ) -> str:
        """Return why to brake at ``t`` [s]; empty: the plan may be flown.

        Args:
            t: [s] now.
            stale: why the obstacles are not known well enough; empty: they are.
            state: (10,) when a command sent now takes effect; None: unknown.
            obstacles: as known now.
            plan_age: [s] of the plan that would be flown.
            plan_clearance: [m] least that the plan keeps over the horizon.
        """
        self.remark = ""
        reason = stale or self._no_room(t, state, obstacles, plan_age, plan_clearance)
        if reason and (stale or not self.active):
            self._until = t + self.params.dwell
        self._reason = reason or self._reason
        self.active = bool(reason) or (self.active and t < self._until)
        return self._reason if self.active else ""

    def _no_room(
        self,
        t: float,
        state: Optional[np.ndarray],
        obstacles: ObstacleField,
        plan_age: float,
        plan_clearance: float,
    ) -> str:
        p = self.params
        if not p.enabled or state is None or obstacles.unusable:
            return ""
        if float(np.linalg.norm(state[VELOCITY])) < p.least_speed:
            return ""
        way = way_to_stop(state, self.vehicle, self.brake, self.period + plan_age, p.factor)
        in_effect, radius = t + self.vehicle.delay, self.vehicle.radius
        room = p.release if self.active else 0.0
        found = shortfall(way, in_effect, obstacles, radius, p.margin, room)
        if found is None:
            return ""
        # a plan that leads past it is better than a brake that does not stop before it
        gain = self.brake_clearance(state, in_effect, obstacles) - plan_clearance
        if gain > (-p.advantage if self.active else p.advantage):
            return str(found)
        self.remark = f"{found}; the plan keeps {plan_clearance:.2f} m"
        return ""
