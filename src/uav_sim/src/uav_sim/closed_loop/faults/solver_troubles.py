# SPDX-License-Identifier: MIT
"""Troubles of solver and controller: they raise, stall, die, or say that all is well."""

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, List, Optional, Tuple

import numpy as np

from nmpc_control.controller import Step
from nmpc_control.params import Vehicle
from nmpc_control.prediction import step as model_step
from nmpc_control.state import GRAVITY, POSITION, VELOCITY, Plan
from uav_sim.closed_loop.faults.trouble import Solve, Trouble

if TYPE_CHECKING:
    from uav_sim.closed_loop.faults.faulty_loop import FaultyLoop

FOR_EVER = 1_000_000_000
TILT = 0.4  # [rad] of a plan that leads astray, inside the bounds
SPEED = 3.0  # [m/s] that it gathers


@dataclass
class Counted(Trouble):
    """Concerns the next so many control steps."""

    count: int = field(default=FOR_EVER, metadata={"min": 1, "max": FOR_EVER})  # [1]

    def begin(self, loop: "FaultyLoop") -> None:
        """Begin counting."""
        self._left = self.count

    def is_due(self) -> bool:
        """Return whether this control step is one of them."""
        self._left -= 1
        return self._left >= 0


@dataclass
class SolverRaises(Counted):
    """A control step raises."""

    def solve(self, t: float, solve: Solve) -> Optional[Step]:
        """Raise in place of solving."""
        if self.is_due():
            raise RuntimeError("the solver has failed")
        return solve()


@dataclass
class ControllerDead(Trouble):
    """The controller's process is gone."""

    def solve(self, t: float, solve: Solve) -> Optional[Step]:
        """Do nothing."""
        return None


@dataclass
class SolverStalls(Trouble):
    """One solve takes long; its plan comes then, none comes meanwhile."""

    time: float = field(metadata={"min": 0.0})  # [s]

    def begin(self, loop: "FaultyLoop") -> None:
        """Stall at the next solve."""
        self._until: Optional[float] = None
        self._step: Optional[Step] = None

    def solve(self, t: float, solve: Solve) -> Optional[Step]:
        """Solve once and keep it back; while that lasts nothing else is solved."""
        if self._until is None:
            self._until, self._step = t + self.time, solve()
            return None
        return solve() if t >= self._until else None

    def deliver(self, t: float, steps: List[Step]) -> List[Step]:
        """Deliver what was kept back when it is done."""
        if self._step is not None and t >= self._until:
            steps, self._step = [self._step, *steps], None
        return steps


@dataclass
class PlansLate(Trouble):
    """Every plan is under way for some time, as over a radio link."""

    delay: float = field(metadata={"min": 0.0})  # [s]

    def begin(self, loop: "FaultyLoop") -> None:
        """Hold nothing back yet."""
        self._held: List[Tuple[float, Step]] = []

    def deliver(self, t: float, steps: List[Step]) -> List[Step]:
        """Hold plans back."""
        self._held += [(t + self.delay, step) for step in steps]
        due = [step for when, step in self._held if when <= t + 1e-9]
        self._held = [item for item in self._held if item[0] > t + 1e-9]
        return due


@dataclass
class SpoiltPlan(Counted):
    """The plan is not what the solver found, though it says so."""

    def begin(self, loop: "FaultyLoop") -> None:
        """Begin counting."""
        super().begin(loop)
        self._loop = loop

    def solve(self, t: float, solve: Solve) -> Optional[Step]:
        """Spoil what was found."""
        step = solve()
        if step is None or not self.is_due():
            return step
        return replace(step, plan=self.spoilt(step.plan))

    def spoilt(self, plan: Plan) -> Plan:
        """Return what becomes of a plan."""
        return plan


@dataclass
class SolverNan(SpoiltPlan):
    """Success, and every number is NaN."""

    def spoilt(self, plan: Plan) -> Plan:
        """Replace states and inputs."""
        nan = math.nan
        return replace(plan, found=True, states=plan.states * nan, inputs=plan.inputs * nan)


@dataclass
class SolverFindsNone(SpoiltPlan):
    """The problem counts as infeasible."""

    def spoilt(self, plan: Plan) -> Plan:
        """Say that there is none."""
        return replace(plan, found=False, status="infeasible")


@dataclass
class PlansOld(SpoiltPlan):
    """Plans carry the stamp of an earlier time."""

    age: float = field(default=2.0)  # [s] negative: of a later one

    def spoilt(self, plan: Plan) -> Plan:
        """Shift it in time."""
        return replace(plan, t=plan.t - self.age)


@dataclass
class PlansOutOfBounds(SpoiltPlan):
    """Success, and the inputs tilt by twice of what is allowed."""

    def spoilt(self, plan: Plan) -> Plan:
        """Tilt."""
        limit = 2.0 * self._loop.controller.parameters.limits.input_max[1]
        inputs = plan.inputs.copy()
        inputs[:, 1] = limit
        return replace(plan, inputs=inputs)


@dataclass
class SolverIntoObstacle(SpoiltPlan):
    """Success, consistent with the model and inside all bounds, and through the next obstacle."""

    def spoilt(self, plan: Plan) -> Plan:
        """Lead to the nearest obstacle that stands still."""
        loop = self._loop
        x = plan.states[0]
        still = [o for o in loop.inbox.obstacles if o.stamp is None]
        nearest = min(still, key=lambda o: float(o.distance(x[POSITION])))
        return _towards(plan, nearest.position, loop.controller.nmpc.parameters.vehicle)


def _towards(plan: Plan, place: np.ndarray, vehicle: Vehicle) -> Plan:
    """Return a plan from the same state that flies to a place (3,) [m]."""
    x, states, inputs = plan.states[0], [plan.states[0]], []
    for _ in range(plan.horizon):
        off = place - x[POSITION]
        wanted = SPEED * off / max(float(np.linalg.norm(off)), 1e-3)
        a = wanted - x[VELOCITY]
        forward = math.cos(x[5]) * a[0] + math.sin(x[5]) * a[1]
        left = math.cos(x[5]) * a[1] - math.sin(x[5]) * a[0]
        u = [GRAVITY + a[2], -math.atan2(left, GRAVITY), math.atan2(forward, GRAVITY), 0.0]
        inputs.append(np.clip(u, [6.0, -TILT, -TILT, 0.0], [14.0, TILT, TILT, 0.0]))
        x = np.array(model_step(x, inputs[-1], plan.dt, vehicle))
        states.append(x)
    return replace(plan, states=np.array(states), inputs=np.array(inputs))
