# SPDX-License-Identifier: MIT
"""Independent check of a plan before it is flown: the solver's own word for it is not enough."""

import math
from dataclasses import replace
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.approach import Approach
from nmpc_control.clearance_check import Obstacles, check_clearance
from nmpc_control.params import Limits, Vehicle
from nmpc_control.plan_consistency import as_flown, departure
from nmpc_control.prediction import predict
from nmpc_control.rotations import wrap_angle
from nmpc_control.state import NU, NX, PITCH, POSITION, ROLL, VELOCITY, YAW, YAW_RATE, Plan
from nmpc_control.verdict import NOT_INSIDE, Finding, Inside, PlanCheckParameters, Verdict

PLAUSIBLE = 1e6  # [any unit] a plan with greater numbers counts as infinite
MAX_HORIZON = 1000  # [1] stages; a longer plan is a broken one
MAX_DT = 0.5  # [s] a longer stage is a broken one
SAME_DELAY = 1e-6  # [s] by which the plan's dead time may differ from the guard's own
MAX_YAW_RATE_JUMP = 1.0  # [rad/s] between plan and aircraft


def check_plan(
    plan: Plan,
    *,
    t: float,
    state: np.ndarray,
    inputs: Sequence[Tuple[float, Sequence[float]]],
    vehicle: Vehicle,
    limits: Limits,
    obstacles: Obstacles,
    params: PlanCheckParameters,
    before: Inside = NOT_INSIDE,
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
        before: where the aircraft was nearer than it should be already, and how near.
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
    out = max(0.0, float(_outside(state, limits)))
    verdict = check_clearance(flown, t, vehicle, obstacles, params, before)
    if verdict.inside is not None:
        verdict = replace(verdict, inside=replace(verdict.inside, fence=out))
    refusal = _check_envelope(flown, t, state, limits, params, before.fence)
    if refusal:
        return replace(refusal, clearance=verdict.clearance, inside=verdict.inside)
    return verdict


def check_flown(
    plan: Plan,
    *,
    t: float,
    vehicle: Vehicle,
    obstacles: Obstacles,
    params: PlanCheckParameters,
    before: Inside = NOT_INSIDE,
    way: Optional[Approach] = None,
) -> Verdict:
    """Return whether a plan that was verified before may be flown on at time ``t`` [s]."""
    return _check_age(plan, t, params) or check_clearance(
        plan, t, vehicle, obstacles, params, before, way
    )


def _outside(x: np.ndarray, limits: Limits) -> np.ndarray:
    """Return how far (...) [m] states (..., 10) are beyond the fence, negative within it."""
    p = x[..., POSITION]
    return np.maximum(limits.fence_min - p, p - limits.fence_max).max(axis=-1)


def _check_envelope(
    plan: Plan,
    t: float,
    state: np.ndarray,
    limits: Limits,
    params: PlanCheckParameters,
    left_at: float,
) -> Optional[Verdict]:
    """Return a refusal where fence, ground or speed are exceeded, and more than they are now.

    Beyond the fence it may not go farther than ``left_at`` [m], where it was when the fence was
    left, and the tolerance; where it has been pushed farther, the plan must lead back.
    """
    stages = plan.times
    ahead = plan.states[(stages >= t) & (stages <= t + params.clearance_horizon)]
    if not len(ahead):
        return None
    out, now = _outside(ahead, limits), max(0.0, float(_outside(state, limits)))
    worst, allowed = float(out.max()), (left_at if left_at and now else now)
    is_far = now > allowed + params.growth_tolerance
    if is_far and not out[-1] < now:
        return Verdict(Finding.ENVELOPE, f"the plan stays {out[-1]:.2f} m outside the fence")
    if worst > (now if is_far else allowed) + params.growth_tolerance:
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
