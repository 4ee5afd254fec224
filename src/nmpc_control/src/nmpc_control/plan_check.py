# SPDX-License-Identifier: MIT
"""Independent check of a plan before it is flown: the solver's own word for it is not enough."""

import math
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle
from nmpc_control.params import Limits, Vehicle
from nmpc_control.plan_consistency import as_flown, departure
from nmpc_control.prediction import predict
from nmpc_control.rotations import wrap_angle
from nmpc_control.state import NU, NX, PITCH, POSITION, ROLL, VELOCITY, YAW, YAW_RATE, Plan

SPACING = 0.05  # [m] of the points between two stages at which clearance is looked at
MAX_POINTS = 40  # [1] between two stages
PLAUSIBLE = 1e6  # [any unit] a plan with greater numbers counts as infinite
MAX_HORIZON = 1000  # [1] stages; a longer plan is a broken one
MAX_DT = 0.5  # [s] a longer stage is a broken one
SAME_DELAY = 1e-6  # [s] by which the plan's dead time may differ from the guard's own
MAX_YAW_RATE_JUMP = 1.0  # [rad/s] between plan and aircraft


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
    growth_tolerance: float = field(metadata={"min": 0.0})  # [m] nearer than now, where now is near
    clearance_horizon: float = _positive()  # [s] ahead of now; a plan is replaced long before


class Finding(Enum):
    """Why a plan was refused."""

    OK = "ok"
    NOT_FOUND = "not_found"
    SHAPE = "shape"
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
class Verdict:
    """Outcome of a check."""

    finding: Finding
    sentence: str
    clearance: float = math.inf  # [m] hull to the nearest surface over the rest of the plan
    flown: Optional[Plan] = None  # the plan with the states to which its inputs take this aircraft

    @property
    def ok(self) -> bool:
        """Whether the plan may be flown."""
        return self.finding is Finding.OK


def check_plan(
    plan: Plan,
    *,
    t: float,
    state: np.ndarray,
    inputs: Sequence[Tuple[float, Sequence[float]]],
    vehicle: Vehicle,
    limits: Limits,
    obstacles: Sequence[Obstacle],
    params: PlanCheckParameters,
) -> Verdict:
    """Return whether a new plan may be flown at time ``t`` [s].

    Args:
        plan: what the solver offers.
        t: [s] now.
        state: (10,) state at ``t``.
        inputs: (time sent [s], input (4,)) sorted, the inputs sent lately.
        vehicle: the guard's own model.
        limits: bounds of the inputs.
        obstacles: as known now.
        params: tolerances.
    """
    refusal = (
        _check_form(plan, vehicle)
        or _check_age(plan, t, params)
        or _check_bounds(plan, limits, params)
        or _check_dynamics(plan, vehicle, params)
        or _check_jump(plan, t, state, inputs, vehicle, params)
    )
    if refusal:
        return refusal
    flown = as_flown(plan, t, state, inputs, vehicle)
    refusal = _check_envelope(flown, t, state, limits, params)
    return refusal or replace(check_clearance(flown, t, vehicle, obstacles, params), flown=flown)


def check_flown(
    plan: Plan,
    *,
    t: float,
    vehicle: Vehicle,
    obstacles: Sequence[Obstacle],
    params: PlanCheckParameters,
) -> Verdict:
    """Return whether a plan that was verified before may be flown on at time ``t`` [s]."""
    return _check_age(plan, t, params) or check_clearance(plan, t, vehicle, obstacles, params)


def check_clearance(
    plan: Plan,
    t: float,
    vehicle: Vehicle,
    obstacles: Sequence[Obstacle],
    params: PlanCheckParameters,
) -> Verdict:
    """Return whether the plan from ``t`` [s] on keeps clear of the obstacles as predicted now.

    The hull must be free. Where it is nearer than the minimum now, it may not come nearer still, so
    that the way out is open; where it touches by the estimate, the plan must lead out.
    """
    least = math.inf
    for obstacle in obstacles:
        times, clearance = _clearance_along(plan, t, obstacle, vehicle.radius)
        if not np.isfinite(clearance).all():
            sentence = f"obstacle {obstacle.id} is nowhere: its numbers are not finite"
            return Verdict(Finding.CLEARANCE, sentence, math.nan)
        least = min(least, float(clearance.min()))
        now, ahead = clearance[0], clearance[times <= max(t, times[0]) + params.clearance_horizon]
        nearest = float(ahead.min())
        if now < 0.0:
            if nearest < now - params.growth_tolerance or ahead[-1] <= now:
                sentence = f"the plan leads deeper into obstacle {obstacle.id}"
                return Verdict(Finding.COLLISION, sentence, least)
        elif nearest < 0.0:
            sentence = f"the plan hits obstacle {obstacle.id} by {-nearest:.2f} m"
            return Verdict(Finding.COLLISION, sentence, least)
        elif nearest < min(params.minimum_clearance, now - params.growth_tolerance):
            sentence = f"the plan passes obstacle {obstacle.id} at {nearest:.2f} m"
            return Verdict(Finding.CLEARANCE, sentence, least)
    return Verdict(Finding.OK, "the plan is verified", least)


def _clearance_along(
    plan: Plan, t: float, obstacle: Obstacle, radius: float
) -> Tuple[np.ndarray, np.ndarray]:
    stages = plan.t + plan.delay + plan.dt * np.arange(len(plan.states))
    centres = plan.states[:, POSITION]
    relative = centres - obstacle.position_at(stages)
    longest = float(np.linalg.norm(np.diff(relative, axis=0), axis=1).max())
    count = math.ceil(min(max(1.0, longest / SPACING), MAX_POINTS))  # NaN gives 1
    start = min(max(t, stages[0]), stages[-1])
    times = np.linspace(stages[0], stages[-1], count * plan.horizon + 1)
    times = np.concatenate([[start], times[times > start]])
    points = np.stack([np.interp(times, stages, centres[:, i]) for i in range(3)], axis=1)
    return times, obstacle.distance(points, times) - radius


def _check_envelope(
    plan: Plan, t: float, state: np.ndarray, limits: Limits, params: PlanCheckParameters
) -> Optional[Verdict]:
    """Return a refusal where fence, ground or speed are exceeded, and more than they are now."""
    stages = plan.t + plan.delay + plan.dt * np.arange(len(plan.states))
    ahead = plan.states[(stages >= t) & (stages <= t + params.clearance_horizon)]
    if not len(ahead):
        return None

    def outside(x: np.ndarray) -> np.ndarray:
        p = x[..., POSITION]
        return np.maximum(limits.fence_min - p, p - limits.fence_max).max(axis=-1)

    worst, now = float(outside(ahead).max()), max(0.0, float(outside(state)))
    if worst > now + params.growth_tolerance:
        return Verdict(Finding.ENVELOPE, f"the plan leaves the fence by {worst:.2f} m")
    fastest = float(np.linalg.norm(ahead[:, VELOCITY], axis=1).max())
    speed = max(limits.speed, float(np.linalg.norm(state[VELOCITY])))
    if fastest > speed + params.velocity_residual:
        return Verdict(Finding.ENVELOPE, f"the plan reaches {fastest:.1f} m/s")
    return None


def _check_form(plan: Plan, vehicle: Vehicle) -> Optional[Verdict]:
    if not plan.found:
        return Verdict(Finding.NOT_FOUND, f"the solver found no plan: {plan.status}")
    states, inputs = np.shape(plan.states), np.shape(plan.inputs)
    if len(inputs) != 2 or inputs[1] != NU or not 1 <= inputs[0] <= MAX_HORIZON:
        return Verdict(Finding.SHAPE, f"the plan's inputs have shape {inputs}")
    if states != (inputs[0] + 1, NX):
        return Verdict(Finding.SHAPE, f"the plan's states have shape {states} for inputs {inputs}")
    scalars = (plan.t, plan.dt, plan.delay)
    if not (np.abs(plan.states) < PLAUSIBLE).all() or not (np.abs(plan.inputs) < PLAUSIBLE).all():
        return Verdict(Finding.NOT_FINITE, "the plan contains numbers that are not finite")
    if not all(map(math.isfinite, scalars)):
        return Verdict(Finding.NOT_FINITE, f"the plan's times {scalars} are not finite")
    if not 0.0 < plan.dt <= MAX_DT or abs(plan.delay - vehicle.delay) > SAME_DELAY:
        return Verdict(Finding.SHAPE, f"the plan has step {plan.dt:g} s, delay {plan.delay:g} s")
    return None


def _check_age(plan: Plan, t: float, params: PlanCheckParameters) -> Optional[Verdict]:
    if t - plan.t > params.timeout or t > plan.end:
        return Verdict(Finding.TOO_OLD, f"the plan is {t - plan.t:.2f} s old")
    if plan.t - t > params.lead:
        return Verdict(Finding.TOO_EARLY, f"the plan begins {plan.t - t:.2f} s in the future")
    return None


def _check_bounds(plan: Plan, limits: Limits, params: PlanCheckParameters) -> Optional[Verdict]:
    slack = params.input_tolerance * (limits.input_max - limits.input_min)
    outside = (plan.inputs < limits.input_min - slack) | (plan.inputs > limits.input_max + slack)
    if not outside.any():
        return None
    k = int(outside.any(axis=1).argmax())
    shown = ", ".join(f"{value:.3g}" for value in plan.inputs[k])
    return Verdict(Finding.INPUT_BOUNDS, f"the plan's input ({shown}) at stage {k} is out of range")


def _check_dynamics(plan: Plan, vehicle: Vehicle, params: PlanCheckParameters) -> Optional[Verdict]:
    tolerances = (
        params.position_residual,
        params.attitude_residual,
        params.velocity_residual,
        params.yaw_rate_residual,
    )
    worst = departure(plan, vehicle, tolerances)
    return Verdict(Finding.DYNAMICS, str(worst)) if worst else None


def _check_jump(
    plan: Plan,
    t: float,
    state: np.ndarray,
    inputs: Sequence[Tuple[float, Sequence[float]]],
    vehicle: Vehicle,
    params: PlanCheckParameters,
) -> Optional[Verdict]:
    meeting = max(t, plan.t + plan.delay)
    jump = plan.state_at(meeting) - predict(state, t, meeting, inputs, vehicle)
    for name, size, tolerance, unit in (
        ("m away", np.linalg.norm(jump[POSITION]), params.position_jump, "from the aircraft"),
        ("m/s off", np.linalg.norm(jump[VELOCITY]), params.velocity_jump, "its velocity"),
        ("rad off", np.abs(jump[[ROLL, PITCH]]).max(), params.attitude_jump, "its attitude"),
        ("rad off", abs(wrap_angle(jump[YAW])), params.attitude_jump, "its heading"),
        ("rad/s off", abs(jump[YAW_RATE]), MAX_YAW_RATE_JUMP, "its yaw rate"),
    ):
        if not size <= tolerance:
            return Verdict(Finding.JUMP, f"the plan begins {size:.2f} {name} {unit}")
    return None
