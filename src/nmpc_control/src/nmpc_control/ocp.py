# SPDX-License-Identifier: MIT
"""The optimal control problem of the paper (Eqs. 5-9), stated once for all solver backends.

    minimise   sum_{k=0}^{N-1} |x_k - x_r,k|^2_Q + |u_k - u_r,k|^2_R + |u_k - u_{k-1}|^2_{R_delta}
               + |x_N - x_r,N|^2_{Q_f} + sum_{k=0}^{N} sum_i U_i(x_k)
    subject to x_0 given, u_{-1} the input really applied before, x_{k+1} = F(x_k, u_k), u_min <=
    u_k <= u_max

    U_i(x) = eta / 2 (1 / d_i - 1 / D_i)^2  where d_i < D_i, else 0            (Eq. 8)
               |u_k - u_{k-1}| <= dt u'_max
    softened   |v_k| <= v_max, p_min <= p_k <= p_max, and d_i >= D_i (Eq. 7) where that is selected

d_i is the distance to the centre of obstacle i and D_i its radius plus hull plus safety distance.
Everything
but N, dt, the integrator and the number of obstacle slots is a run-time parameter.
"""

from dataclasses import dataclass
from typing import Sequence, Tuple

import casadi as ca
import numpy as np

from nmpc_control import constraints
from nmpc_control.errors import ProblemError
from nmpc_control.model import INTEGRATORS, MODEL_SIZE, discrete
from nmpc_control.state import NU, NX, YAW

SLOT_SIZE = 5  # centre x, y, z [m]; weight of the vertical distance [1]; 1 / D [1/m]
_SIZES = {
    "model": MODEL_SIZE,
    "Q": NX,
    "Q_f": NX,
    "R": NU,
    "R_delta": NU,
    "u_min": NU,
    "u_max": NU,
    "eta": 1,
    "cushion": 1,  # [m] the potential begins this much before the margin D
    "speed": 1,  # [m/s]
    "fence_min": 3,  # [m]
    "fence_max": 3,  # [m]
    "input_rate": NU,  # [input unit per s]
    "soft_weight": 1,  # rho of the L1 penalty on speed [s/m] and fence [1/m]
    "obstacle_weight": 1,  # [1/m] the same on Eq. 7
    "hard_obstacles": 1,  # 1: Eq. 7 holds as an inequality; 0: it does not
    "stiffness": 1,  # factor on the curvatures of the compiled solver's augmented Lagrangian
}
_ENDS = np.cumsum(list(_SIZES.values()))
PARTS = {name: slice(end - size, end) for (name, size), end in zip(_SIZES.items(), _ENDS)}
THETA_SIZE = int(_ENDS[-1])
EMPTY_SLOT = (0.0, 0.0, 0.0, 1.0, 1e6)  # D of a micrometre: never in reach


@dataclass(frozen=True)
class Structure:
    """What is compiled in: horizon, step, integrator and obstacle slots."""

    horizon: int
    dt: float  # [s]
    integrator: str = "exact_lag"
    obstacle_slots: int = 8

    def __post_init__(self) -> None:
        if (
            self.horizon < 1
            or not self.dt > 0
            or self.obstacle_slots < 0
            or self.integrator not in INTEGRATORS
        ):
            raise ProblemError(
                f"structure: got {self}, expected N >= 1, dt > 0, slots >= 0 and a known integrator"
            )

    @property
    def inequalities(self) -> int:
        """Number of softened inequalities of one stage."""
        return len(constraints.rows(self.obstacle_slots))

    @property
    def stage_size(self) -> int:
        """Length of one column of stage data: reference state and input, obstacle slots."""
        return NX + NU + SLOT_SIZE * self.obstacle_slots


@dataclass(frozen=True)
class Instance:
    """Numbers of one problem: everything that changes from solve to solve."""

    x0: np.ndarray  # (10,) state at stage 0
    u_before: np.ndarray  # (4,) input really applied before stage 0
    stages: np.ndarray  # (stage_size, N + 1) reference state, reference input, obstacle slots
    theta: np.ndarray  # (THETA_SIZE,) see PARTS

    @property
    def input_min(self) -> np.ndarray:
        """Lower input bounds (4,)."""
        return self.theta[PARTS["u_min"]]

    @property
    def input_max(self) -> np.ndarray:
        """Upper input bounds (4,)."""
        return self.theta[PARTS["u_max"]]


class Symbols:
    """Symbols of one stage and the parameter vector split into its parts."""

    def __init__(self, structure: Structure) -> None:
        self.x = ca.SX.sym("x", NX)
        self.u = ca.SX.sym("u", NU)
        self.u_before = ca.SX.sym("u_before", NU)
        self.stage = ca.SX.sym("stage", structure.stage_size)
        self.theta = ca.SX.sym("theta", THETA_SIZE)
        self.multipliers = ca.SX.sym("multipliers", structure.inequalities)
        parts = {name: self.theta[part] for name, part in PARTS.items()}
        self.model, self.Q, self.Q_f = parts["model"], parts["Q"], parts["Q_f"]
        self.R, self.R_delta, self.eta = parts["R"], parts["R_delta"], parts["eta"]
        self.u_min, self.u_max, self.bounds = parts["u_min"], parts["u_max"], parts


def next_state(structure: Structure, s: Symbols) -> ca.SX:
    """Return F(x, u) (10,)."""
    return discrete(s.x, s.u, s.model, structure.dt, structure.integrator)


def tracking_residuals(s: Symbols, terminal: bool) -> Tuple[ca.SX, ca.SX]:
    """Return residuals r and weights w: w r^2 is the tracking cost of a stage, as in Eq. 5."""
    error = s.x - s.stage[:NX]
    error[YAW] -= 2 * ca.pi * ca.floor((error[YAW] + ca.pi) / (2 * ca.pi))
    if terminal:
        return error, s.Q_f
    return (
        ca.vertcat(error, s.u - s.stage[NX : NX + NU], s.u - s.u_before),
        ca.vertcat(s.Q, s.R, s.R_delta),
    )


def potential(d: ca.SX, slot: ca.SX, eta: ca.SX, cushion: ca.SX) -> ca.SX:
    """Return U_i (Eq. 8) at a distance d [m] from the centre of the obstacle in a slot (5,).

    It begins a cushion [m] before the slot's own distance.
    """
    return eta / 2 * ca.fmax(0, 1 / d - slot[4] / (1 + cushion * slot[4])) ** 2


def input_bounds(structure: Structure, s: Symbols) -> Tuple[ca.SX, ca.SX]:
    """Return the least and greatest input (4,) of a stage.

    Its bounds, and what the rate allows from the one before.

    Where both cannot hold (the input before was outside the bounds) the bounds do.
    """
    step = structure.dt * s.bounds["input_rate"]
    low = ca.fmin(ca.fmax(s.u_min, s.u_before - step), s.u_max)
    return low, ca.fmax(ca.fmin(s.u_max, s.u_before + step), s.u_min)


def inequalities(structure: Structure, s: Symbols) -> ca.SX:
    """Return g, to be <= 0, of one stage: speed, fence, Eq. 7 of every slot."""
    obstacles = [
        constraints.obstacle(distance(s.x[:3], slot), slot, s.bounds["hard_obstacles"])
        for slot in split_slots(structure, s.stage)
    ]
    return ca.vertcat(constraints.pilot_bounds(s.x[:3], s.x[6:9], s.bounds), *obstacles)


def penalty_weights(structure: Structure, s: Symbols) -> ca.SX:
    """Return the weights of the L1 penalty on each of ``inequalities``."""
    weight = {kind: s.bounds["soft_weight"] for kind in (constraints.SPEED, constraints.FENCE)}
    weight[constraints.OBSTACLE] = s.bounds["obstacle_weight"]
    return ca.vertcat(*[weight[kind] for kind in constraints.rows(structure.obstacle_slots)])


def stage_cost(structure: Structure, s: Symbols, terminal: bool) -> ca.SX:
    """Return the cost of one stage (Eqs. 5, 8, 9) without the penalty on the inequalities."""
    r, w = tracking_residuals(s, terminal)
    slots = split_slots(structure, s.stage)
    return ca.dot(w, r * r) + sum(
        potential(distance(s.x[:3], i), i, s.eta, s.bounds["cushion"]) for i in slots
    )


def split_slots(structure: Structure, stage: ca.SX) -> Sequence[ca.SX]:
    """Return the data (5,) of every obstacle slot of a stage."""
    first = NX + NU
    return [
        stage[first + SLOT_SIZE * i : first + SLOT_SIZE * (i + 1)]
        for i in range(structure.obstacle_slots)
    ]


def squared_distance(position: ca.SX, slot: ca.SX) -> ca.SX:
    """Return the squared distance [m^2] from the centre of the obstacle in a slot (5,)."""
    offset = position - slot[:3]
    # the small constant keeps the root's derivative finite at the very centre
    return offset[0] ** 2 + offset[1] ** 2 + slot[3] * offset[2] ** 2 + 1e-6


def distance(position: ca.SX, slot: ca.SX) -> ca.SX:
    """Return the distance [m] from the centre of the obstacle in a slot (5,)."""
    return ca.sqrt(squared_distance(position, slot))
