# SPDX-License-Identifier: MIT
"""Model of the M100 with its inner attitude loops (paper, Eqs.

1, 3, 4), continuous and discrete, in CasADi.

With e_z the body z axis in the world frame, T the mass-normalised thrust and b the drag:

    p' = v                      phi'   = (k_phi phi_r - phi) / tau_phi       psi' = r
    v' = T e_z - g - b v + d    theta' = (k_theta theta_r - theta) / tau_theta    r' = (k_psi r_r -
    r) / tau_psi

The paper's text subtracts a drag that is negative already (it would accelerate) and calls the roll
and
pitch references rates; here drag decelerates in the world frame and the references are angles. The
paper's k / tau is ``1 / time_constant`` here. ``d`` is a constant acceleration that the model does
not know.
"""

from typing import Optional

import casadi as ca
import numpy as np

from nmpc_control.params import Vehicle
from nmpc_control.state import GRAVITY, NU, NX

INTEGRATORS = ("exact_lag", "rk4", "euler")
MODEL_SIZE = 13


def model_parameters(vehicle: Vehicle, disturbance: Optional[np.ndarray] = None) -> np.ndarray:
    """Return the model's run-time parameters (13,).

    Args:
        vehicle: lags, gains and drag.
        disturbance: (3,) constant acceleration in the world frame [m/s^2].

    Returns:
        Rates 1/tau [1/s] and gains [1] of roll, pitch, yaw rate; drag (3) [1/s]; gravity;
        disturbance (3).
    """
    d = np.zeros(3) if disturbance is None else disturbance
    lags = [
        (1.0 / lag.time_constant, lag.gain)
        for lag in (vehicle.roll, vehicle.pitch, vehicle.yaw_rate)
    ]
    return np.concatenate([np.ravel(lags), vehicle.drag, [GRAVITY], d])


def continuous(x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
    """Return the state derivative (10,) for state (10,), input (4,) and model parameters (13,)."""
    roll_rate = p[0] * (p[1] * u[1] - x[3])
    pitch_rate = p[2] * (p[3] * u[2] - x[4])
    yaw_acceleration = p[4] * (p[5] * u[3] - x[9])
    return ca.vertcat(
        x[6:9], roll_rate, pitch_rate, x[9], acceleration(x[3:6], x[6:9], u[0], p), yaw_acceleration
    )


def acceleration(angles: ca.SX, velocity: ca.SX, thrust: ca.SX, p: ca.SX) -> ca.SX:
    """Return the world acceleration (3,) [m/s^2] of Eq.

    1 for roll, pitch, yaw, velocity and thrust.
    """
    cr, sr = ca.cos(angles[0]), ca.sin(angles[0])
    cp, sp = ca.cos(angles[1]), ca.sin(angles[1])
    cy, sy = ca.cos(angles[2]), ca.sin(angles[2])
    e_z = ca.vertcat(cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp)
    return thrust * e_z - ca.vertcat(0, 0, p[9]) - p[6:9] * velocity + p[10:13]


def discrete(x: ca.SX, u: ca.SX, p: ca.SX, dt: float, integrator: str) -> ca.SX:
    """Return the state (10,) one step ``dt`` [s] later under a constant input.

    ``euler`` is the paper's Eq. 6; ``rk4`` the classical scheme; ``exact_lag`` uses the exact step
    of the
    linear lags and Runge-Kutta weights for the translation that they drive.
    """
    if integrator == "euler":
        return x + dt * continuous(x, u, p)
    if integrator == "rk4":
        k1 = continuous(x, u, p)
        k2 = continuous(x + dt / 2 * k1, u, p)
        k3 = continuous(x + dt / 2 * k2, u, p)
        k4 = continuous(x + dt * k3, u, p)
        return x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    if integrator == "exact_lag":
        return _exact_lag(x, u, p, dt)
    raise ValueError(f"integrator: got {integrator!r}, expected one of {', '.join(INTEGRATORS)}")


def _exact_lag(x: ca.SX, u: ca.SX, p: ca.SX, dt: float) -> ca.SX:
    def lags(s: float) -> ca.SX:
        """Roll, pitch, yaw, yaw rate after ``s`` seconds."""
        roll = p[1] * u[1] + (x[3] - p[1] * u[1]) * ca.exp(-p[0] * s)
        pitch = p[3] * u[2] + (x[4] - p[3] * u[2]) * ca.exp(-p[2] * s)
        target, decay = p[5] * u[3], ca.exp(-p[4] * s)
        yaw = x[5] + target * s + (x[9] - target) * (1 - decay) / p[4]
        return ca.vertcat(roll, pitch, yaw, target + (x[9] - target) * decay)

    velocity = x[6:9]
    middle, end = lags(dt / 2), lags(dt)
    a1 = acceleration(x[3:6], velocity, u[0], p)
    a2 = acceleration(middle[:3], velocity + dt / 2 * a1, u[0], p)
    a3 = a2 - p[6:9] * (dt / 2) * (a2 - a1)
    a4 = acceleration(end[:3], velocity + dt * a3, u[0], p)
    position = x[0:3] + dt * velocity + dt**2 / 6 * (a1 + a2 + a3)
    return ca.vertcat(position, end[:3], velocity + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4), end[3])


def step_function(dt: float, integrator: str = "exact_lag") -> ca.Function:
    """Return the discrete model as a CasADi function (x (10,), u (4,), p (13,)) -> x_next (10,)."""
    x, u, p = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("p", MODEL_SIZE)
    return ca.Function(
        "step", [x, u, p], [discrete(x, u, p, dt, integrator)], ["x", "u", "p"], ["x_next"]
    )
