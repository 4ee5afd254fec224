# SPDX-License-Identifier: MIT
"""Obstacle terms of the compiled solver: potential (Eq. 8) and, where selected, Eq. 7.

Slots are looked at in blocks, and a block of which no obstacle is in reach costs one comparison of
squared distances for each: that is how many slots stay cheap.
"""

from typing import Callable, List, Sequence

import casadi as ca

from nmpc_control import augmented, constraints
from nmpc_control.augmented import penalty
from nmpc_control.ocp import (
    PARTS,
    SLOT_SIZE,
    THETA_SIZE,
    Structure,
    distance,
    potential,
    squared_distance,
)
from nmpc_control.state import NU, NX

_BLOCK = 8
_MU = float(constraints.curvature(1)[-1])
Terms = Callable[[ca.SX, List[ca.SX], ca.SX, ca.SX], List[ca.SX]]


def value(structure: Structure) -> ca.Function:
    """Return (x, stage, theta, multipliers) -> potentials and penalties (2,)."""

    def terms(p: ca.SX, slots: List[ca.SX], theta: ca.SX, multipliers: ca.SX) -> List[ca.SX]:
        eta, cushion, rho, hard, inverse_mu = _parts(theta)
        d = [distance(p, slot) for slot in slots]
        total = sum(potential(d_i, slot, eta, cushion) for d_i, slot in zip(d, slots))
        return [
            ca.vertcat(total, ca.sum1(penalty(_g(d, slots, hard), multipliers, inverse_mu, rho)))
        ]

    return _in_blocks(structure, "obstacle_value", terms, ["sum"])


def settle(structure: Structure) -> ca.Function:
    """Return (x, stage, theta, multipliers) -> sums, maxima, new multipliers of the slots."""

    def terms(p: ca.SX, slots: List[ca.SX], theta: ca.SX, multipliers: ca.SX) -> List[ca.SX]:
        _, _, rho, hard, inverse_mu = _parts(theta)
        g = _g([distance(p, slot) for slot in slots], slots, hard)
        result = augmented.settled(g, multipliers, inverse_mu, rho)
        maxima = ca.vertcat(result.moved, 0, 0, ca.fmax(0, ca.mmax(g)))
        return [result.sums, maxima, result.multipliers]

    return _in_blocks(structure, "settle_obstacles", terms, ["sum", "max", "stack"])


def derivatives(structure: Structure, exact: bool) -> ca.Function:
    """Return (x, stage, theta, multipliers) -> gradient (3,), Hessian (6,) by the position.

    The Hessian comes as packed upper triangle; it is exact, or only its part along the line to the
    centre, which is never negative.
    """

    def terms(p: ca.SX, slots: List[ca.SX], theta: ca.SX, multipliers: ca.SX) -> List[ca.SX]:
        eta, cushion, rho, hard, inverse_mu = _parts(theta)
        gradient, H, d = ca.SX.zeros(3), ca.SX.zeros(3, 3), ca.SX.sym("d")
        for i, slot in enumerate(slots):
            g = constraints.obstacle(d, slot, hard)
            cost = potential(d, slot, eta, cushion) + penalty(g, multipliers[i], inverse_mu, rho)
            here = distance(p, slot)
            curvature, force = ca.substitute([*ca.hessian(cost, d)], [d], [here])
            H_d, n = ca.hessian(here, p)
            gradient += force * n
            H += curvature * (n @ n.T) + (force * H_d if exact else 0)
        return [gradient, ca.vertcat(*[H[i, j] for j in range(3) for i in range(j + 1)])]

    name = "obstacle_derivatives_exact" if exact else "obstacle_derivatives"
    return _in_blocks(structure, name, terms, ["sum", "sum"])


def _g(d: List[ca.SX], slots: List[ca.SX], hard: ca.SX) -> ca.SX:
    return ca.vertcat(*[constraints.obstacle(d_i, slot, hard) for d_i, slot in zip(d, slots)])


def _parts(theta: ca.SX) -> Sequence[ca.SX]:
    """Return eta, cushion, rho, whether Eq. 7 is selected, and 1 / mu."""
    names = ("eta", "cushion", "obstacle_weight", "hard_obstacles", "stiffness")
    parts = [theta[PARTS[name]] for name in names]
    return [*parts[:4], 1 / (_MU * parts[4])]


def _in_blocks(
    structure: Structure, name: str, terms: Terms, combine: Sequence[str]
) -> ca.Function:
    n, first = structure.obstacle_slots, constraints.PILOT_BOUNDS
    x, stage = ca.MX.sym("x", NX), ca.MX.sym("stage", structure.stage_size)
    theta, multipliers = ca.MX.sym("theta", THETA_SIZE), ca.MX.sym("l", structure.inequalities)
    ends = [*range(0, n, _BLOCK), n]
    blocks = ca.vertsplit(stage, [0] + [NX + NU + SLOT_SIZE * end for end in ends])[1:]
    forces = ca.vertsplit(multipliers, [0] + [first + end for end in ends])[1:]
    results = []
    for block, force in zip(blocks, forces):
        reach, evaluate = _block(name, terms, force.numel())
        results.append(evaluate.call([reach(x, block, theta, force), x, block, theta, force]))
    rules = {"sum": sum, "max": _largest, "stack": lambda parts: ca.vertcat(*parts)}
    outputs = [rules[rule](parts) for rule, parts in zip(combine, zip(*results))]
    return ca.Function(name, [x, stage, theta, multipliers], outputs)


def _block(name: str, terms: Terms, size: int) -> Sequence[ca.Function]:
    """Return whether any of some slots is in reach, and their terms, zero where none is."""
    x, theta = ca.SX.sym("x", NX), ca.SX.sym("theta", THETA_SIZE)
    data, multipliers = ca.SX.sym("slots", SLOT_SIZE * size), ca.SX.sym("l", size)
    slots = ca.vertsplit(data, SLOT_SIZE)
    cushion = theta[PARTS["cushion"]]
    inside = [  # d < D + cushion or l / mu (with its least mu) without root and division
        squared_distance(x[:3], slot) * slot[4] ** 2
        < (1 + slot[4] * ca.fmax(cushion, multipliers[i] / _MU)) ** 2
        for i, slot in enumerate(slots)
    ]
    arguments = [x, data, theta, multipliers]
    reach = ca.Function(f"{name}_reach", arguments, [ca.mmax(ca.vertcat(*inside))])
    outputs = [ca.densify(v) for v in terms(x[:3], slots, theta, multipliers)]
    near = ca.Function(f"{name}_near", arguments, outputs)
    far = ca.Function(f"{name}_far", arguments, [ca.SX.zeros(v.shape) for v in outputs])
    return reach, ca.Function.if_else(f"{name}_block", near, far)


def _largest(parts: Sequence[ca.MX]) -> ca.MX:
    result = parts[0]
    for part in parts[1:]:
        result = ca.fmax(result, part)
    return result
