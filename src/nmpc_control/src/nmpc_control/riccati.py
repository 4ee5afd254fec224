# SPDX-License-Identifier: MIT
"""The two sweeps of the compiled solver as CasADi functions.

Backward (Newton system), forward (rollout).

Backward, from stage N to 0 (discrete-time Riccati recursion of the Gauss-Newton model, see e.g.
Frison and
Jorgensen 2013; here the previous input is part of the state, so that R_delta keeps the stage
structure):
the exact adjoint gives the gradient g of the cost with respect to every input; inputs that sit on a
bound
with the gradient pushing outward are held (Bertsekas 1982, projected Newton), on a bound of their
rate they
follow the input before; the others get the feedback law du = k + K [dx; du_before]. Forward: the
model is rolled out under that law with step length alpha, inputs
clipped to their bounds, so every iterate satisfies dynamics and bounds exactly.
"""

from typing import List, Optional, Tuple

import casadi as ca
import numpy as np

from nmpc_control.ocp import (
    THETA_SIZE,
    Structure,
    Symbols,
    augmented_residuals,
    inequalities,
    input_bounds,
    next_state,
)
from nmpc_control.small_matrices import (
    cholesky,
    forward_substitution,
    pack_symmetric,
    solve,
    unpack_symmetric,
)
from nmpc_control.state import NU, NX

NZ = NX + NU  # state of the recursion: x and the input before
_ACTIVE_TOLERANCE = 1e-9  # [input unit] distance at which an input counts as on its bound


def sweeps(structure: Structure) -> Tuple[ca.Function, ca.Function, ca.Function]:
    """Return the functions ``backward``, ``backward_exact`` and ``forward`` over the whole horizon.

    backward(X (10, N+1), U (4, N), u_before (4,), stages, theta, multipliers (nc, N+1), damping) ->
        gains (4, 14 N), step (4, N), summary (4,): slope of the cost along the step, largest
        projected
        gradient (scaled by the input ranges), number of active bounds, least pivot of the recursion
    backward_exact: the same with the exact Hessian of the Lagrangian, which need not be
        positive: the least
        pivot says whether its step may be used
    forward(x0 (10,), u_before (4,), X, U, gains, step, alpha, stages, theta, multipliers) -> X_new,
    U_new,
        cost (of the augmented Lagrangian, up to a constant), inequalities (nc, N+1)
    """
    return _backward(structure, False), _backward(structure, True), _forward(structure)


def _backward(structure: Structure, exact: bool) -> ca.Function:
    N = structure.horizon
    last, inner = _terminal_model(structure, exact), _stage_backward(structure, exact)
    X, U = ca.MX.sym("X", NX, N + 1), ca.MX.sym("U", NU, N)
    u_before, stages = ca.MX.sym("u_before", NU), ca.MX.sym("stages", structure.stage_size, N + 1)
    theta, damping = ca.MX.sym("theta", THETA_SIZE), ca.MX.sym("damping")
    multipliers = ca.MX.sym("multipliers", structure.inequalities, N + 1)
    xs, us, data, lam = (
        ca.horzsplit(X),
        ca.horzsplit(U),
        ca.horzsplit(stages),
        ca.horzsplit(multipliers),
    )
    P, s, adjoint = last(xs[N], data[N], theta, lam[N])
    gains: List[ca.MX] = [None] * N
    step: List[ca.MX] = [None] * N
    summary = ca.MX([0.0, 0.0, 0.0, np.inf])
    for k in reversed(range(N)):
        before = us[k - 1] if k else u_before
        gains[k], step[k], P, s, adjoint, summary = inner(
            xs[k], us[k], before, data[k], theta, lam[k], damping, P, s, adjoint, summary
        )
    return ca.Function(
        "backward_exact" if exact else "backward",
        [X, U, u_before, stages, theta, multipliers, damping],
        [ca.horzcat(*gains), ca.horzcat(*step), summary],
        ["X", "U", "u_before", "stages", "theta", "multipliers", "damping"],
        ["gains", "step", "summary"],
    )


def _terminal_model(structure: Structure, exact: bool) -> ca.Function:
    s = Symbols(structure)
    r, w, cost = augmented_residuals(structure, s, terminal=True)
    J = ca.jacobian(r, s.x)
    gradient = 2 * J.T @ (w * r)
    P = ca.SX(NZ, NZ)
    P[:NX, :NX] = ca.hessian(cost, s.x)[0] if exact else 2 * J.T @ (ca.diag(w) @ J)
    adjoint = ca.vertcat(gradient, ca.SX.zeros(NU))
    return ca.Function(
        "terminal_model",
        [s.x, s.stage, s.theta, s.multipliers],
        [pack_symmetric(P), adjoint, adjoint],
    )


def _stage_backward(structure: Structure, exact: bool) -> ca.Function:
    s = Symbols(structure)
    damping = ca.SX.sym("damping")
    P_half = ca.SX.sym("P", NZ * (NZ + 1) // 2)
    value_gradient, adjoint = ca.SX.sym("s", NZ), ca.SX.sym("adjoint", NZ)
    summary = ca.SX.sym("summary", 4)
    P = unpack_symmetric(P_half, NZ)
    Pxx, Pxu, Puu = P[:NX, :NX], P[:NX, NX:], P[NX:, NX:]

    x_next = next_state(structure, s)
    A, B = ca.jacobian(x_next, s.x), ca.jacobian(x_next, s.u)
    r, w, cost = augmented_residuals(structure, s, terminal=False)
    z = ca.vertcat(s.x, s.u_before)
    Jz, Ju = ca.jacobian(r, z), ca.jacobian(r, s.u)
    cost_z, cost_u = 2 * Jz.T @ (w * r), 2 * Ju.T @ (w * r)
    lagrangian = cost + ca.dot(adjoint[:NX], x_next) if exact else None
    Hzz, Huz, Huu = _hessian(r, w, lagrangian, z, s.u)

    # exact gradient of the cost along the dynamics, and the bounds that hold an input
    gradient = cost_u + B.T @ adjoint[:NX] + adjoint[NX:]
    low, high = input_bounds(structure, s)
    held_low = ca.logic_and(s.u <= low + _ACTIVE_TOLERANCE, gradient > 0)
    held_high = ca.logic_and(s.u >= high - _ACTIVE_TOLERANCE, gradient < 0)
    free = 1 - ca.logic_or(held_low, held_high)
    # an input held by its rate follows the input before
    by_rate = ca.logic_or(
        ca.logic_and(held_low, low > s.u_min), ca.logic_and(held_high, high < s.u_max)
    )
    H = ca.horzcat(ca.SX(NU, NX), ca.diag(by_rate))
    adjoint_before = cost_z + ca.vertcat(A.T @ adjoint[:NX], by_rate * gradient)

    # quadratic model of the cost to go in (dz, du)
    PA, BP = Pxx @ A, B.T @ Pxx + Pxu.T
    Qzz, Quz, Quu = Hzz, Huz, Huu + BP @ B + B.T @ Pxu + Puu
    Qzz[:NX, :NX] += A.T @ PA
    Quz[:, :NX] += BP @ A
    qu = cost_u + B.T @ value_gradient[:NX] + value_gradient[NX:]
    qz = cost_z + ca.vertcat(A.T @ value_gradient[:NX], ca.SX.zeros(NU))

    F = ca.diag(free)
    L, pivots = cholesky(F @ (Quu + damping * ca.SX.eye(NU)) @ F + ca.diag(1 - free))
    coupling = F @ (Quz + Quu @ H)
    step = -solve(L, free * qu)
    gains = H - solve(L, coupling)
    half = forward_substitution(L, coupling)
    mixed = H.T @ Quz
    P_before = Qzz + mixed + mixed.T + H.T @ Quu @ H - half.T @ half
    s_before = qz + H.T @ qu + coupling.T @ step

    span = s.u_max - s.u_min
    violation = ca.mmax(ca.fabs(s.u - ca.fmin(ca.fmax(s.u - gradient * span**2, low), high)) / span)
    new_summary = ca.vertcat(
        summary[0]
        + ca.dot(free * qu, step),  # qu is the gradient under the feedback of the later stages
        ca.fmax(summary[1], violation),
        summary[2] + NU - ca.sum1(free),
        ca.fmin(summary[3], ca.mmin(ca.vertcat(*pivots))),
    )
    return ca.Function(
        "stage_backward",
        [
            s.x,
            s.u,
            s.u_before,
            s.stage,
            s.theta,
            s.multipliers,
            damping,
            P_half,
            value_gradient,
            adjoint,
            summary,
        ],
        [ca.densify(gains), step, pack_symmetric(P_before), s_before, adjoint_before, new_summary],
    )


def _forward(structure: Structure) -> ca.Function:
    N = structure.horizon
    s = Symbols(structure)
    x_bar, u_bar, before_bar = (
        ca.SX.sym("x_bar", NX),
        ca.SX.sym("u_bar", NU),
        ca.SX.sym("b_bar", NU),
    )
    K, step, alpha = ca.SX.sym("K", NU, NZ), ca.SX.sym("step", NU), ca.SX.sym("alpha")
    deviation = ca.vertcat(s.x - x_bar, s.u_before - before_bar)
    law = u_bar + alpha * step + K @ deviation
    low, high = input_bounds(structure, s)
    u = ca.fmin(ca.fmax(law, low), high)
    outputs = [
        next_state(structure, s),
        augmented_residuals(structure, s, False)[2],
        inequalities(structure, s),
    ]
    x_next, cost, g = ca.substitute(outputs, [s.u], [u])
    inner = ca.Function(
        "stage_forward",
        [
            s.x,
            s.u_before,
            x_bar,
            u_bar,
            before_bar,
            K,
            step,
            alpha,
            s.stage,
            s.theta,
            s.multipliers,
        ],
        [x_next, u, cost, ca.densify(g)],
    )
    g = inequalities(structure, s)
    last = ca.Function(
        "terminal_cost",
        [s.x, s.stage, s.theta, s.multipliers],
        [augmented_residuals(structure, s, True)[2], ca.densify(g)],
    )

    x0, u_before, length = ca.MX.sym("x0", NX), ca.MX.sym("u_before", NU), ca.MX.sym("alpha")
    X, U = ca.MX.sym("X", NX, N + 1), ca.MX.sym("U", NU, N)
    gains, steps = ca.MX.sym("gains", NU, NZ * N), ca.MX.sym("step", NU, N)
    stages, theta = ca.MX.sym("stages", structure.stage_size, N + 1), ca.MX.sym("theta", THETA_SIZE)
    multipliers = ca.MX.sym("multipliers", structure.inequalities, N + 1)
    lam = ca.horzsplit(multipliers)
    xs, us, data, ks = (
        ca.horzsplit(X),
        ca.horzsplit(U),
        ca.horzsplit(stages),
        ca.horzsplit(gains, NZ),
    )
    step_k = ca.horzsplit(steps)
    x, before, before_nominal, total = x0, u_before, u_before, 0
    X_new, U_new, G = [x0], [], []
    for k in range(N):
        x, u, cost, g = inner(
            x,
            before,
            xs[k],
            us[k],
            before_nominal,
            ks[k],
            step_k[k],
            length,
            data[k],
            theta,
            lam[k],
        )
        before, before_nominal, total = u, us[k], total + cost
        X_new.append(x)
        U_new.append(u)
        G.append(g)
    cost, g = last(x, data[N], theta, lam[N])
    total += cost
    return ca.Function(
        "forward",
        [x0, u_before, X, U, gains, steps, length, stages, theta, multipliers],
        [ca.horzcat(*X_new), ca.horzcat(*U_new), total, ca.horzcat(*G, g)],
        ["x0", "u_before", "X", "U", "gains", "step", "alpha", "stages", "theta", "multipliers"],
        ["X_new", "U_new", "cost", "inequalities"],
    )


def _hessian(
    r: ca.SX, w: ca.SX, lagrangian: Optional[ca.SX], z: ca.SX, u: ca.SX
) -> Tuple[ca.SX, ca.SX, ca.SX]:
    """Return the blocks zz, uz, uu of the Hessian of w'r^2 (+ adjoint' F).

    Exact, or Gauss-Newton without F.
    """
    if lagrangian is not None:
        both = ca.vertcat(z, u)
        H = ca.hessian(lagrangian, both)[0]
        return H[:NZ, :NZ], H[NZ:, :NZ], H[NZ:, NZ:]
    Jz, Ju, W = ca.jacobian(r, z), ca.jacobian(r, u), ca.diag(w)
    return 2 * Jz.T @ (W @ Jz), 2 * Ju.T @ (W @ Jz), 2 * Ju.T @ (W @ Ju)
