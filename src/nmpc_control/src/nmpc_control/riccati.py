# SPDX-License-Identifier: MIT
"""The backward sweep of the compiled solver: a Newton step of the whole horizon, stage by stage.

From stage N to 0 (discrete-time Riccati recursion, see e.g. Frison and Jorgensen 2013; here the
previous input is part of the state, so that R_delta keeps the stage structure). The exact adjoint
gives the gradient of the cost by every input; an input on a bound with the gradient pushing outward
is held (Bertsekas 1982, projected Newton), one whose step would cross a bound is sent to the bound
(Tassa et al. 2014); on a bound of its rate it follows the input before. The others get the feedback
law du = step + K [dx; du_before].
"""

from typing import List, Tuple

import casadi as ca
import numpy as np

from nmpc_control import augmented, obstacle_terms
from nmpc_control.ocp import THETA_SIZE, Structure, Symbols, input_bounds, next_state
from nmpc_control.parametric import StageFunction, stage_function
from nmpc_control.small_matrices import (
    cholesky,
    forward_substitution,
    pack_symmetric,
    solve,
    unpack_symmetric,
)
from nmpc_control.state import NU, NX

NZ = NX + NU  # state of the recursion: x and the input before
# rows of a sweep's summary: derivative of the cost along the step with its feedback, by how much
# the full step lowers the model of the cost, largest projected gradient scaled by the input ranges,
# inputs on a bound, least pivot of the recursion, inputs that the step takes to a bound or from it
SUMMARY = ("slope", "promise", "residual", "active", "pivot", "changed")
_ACTIVE_TOLERANCE = 1e-9  # [input unit] distance at which an input counts as on its bound


def backward(structure: Structure, exact: bool) -> ca.Function:
    """Return the function ``backward`` or ``backward_exact``.

    (X (10, N+1), U (4, N), u_before (4,), stages, theta, multipliers (nc, N+1), damping,
    clamping) -> gains (4, 14 N), step (4, N), summary (6,). With ``clamping`` 0 only held inputs
    are fixed. The exact Hessian of the Lagrangian need not be
    positive: the least pivot says whether its step may be used.
    """
    N = structure.horizon
    last, (prepare, inner) = _terminal_model(structure, exact), _stage_backward(structure, exact)
    X, U = ca.MX.sym("X", NX, N + 1), ca.MX.sym("U", NU, N)
    u_before, stages = ca.MX.sym("u_before", NU), ca.MX.sym("stages", structure.stage_size, N + 1)
    theta = ca.MX.sym("theta", THETA_SIZE)
    damping, clamping = ca.MX.sym("damping"), ca.MX.sym("clamping")
    multipliers = ca.MX.sym("multipliers", structure.inequalities, N + 1)
    xs, us, data = ca.horzsplit(X), ca.horzsplit(U), ca.horzsplit(stages)
    forces = ca.horzsplit(multipliers)
    gradients, hessians = [ca.MX.zeros(3)] * (N + 1), [ca.MX.zeros(6)] * (N + 1)
    if structure.obstacle_slots:
        all_stages = obstacle_terms.derivatives(structure, exact).map(N + 1)
        obstacles = all_stages(X, stages, ca.repmat(theta, 1, N + 1), multipliers)
        gradients, hessians = (ca.horzsplit(part) for part in obstacles)
    shared = prepare(theta)
    P, s, adjoint, along = last(xs[N], data[N], theta, forces[N], gradients[N], hessians[N])
    gains: List[ca.MX] = [None] * N
    step: List[ca.MX] = [None] * N
    summary = ca.MX([0.0, 0.0, 0.0, 0.0, np.inf, 0.0])
    for k in reversed(range(N)):
        before = us[k - 1] if k else u_before
        here = [xs[k], us[k], before, data[k], forces[k], gradients[k], hessians[k]]
        gains[k], step[k], P, s, adjoint, along, summary = inner(
            *here, damping, clamping, P, s, adjoint, along, summary, shared
        )
    return ca.Function(
        "backward_exact" if exact else "backward",
        [X, U, u_before, stages, theta, multipliers, damping, clamping],
        [ca.horzcat(*gains), ca.horzcat(*step), summary],
        ["X", "U", "u_before", "stages", "theta", "multipliers", "damping", "clamping"],
        ["gains", "step", "summary"],
    )


def _terminal_model(structure: Structure, exact: bool) -> ca.Function:
    s = Symbols(structure)
    obstacle_gradient, obstacle_hessian = ca.SX.sym("g", 3), ca.SX.sym("H", 6)
    gradient, H = augmented.derivatives(s, True, ca.SX(0) if exact else None, s.x)
    P = ca.SX(NZ, NZ)
    P[:NX, :NX] = H
    P[:3, :3] += unpack_symmetric(obstacle_hessian, 3)
    gradient[:3] += obstacle_gradient
    adjoint = ca.vertcat(gradient, ca.SX.zeros(NU))
    return ca.Function(
        "terminal_model",
        [s.x, s.stage, s.theta, s.multipliers, obstacle_gradient, obstacle_hessian],
        [pack_symmetric(P), adjoint, adjoint, adjoint],
    )


def _stage_backward(structure: Structure, exact: bool) -> StageFunction:
    s = Symbols(structure)
    obstacle_gradient, obstacle_hessian = ca.SX.sym("g", 3), ca.SX.sym("H", 6)
    damping, clamping = ca.SX.sym("damping"), ca.SX.sym("clamping")
    P_half = ca.SX.sym("P", NZ * (NZ + 1) // 2)
    # gradients by the next state: of the model's value, of the cost, of the cost under the feedback
    value_gradient, adjoint, along = (ca.SX.sym(name, NZ) for name in ("s", "adjoint", "along"))
    summary = ca.SX.sym("summary", len(SUMMARY))
    P = unpack_symmetric(P_half, NZ)
    Pxx, Pxu, Puu = P[:NX, :NX], P[:NX, NX:], P[NX:, NX:]

    x_next = next_state(structure, s)
    A, B = ca.jacobian(x_next, s.x), ca.jacobian(x_next, s.u)
    value = ca.dot(adjoint[:NX], x_next) if exact else None
    cost, H = augmented.derivatives(s, False, value, ca.vertcat(s.x, s.u_before, s.u))
    cost_z, cost_u = cost[:NZ], cost[NZ:]
    Hzz, Huz, Huu = H[:NZ, :NZ], H[NZ:, :NZ], H[NZ:, NZ:]
    cost_z[:3] += obstacle_gradient
    Hzz[:3, :3] += unpack_symmetric(obstacle_hessian, 3)

    # exact gradient of the cost along the dynamics, and the bounds that hold an input
    gradient = cost_u + B.T @ adjoint[:NX] + adjoint[NX:]
    low, high = input_bounds(structure, s)
    on_low, on_high = s.u <= low + _ACTIVE_TOLERANCE, s.u >= high - _ACTIVE_TOLERANCE
    held_low, held_high = ca.logic_and(on_low, gradient > 0), ca.logic_and(on_high, gradient < 0)
    by_rate = _by_rate(held_low, held_high, low, high, s)
    adjoint_before = cost_z + ca.vertcat(A.T @ adjoint[:NX], by_rate * gradient)

    # quadratic model of the cost to go in (dz, du)
    PA, BP = Pxx @ A, B.T @ Pxx + Pxu.T
    Qzz, Quz, Quu = Hzz, Huz, Huu + BP @ B + B.T @ Pxu + Puu
    Qzz[:NX, :NX] += A.T @ PA
    Quz[:, :NX] += BP @ A
    qu = cost_u + B.T @ value_gradient[:NX] + value_gradient[NX:]
    qz = cost_z + ca.vertcat(A.T @ value_gradient[:NX], ca.SX.zeros(NU))

    damped = Quu + damping * ca.SX.eye(NU)
    free = 1 - ca.logic_or(held_low, held_high)
    tried, _, tried_pivots = _free_step(damped, qu, free, ca.SX.zeros(NU))
    at_low = ca.logic_or(held_low, clamping * (tried < low - s.u))
    at_high = ca.logic_or(held_high, clamping * (tried > high - s.u))
    free = 1 - ca.logic_or(at_low, at_high)
    fixed = ca.if_else(at_low, low - s.u, ca.if_else(at_high, high - s.u, 0))
    step, L, pivots = _free_step(damped, qu, free, fixed)
    follow = ca.horzcat(ca.SX(NU, NX), ca.diag(_by_rate(at_low, at_high, low, high, s)))
    coupling = ca.diag(free) @ (Quz + damped @ follow)
    gains = follow - solve(L, coupling)
    half = forward_substitution(L, coupling)
    mixed = follow.T @ Quz
    P_before = Qzz + mixed + mixed.T + follow.T @ damped @ follow - half.T @ half
    s_before = qz + follow.T @ (qu + damped @ step) + Quz.T @ step

    along_u = cost_u + B.T @ along[:NX] + along[NX:]
    along_before = cost_z + ca.vertcat(A.T @ along[:NX], ca.SX.zeros(NU)) + gains.T @ along_u

    span = s.u_max - s.u_min
    violation = ca.mmax(ca.fabs(s.u - ca.fmin(ca.fmax(s.u - gradient * span**2, low), high)) / span)
    new_summary = ca.vertcat(
        summary[0] + ca.dot(along_u, step),
        summary[1] - ca.dot(step, qu + Quu @ step / 2),
        ca.fmax(summary[2], violation),
        summary[3] + NU - ca.sum1(free),
        ca.fmin(summary[4], ca.mmin(ca.vertcat(*pivots, *tried_pivots))),
        summary[5] + ca.sum1(ca.fabs(ca.logic_or(on_low, on_high) - (1 - free))),
    )
    return stage_function(
        "stage_backward",
        [s.x, s.u, s.u_before, s.stage, s.multipliers, obstacle_gradient, obstacle_hessian]
        + [damping, clamping, P_half, value_gradient, adjoint, along, summary],
        s.theta,
        [gains, step, pack_symmetric(P_before)]
        + [s_before, adjoint_before, along_before, new_summary],
    )


def _by_rate(at_low: ca.SX, at_high: ca.SX, low: ca.SX, high: ca.SX, s: Symbols) -> ca.SX:
    """Return which inputs (4,) are on a bound of their rate, and so follow the input before."""
    return ca.logic_or(ca.logic_and(at_low, low > s.u_min), ca.logic_and(at_high, high < s.u_max))


def _free_step(Q: ca.SX, q: ca.SX, free: ca.SX, fixed: ca.SX) -> Tuple[ca.SX, ca.SX, List[ca.SX]]:
    """Return the step (4,) least in d'Qd/2 + q'd with some of it fixed, and the factor of Q."""
    F = ca.diag(free)
    L, pivots = cholesky(F @ Q @ F + ca.diag(1 - free))
    return fixed - solve(L, free * (q + Q @ fixed)), L, pivots
