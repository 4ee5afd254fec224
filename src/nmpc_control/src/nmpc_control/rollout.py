# SPDX-License-Identifier: MIT
"""The forward sweep of the compiled solver: the model rolled out under the feedback law, and costs.

Inputs are clipped to their bounds on the way, so every iterate satisfies dynamics and bounds.
"""

import casadi as ca

from nmpc_control import augmented, obstacle_terms
from nmpc_control.ocp import THETA_SIZE, Structure, Symbols, input_bounds, next_state
from nmpc_control.parametric import StageFunction, stage_function
from nmpc_control.riccati import NZ
from nmpc_control.state import NU, NX


def forward(structure: Structure) -> ca.Function:
    """Return the function ``forward``.

    (x0 (10,), u_before (4,), X (10, N+1), U (4, N), gains (4, 14 N), step (4, N), alpha, stages,
    theta, multipliers (nc, N+1)) -> X_new, U_new, cost (2,): tracking and potentials, penalties of
    the augmented Lagrangian.
    """
    N = structure.horizon
    prepare, inner = _stage_forward(structure)
    x0, u_before, alpha = ca.MX.sym("x0", NX), ca.MX.sym("u_before", NU), ca.MX.sym("alpha")
    X, U = ca.MX.sym("X", NX, N + 1), ca.MX.sym("U", NU, N)
    gains, step = ca.MX.sym("gains", NU, NZ * N), ca.MX.sym("step", NU, N)
    stages, theta = ca.MX.sym("stages", structure.stage_size, N + 1), ca.MX.sym("theta", THETA_SIZE)
    multipliers = ca.MX.sym("multipliers", structure.inequalities, N + 1)
    xs, us, data, forces, laws, steps = (
        ca.horzsplit(X),
        ca.horzsplit(U),
        ca.horzsplit(stages),
        ca.horzsplit(multipliers),
        ca.horzsplit(gains, NZ),
        ca.horzsplit(step),
    )
    x, before, nominal, cost = x0, u_before, u_before, ca.MX.zeros(2)
    states, inputs, shared = [x0], [], prepare(theta)
    for k in range(N):
        law = [xs[k], us[k], nominal, laws[k], steps[k], alpha]
        x, u, cost = inner(x, before, *law, data[k], forces[k], cost, shared)
        before, nominal = u, us[k]
        states.append(x)
        inputs.append(u)
    s = Symbols(structure)
    end = ca.Function(
        "terminal_cost",
        [s.x, s.stage, s.theta, s.multipliers],
        [augmented.stage_cost(s, terminal=True)],
    )
    cost += end(x, data[N], theta, forces[N])
    X_new = ca.horzcat(*states)
    if structure.obstacle_slots:
        obstacles = obstacle_terms.value(structure).map(N + 1)
        cost += ca.sum2(obstacles(X_new, stages, ca.repmat(theta, 1, N + 1), multipliers))
    return ca.Function(
        "forward",
        [x0, u_before, X, U, gains, step, alpha, stages, theta, multipliers],
        [X_new, ca.horzcat(*inputs), cost],
        ["x0", "u_before", "X", "U", "gains", "step", "alpha", "stages", "theta", "multipliers"],
        ["X_new", "U_new", "cost"],
    )


def settle(structure: Structure) -> ca.Function:
    """Return the function ``settle``: the outer iteration's view of a rollout.

    (X (10, N+1), stages, theta, multipliers) -> sums (3,), maxima (4,) (``augmented.SUMS``,
    ``augmented.MAXIMA``), multipliers_new (nc, N+1).
    """
    N = structure.horizon
    X, stages = ca.MX.sym("X", NX, N + 1), ca.MX.sym("stages", structure.stage_size, N + 1)
    theta = ca.MX.sym("theta", THETA_SIZE)
    multipliers = ca.MX.sym("multipliers", structure.inequalities, N + 1)
    thetas = ca.repmat(theta, 1, N + 1)
    pilot = augmented.settle_pilot_bounds(structure).map(N + 1)
    sums, maxima, new = pilot(X, thetas, multipliers)
    if structure.obstacle_slots:
        obstacles = obstacle_terms.settle(structure).map(N + 1)(X, stages, thetas, multipliers)
        sums, maxima = sums + obstacles[0], ca.fmax(maxima, obstacles[1])
        new = ca.vertcat(new, obstacles[2])
    largest = ca.vertcat(*[ca.mmax(row) for row in ca.vertsplit(maxima)])
    return ca.Function(
        "settle",
        [X, stages, theta, multipliers],
        [ca.sum2(sums), largest, new],
        ["X", "stages", "theta", "multipliers"],
        ["sums", "maxima", "multipliers_new"],
    )


def _stage_forward(structure: Structure) -> StageFunction:
    s = Symbols(structure)
    x_bar, u_bar, before_bar = (
        ca.SX.sym("x_bar", NX),
        ca.SX.sym("u_bar", NU),
        ca.SX.sym("b_bar", NU),
    )
    K, step, alpha = ca.SX.sym("K", NU, NZ), ca.SX.sym("step", NU), ca.SX.sym("alpha")
    total = ca.SX.sym("total", 2)
    deviation = ca.vertcat(s.x - x_bar, s.u_before - before_bar)
    law = u_bar + alpha * step + K @ deviation
    low, high = input_bounds(structure, s)
    u = ca.fmin(ca.fmax(law, low), high)
    outputs = [next_state(structure, s), total + augmented.stage_cost(s, terminal=False)]
    x_next, cost = ca.substitute(outputs, [s.u], [u])
    return stage_function(
        "stage_forward",
        [s.x, s.u_before, x_bar, u_bar, before_bar, K, step, alpha]
        + [s.stage, s.multipliers, total],
        s.theta,
        [x_next, u, cost],
    )
