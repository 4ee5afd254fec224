# SPDX-License-Identifier: MIT
"""The augmented Lagrangian of the softened inequalities, for the compiled solver.

Penalty of one inequality g <= 0 with multiplier l, curvature mu and the weight rho of the L1
penalty, with the excess e = max(0, g + l / mu):

    mu / 2 e^2  while mu e <= rho,  then on linearly:  rho e - rho^2 / (2 mu)

Its multipliers l <- min(max(0, l + mu g), rho) end at the solution of the L1 problem (Bertsekas
1982, ch. 4 and 5; the bound rho is what makes the penalty exact instead of infinite).
"""

from typing import NamedTuple, Optional, Tuple

import casadi as ca

from nmpc_control import constraints
from nmpc_control.ocp import Structure, Symbols, tracking_residuals

# what ``settle`` adds up: penalties with the new multipliers, L1 penalties, and what these exceed
# the new multipliers' forces by, never negative and zero at the solution; and what it takes the
# largest of: move of a multiplier as an excess, violations
SUMS = ("updated", "exact", "gap")
MAXIMA = ("moved", constraints.SPEED, constraints.FENCE, constraints.OBSTACLE)


def penalty(g: ca.SX, multipliers: ca.SX, inverse_mu: ca.SX, rho: ca.SX) -> ca.SX:
    """Return the augmented penalties of inequalities g (n,) with their multipliers (n,)."""
    excess = ca.fmax(0, g + multipliers * inverse_mu)
    bent = ca.fmin(excess, rho * inverse_mu)  # up to here quadratic, beyond linear
    return bent * (excess - bent / 2) / inverse_mu


class Settled(NamedTuple):
    """What the outer iteration makes of some inequalities."""

    sums: ca.SX  # (3,) see SUMS
    moved: ca.SX  # largest move of a multiplier, as an excess
    multipliers: ca.SX  # (n,) the new ones


def settled(g: ca.SX, multipliers: ca.SX, inverse_mu: ca.SX, rho: ca.SX) -> Settled:
    """Move the multipliers (n,) by the inequalities g (n,)."""
    new = ca.fmin(ca.fmax(0, multipliers + g / inverse_mu), rho)
    updated, exact = penalty(g, new, inverse_mu, rho), rho * ca.fmax(0, g)
    moved = ca.mmax(ca.fabs(new - multipliers) * inverse_mu)
    sums = ca.vertcat(ca.sum1(updated), ca.sum1(exact), ca.sum1(exact - new * g))
    return Settled(sums, moved, new)


def derivatives(
    s: Symbols, terminal: bool, value: Optional[ca.SX], z: ca.SX
) -> Tuple[ca.SX, ca.SX]:
    """Return gradient and Hessian by z of a stage's cost without obstacles.

    Args:
        s: symbols of the stage.
        terminal: whether it is the last one.
        value: what is added to the cost in the Hessian (adjoint' F), which is then exact; None:
            Gauss-Newton.
        z: symbols to differentiate by.
    """
    r, w = tracking_residuals(s, terminal)
    g, multipliers, inverse_mu, rho = _pilot_bounds(s)
    excess = ca.fmax(0, g + multipliers * inverse_mu)
    force = ca.fmin(excess / inverse_mu, rho)
    curvature = ca.if_else(ca.logic_and(excess > 0, force < rho), 1 / inverse_mu, 0)
    J_r, J_g = ca.jacobian(r, z), ca.jacobian(g, z)
    gradient = 2 * J_r.T @ (w * r) + J_g.T @ force
    if value is None:
        H = 2 * J_r.T @ (ca.diag(w) @ J_r)
    else:
        held = ca.SX.sym("force", force.numel())
        (H,) = ca.substitute(
            [ca.hessian(ca.dot(w, r * r) + value + ca.dot(held, g), z)[0]], [held], [force]
        )
    return gradient, H + J_g.T @ (ca.diag(curvature) @ J_g)


def stage_cost(s: Symbols, terminal: bool) -> ca.SX:
    """Return tracking cost and penalties (2,) of a stage without obstacles."""
    r, w = tracking_residuals(s, terminal)
    return ca.vertcat(ca.dot(w, r * r), ca.sum1(penalty(*_pilot_bounds(s))))


def settle_pilot_bounds(structure: Structure) -> ca.Function:
    """Return (x, theta, multipliers) -> sums (3,), maxima (4,), new multipliers (7,)."""
    s = Symbols(structure)
    bounds = _pilot_bounds(s)
    result, g = settled(*bounds), bounds[0]
    maxima = ca.vertcat(result.moved, g[0], ca.mmax(g[1:]), 0)
    return ca.Function(
        "settle_pilot_bounds",
        [s.x, s.theta, s.multipliers],
        [result.sums, maxima, result.multipliers],
    )


def _pilot_bounds(s: Symbols) -> Tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return g, multipliers, 1 / mu (7,) each, and rho of speed and fence."""
    g = constraints.pilot_bounds(s.x[:3], s.x[6:9], s.bounds)
    multipliers = s.multipliers[: constraints.PILOT_BOUNDS]
    mu = ca.DM(constraints.curvature(0)) * s.bounds["stiffness"]
    return g, multipliers, 1 / mu, s.bounds["soft_weight"]
