# SPDX-License-Identifier: MIT
"""Do a plan's states follow from its inputs, by the guard's own model, and where do those lead?

A plan of a solver that was told to use a coarser integrator (``rk4``, ``euler``: the paper's Eq. 6)
departs from that model by what the integrator gets wrong, which is no fault of the plan. It is
consistent when one of them explains every stage of it, and that far more closely than the
tolerances of the default. It gains nothing by that: clearance, fence and speed are checked on the
states to which its inputs really lead (``as_flown``).
"""

import math
from dataclasses import replace
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.params import Lag, Vehicle
from nmpc_control.prediction import Vector, derivative, predict, step
from nmpc_control.state import (
    ATTITUDE,
    GRAVITY,
    PITCH,
    PITCH_REF,
    POSITION,
    ROLL,
    ROLL_REF,
    THRUST,
    VELOCITY,
    YAW,
    YAW_RATE,
    YAW_RATE_REF,
    Plan,
)

OPEN_LOOP = 1.0  # [s] for which a plan may be flown without another
SETTLING = 0.5  # [s] in which later plans come back to this one
EXPLAINED = 5e-3  # [m, rad, m/s, rad/s] by which a plan may depart from its own coarse integrator
# [m/s^2] mean that velocities may gain over what inputs make, stage after stage: by how much two
# estimates of the same disturbance differ (up to 1.3 in gusts of the level `harsh`), with some room
SUMMED = 1.5
PARTS = (
    ("position", POSITION, "m"),
    ("attitude", ATTITUDE, "rad"),
    ("velocity", VELOCITY, "m/s"),
    ("yaw rate", slice(YAW_RATE, YAW_RATE + 1), "rad/s"),
)
Step = Callable[[Sequence[float], Sequence[float], float, Vehicle], Vector]


class Departure(NamedTuple):
    """The worst departure of a plan from the model in one part of the state."""

    part: str
    size: float
    unit: str
    stage: int

    def __str__(self) -> str:
        size = f"{self.size:.2g} {self.unit}"
        return f"the plan's {self.part} departs from the model by {size} at stage {self.stage}"


def departure(plan: Plan, vehicle: Vehicle, tolerances: Sequence[float]) -> Optional[Departure]:
    """Return where a plan departs from the model by more than is tolerated, None where it does not.

    Args:
        plan: of finite numbers and fitting shapes.
        vehicle: the guard's own model.
        tolerances: of position [m], attitude [rad], velocity [m/s], yaw rate [rad/s] per stage.
    """
    expected = steps(plan.states[:-1], plan.inputs, plan.dt, vehicle)
    worst = (*_departures(plan, expected), _summed(plan, expected))
    limits = (*tolerances, SUMMED)
    beyond = [d for d, tolerance in zip(worst, limits) if not d.size <= tolerance]
    if not beyond or any(_explains(coarse, plan, vehicle) for coarse in (rk4_step, euler_step)):
        return None
    return beyond[0]


def as_flown(
    plan: Plan,
    t: float,
    state: np.ndarray,
    inputs: Sequence[Tuple[float, Sequence[float]]],
    vehicle: Vehicle,
) -> Plan:
    """Return the plan with the states to which its inputs take the aircraft from where it is.

    A plan that is consistent in itself may begin beside the aircraft; what counts is where its
    inputs lead. They are the last word for ``OPEN_LOOP``; farther ahead new plans will have made up
    for what the model lacks, so that the plan's own states are approached.
    """
    states = plan.states.copy()
    first = max(0, math.ceil((t - plan.t - plan.delay) / plan.dt))
    if first > plan.horizon:
        return plan
    sent = [(plan.t + k * plan.dt, u) for k, u in enumerate(plan.inputs[: first + 1])]
    history = [*inputs, *((max(when, t), u) for when, u in sent)]
    begin = plan.t + plan.delay + first * plan.dt
    states[first] = predict(state, t, begin, history, vehicle)
    last = min(plan.horizon, first + math.ceil(OPEN_LOOP / plan.dt))
    x, given = states[first].tolist(), plan.inputs[first:last].tolist()  # plain floats are quicker
    for k, u in enumerate(given, first + 1):
        x = states[k] = step(x, u, plan.dt, vehicle)
    ahead = plan.dt * np.arange(1, plan.horizon - last + 1)
    offset = states[last] - plan.states[last]
    states[last + 1 :] += np.exp(-ahead / SETTLING)[:, None] * offset
    return replace(plan, states=states)


def euler_step(state: Sequence[float], u: Sequence[float], dt: float, vehicle: Vehicle) -> Vector:
    """Return the state (10,) after one explicit Euler step of ``dt`` [s] (paper, Eq. 6)."""
    return _along(state, derivative(state, u, vehicle), dt)


def rk4_step(state: Sequence[float], u: Sequence[float], dt: float, vehicle: Vehicle) -> Vector:
    """Return the state (10,) after one classical Runge-Kutta step of ``dt`` [s]."""
    k1 = derivative(state, u, vehicle)
    k2 = derivative(_along(state, k1, dt / 2.0), u, vehicle)
    k3 = derivative(_along(state, k2, dt / 2.0), u, vehicle)
    k4 = derivative(_along(state, k3, dt), u, vehicle)
    mean = [(a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4)]
    return _along(state, mean, dt)


def _along(state: Sequence[float], slope: Sequence[float], t: float) -> Vector:
    return tuple(x + t * k for x, k in zip(state, slope))


def steps(states: np.ndarray, inputs: np.ndarray, dt: float, vehicle: Vehicle) -> np.ndarray:
    """Return the states (M, 10) after ``dt`` [s], each from its own state and input (M, 4).

    As ``prediction.step``, all at once.
    """
    v, rate = states[:, VELOCITY], states[:, YAW_RATE]

    def attitude(t: float) -> np.ndarray:
        roll = _lagged(states[:, ROLL], inputs[:, ROLL_REF], t, vehicle.roll)
        pitch = _lagged(states[:, PITCH], inputs[:, PITCH_REF], t, vehicle.pitch)
        lag, final = vehicle.yaw_rate, vehicle.yaw_rate.gain * inputs[:, YAW_RATE_REF]
        turned = (rate - final) * lag.time_constant * np.expm1(-t / lag.time_constant)
        return np.stack([roll, pitch, states[:, YAW] + final * t - turned])

    def acceleration(angles: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
        axis = np.stack([cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp], axis=1)
        pull = vehicle.disturbance - np.array([0.0, 0.0, GRAVITY])
        return inputs[:, THRUST, None] * axis + pull - vehicle.drag * velocity

    middle, end = attitude(dt / 2.0), attitude(dt)
    a1 = acceleration(states[:, ATTITUDE].T, v)
    v2 = v + dt / 2.0 * a1
    a2 = acceleration(middle, v2)
    v3 = v + dt / 2.0 * a2
    a3 = acceleration(middle, v3)
    v4 = v + dt * a3
    a4 = acceleration(end, v4)
    result = np.empty_like(states)
    result[:, POSITION] = states[:, POSITION] + dt / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    result[:, ATTITUDE] = end.T
    result[:, VELOCITY] = v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    result[:, YAW_RATE] = _lagged(rate, inputs[:, YAW_RATE_REF], dt, vehicle.yaw_rate)
    return result


def _lagged(x: np.ndarray, reference: np.ndarray, t: float, lag: Lag) -> np.ndarray:
    final = lag.gain * reference
    return final + (x - final) * math.exp(-t / lag.time_constant)


def _explains(coarse: Step, plan: Plan, vehicle: Vehicle) -> bool:
    states, inputs = plan.states.tolist(), plan.inputs.tolist()
    expected = np.array([coarse(x, u, plan.dt, vehicle) for x, u in zip(states, inputs)])
    return all(d.size <= EXPLAINED for d in _departures(plan, expected))


def _summed(plan: Plan, expected: np.ndarray) -> Departure:
    """Return the largest mean residual of velocity over the first stages, ``OPEN_LOOP`` or more.

    Each may be small enough, and all of them a brake that the inputs do not make.
    """
    least = min(plan.horizon, math.ceil(OPEN_LOOP / plan.dt))
    total = np.cumsum((plan.states[1:] - expected)[:, VELOCITY], axis=0)
    mean = np.linalg.norm(total, axis=1) / (plan.dt * np.arange(1, plan.horizon + 1))
    k = least - 1 + int(mean[least - 1 :].argmax())
    return Departure("velocity on average", float(mean[k]), "m/s^2", k)


def _departures(plan: Plan, expected: np.ndarray) -> Tuple[Departure, ...]:
    residual = np.abs(plan.states[1:] - expected)
    worst: List[Departure] = []
    for name, part, unit in PARTS:
        by_stage = residual[:, part].max(axis=1)
        k = int(by_stage.argmax())
        worst.append(Departure(name, float(by_stage[k]), unit, k))
    return tuple(worst)
