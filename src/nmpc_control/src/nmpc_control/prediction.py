# SPDX-License-Identifier: MIT
"""The paper's model (Eqs. 1, 3 and 4) in plain floats.

It tells what the aircraft will do with the inputs really sent. Independent of the solver, so that
plans can be checked and delays bridged while the solver is dead.
"""

import math
from typing import Sequence, Tuple

import numpy as np

from nmpc_control.params import Lag, Vehicle
from nmpc_control.state import GRAVITY, hover_input

Vector = Tuple[float, ...]
MAX_STEP = 0.05  # [s] longest Runge-Kutta step inside predict
SAME_TIME = 1e-9  # [s] two times closer than this are one


def derivative(state: Sequence[float], u: Sequence[float], vehicle: Vehicle) -> Vector:
    """Return the time derivative (10,) of a state (10,) under an input (4,) (paper, Eq. 4)."""
    roll, pitch, yaw, velocity, yaw_rate = state[3], state[4], state[5], state[6:9], state[9]
    drag, push = vehicle.drag.tolist(), vehicle.disturbance.tolist()
    return (
        *velocity,
        (vehicle.roll.gain * u[1] - roll) / vehicle.roll.time_constant,
        (vehicle.pitch.gain * u[2] - pitch) / vehicle.pitch.time_constant,
        yaw_rate,
        *_slope(_lift(roll, pitch, yaw, u[0]), velocity, drag, push),
        (vehicle.yaw_rate.gain * u[3] - yaw_rate) / vehicle.yaw_rate.time_constant,
    )


def step(state: Sequence[float], u: Sequence[float], dt: float, vehicle: Vehicle) -> Vector:
    """Return the state (10,) after ``dt`` [s] of a constant input (4,).

    The lags are linear, so their step is exact; the translation is one Runge-Kutta step of fourth
    order that sees the exact attitude.
    """
    px, py, pz, roll, pitch, yaw, vx, vy, vz, yaw_rate = state
    thrust, half = u[0], dt / 2.0

    def attitude(t: float) -> Vector:
        return (
            _lag(roll, u[1], t, vehicle.roll),
            _lag(pitch, u[2], t, vehicle.pitch),
            _lag_integral(yaw, yaw_rate, u[3], t, vehicle.yaw_rate),
        )

    middle, end = attitude(half), attitude(dt)
    drag, push = vehicle.drag.tolist(), vehicle.disturbance.tolist()
    lift = _lift(*middle, thrust)  # there the slope is taken twice
    v1 = (vx, vy, vz)
    a1 = _slope(_lift(roll, pitch, yaw, thrust), v1, drag, push)
    v2 = _move(v1, a1, half)
    a2 = _slope(lift, v2, drag, push)
    v3 = _move(v1, a2, half)
    a3 = _slope(lift, v3, drag, push)
    v4 = _move(v1, a3, dt)
    a4 = _slope(_lift(*end, thrust), v4, drag, push)
    return (
        *_move((px, py, pz), _mean_slope(v1, v2, v3, v4), dt),
        *end,
        *_move(v1, _mean_slope(a1, a2, a3, a4), dt),
        _lag(yaw_rate, u[3], dt, vehicle.yaw_rate),
    )


def predict(
    state: Sequence[float],
    t0: float,
    t1: float,
    inputs: Sequence[Tuple[float, Sequence[float]]],
    vehicle: Vehicle,
) -> np.ndarray:
    """Return the state (10,) at ``t1`` [s] from the state (10,) at ``t0`` [s].

    Args:
        state: (10,) as the telemetry shows it at ``t0``.
        t0: [s] time of the state.
        t1: [s] time to predict to; before ``t0`` the state is returned as it is.
        inputs: (time sent [s], input (4,)), sorted by time. What acts at a time ``s`` is the input
            last sent at or before ``s - vehicle.delay``; before the first one the hover input.
        vehicle: model and dead time.
    """
    x = tuple(float(value) for value in state)
    acting, t = hover_input(), t0
    for sent, u in inputs:
        effect = sent + vehicle.delay
        if effect >= t1:
            break
        if effect <= t:
            acting = u
            continue
        x, t = _advance(x, acting, effect - t, vehicle), max(t, effect)
        acting = u
    return np.array(_advance(x, acting, t1 - t, vehicle))


def _advance(x: Vector, u: Sequence[float], duration: float, vehicle: Vehicle) -> Vector:
    if duration <= SAME_TIME:
        return x
    count = max(1, math.ceil(duration / MAX_STEP - SAME_TIME))
    u = [float(value) for value in u]
    for _ in range(count):
        x = step(x, u, duration / count, vehicle)
    return x


def _lag(x: float, reference: float, t: float, lag: Lag) -> float:
    final = lag.gain * reference
    return final + (x - final) * math.exp(-t / lag.time_constant)


def _lag_integral(angle: float, rate: float, reference: float, t: float, lag: Lag) -> float:
    final = lag.gain * reference
    return (
        angle + final * t - (rate - final) * lag.time_constant * math.expm1(-t / lag.time_constant)
    )


def _lift(roll: float, pitch: float, yaw: float, thrust: float) -> Vector:
    """Return the acceleration (3,) [m/s^2] by thrust and gravity, world frame."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        thrust * (cr * sp * cy + sr * sy),
        thrust * (cr * sp * sy - sr * cy),
        thrust * cr * cp - GRAVITY,
    )


def _slope(lift: Vector, velocity: Sequence[float], drag: Vector, push: Vector) -> Vector:
    """Return the time derivative (3,) [m/s^2] of a velocity (3,) [m/s]."""
    return (
        lift[0] - drag[0] * velocity[0] + push[0],
        lift[1] - drag[1] * velocity[1] + push[1],
        lift[2] - drag[2] * velocity[2] + push[2],
    )


def _move(start: Vector, slope: Vector, t: float) -> Vector:
    return (start[0] + t * slope[0], start[1] + t * slope[1], start[2] + t * slope[2])


def _mean_slope(k1: Vector, k2: Vector, k3: Vector, k4: Vector) -> Vector:
    return (
        (k1[0] + 2.0 * k2[0] + 2.0 * k3[0] + k4[0]) / 6.0,
        (k1[1] + 2.0 * k2[1] + 2.0 * k3[1] + k4[1]) / 6.0,
        (k1[2] + 2.0 * k2[2] + 2.0 * k3[2] + k4[2]) / 6.0,
    )
