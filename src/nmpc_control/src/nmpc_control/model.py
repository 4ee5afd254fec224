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

import casadi as ca
import numpy as np

from nmpc_control.params import Vehicle
from nmpc_control.state import GRAVITY, NU, NX

INTEGRATORS = ("exact_lag", "rk4", "euler")
DISTURBANCE = slice(10, 13)  # of the model parameters
MODEL_SIZE = 13
# Gauss-Legendre on [0, 1], exact for polynomials of degree five
_NODES = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
_NODE_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


def model_parameters(vehicle: Vehicle) -> np.ndarray:
    """Return the model's run-time parameters (13,).

    Rates 1/tau [1/s] and gains [1] of roll, pitch, yaw rate; drag (3) [1/s]; gravity; disturbance
    (3), a constant acceleration in the world frame [m/s^2].
    """
    lags = [
        (1.0 / lag.time_constant, lag.gain)
        for lag in (vehicle.roll, vehicle.pitch, vehicle.yaw_rate)
    ]
    return np.concatenate([np.ravel(lags), vehicle.drag, [GRAVITY], vehicle.disturbance])


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
    of the linear lags, and integrates the translation that they drive to sixth order.
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
    """Return the step by variation of constants.

    v' = a(t) - b v gives v(dt) = e^(-b dt) v(0) + int_0^dt e^(-b (dt - s)) a(s) ds, and the
    position likewise. The acceleration a depends on the lags alone, which are known exactly; three
    Gauss-Legendre points integrate it.
    """

    def lags(s: float) -> ca.SX:
        """Roll, pitch, yaw, yaw rate after ``s`` seconds."""
        roll = p[1] * u[1] + (x[3] - p[1] * u[1]) * ca.exp(-p[0] * s)
        pitch = p[3] * u[2] + (x[4] - p[3] * u[2]) * ca.exp(-p[2] * s)
        target, decay = p[5] * u[3], ca.exp(-p[4] * s)
        yaw = x[5] + target * s + (x[9] - target) * (1 - decay) / p[4]
        return ca.vertcat(roll, pitch, yaw, target + (x[9] - target) * decay)

    def decay(s: float) -> ca.SX:
        """e^(-b s) as a series, (b s)^4 / 24 short: drag is small and may be zero."""
        return 1 - b * s * (1 - b * s / 2 * (1 - b * s / 3))

    def travel(s: float) -> ca.SX:
        """(1 - e^(-b s)) / b alike."""
        return s * (1 - b * s / 2 * (1 - b * s / 3))

    b, end = p[6:9], lags(dt)
    position = x[0:3] + travel(dt) * x[6:9]
    velocity = decay(dt) * x[6:9]
    for s, weight in zip(dt * _NODES, dt * _NODE_WEIGHTS):
        a = acceleration(lags(s)[:3], ca.SX.zeros(3), u[0], p)
        position += weight * travel(dt - s) * a
        velocity += weight * decay(dt - s) * a
    return ca.vertcat(position, end[:3], velocity, end[3])


def step_function(dt: float, integrator: str = "exact_lag") -> ca.Function:
    """Return the discrete model as a CasADi function (x (10,), u (4,), p (13,)) -> x_next (10,)."""
    x, u, p = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("p", MODEL_SIZE)
    return ca.Function(
        "step", [x, u, p], [discrete(x, u, p, dt, integrator)], ["x", "u", "p"], ["x_next"]
    )


def reference_step(dt: float) -> ca.Function:
    """Return the exact step as a CasADi function (x (10,), u (4,), p (13,)) -> x_next (10,).

    SUNDIALS' CVODES with tight tolerances: what the other integrators are measured against. It
    chooses its own steps and takes a thousand times longer, so no solver uses it.
    """
    x, u, p = ca.SX.sym("x", NX), ca.SX.sym("u", NU), ca.SX.sym("p", MODEL_SIZE)
    problem = {"x": x, "u": u, "p": p, "ode": continuous(x, u, p)}
    options = {"abstol": 1e-12, "reltol": 1e-12, "max_num_steps": 100000}
    cvodes = ca.integrator("cvodes", "cvodes", problem, 0.0, dt, options)
    x, u, p = ca.MX.sym("x", NX), ca.MX.sym("u", NU), ca.MX.sym("p", MODEL_SIZE)
    x_next = cvodes(x0=x, u=u, p=p)["xf"]
    return ca.Function("reference_step", [x, u, p], [x_next], ["x", "u", "p"], ["x_next"])
