# SPDX-License-Identifier: MIT
"""The optimal control problem of the paper (Eqs. 5-9), stated once for all solver backends.

    minimise   sum_{k=0}^{N-1} |x_k - x_r,k|^2_Q + |u_k - u_r,k|^2_R + |u_k - u_{k-1}|^2_{R_delta}
               + |x_N - x_r,N|^2_{Q_f} + sum_{k=0}^{N} sum_i U_i(x_k)
    subject to x_0 given, u_{-1} the input really applied before, x_{k+1} = F(x_k, u_k), u_min <= u_k <= u_max

    U_i(x) = eta / 2 (1 / d_i - 1 / D_i)^2  where d_i < D_i, else 0            (Eq. 8)

d_i is the distance to the centre of obstacle i and D_i its radius plus hull plus safety distance. Everything
but N, dt, the integrator and the number of obstacle slots is a run-time parameter.
"""

from dataclasses import dataclass
from typing import Sequence, Tuple

import casadi as ca
import numpy as np

from nmpc_control.errors import ProblemError
from nmpc_control.model import INTEGRATORS, MODEL_SIZE, discrete, model_parameters
from nmpc_control.params import Avoidance, Limits, Vehicle, Weights
from nmpc_control.state import NU, NX, YAW

SLOT_SIZE = 5  # centre x, y, z [m]; weight of the vertical distance [1]; 1 / D [1/m]
THETA_SIZE = MODEL_SIZE + 2 * NX + 4 * NU + 1
EMPTY_SLOT = (0.0, 0.0, 0.0, 1.0, 1e6)  # D of a micrometre: never in reach


@dataclass(frozen=True)
class Structure:
    """What is compiled in: horizon, step, integrator and obstacle slots."""

    horizon: int
    dt: float  # [s]
    integrator: str = "exact_lag"
    obstacle_slots: int = 8

    def __post_init__(self) -> None:
        if self.horizon < 1 or not self.dt > 0 or self.obstacle_slots < 0 or self.integrator not in INTEGRATORS:
            raise ProblemError(f"structure: got {self}, expected N >= 1, dt > 0, slots >= 0 and a known integrator")

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
    theta: np.ndarray  # (THETA_SIZE,) model, weights, bounds, eta

    @property
    def input_min(self) -> np.ndarray:
        """Lower input bounds (4,)."""
        return self.theta[-1 - 2 * NU : -1 - NU]

    @property
    def input_max(self) -> np.ndarray:
        """Upper input bounds (4,)."""
        return self.theta[-1 - NU : -1]


def pack_theta(
    vehicle: Vehicle, weights: Weights, limits: Limits, avoidance: Avoidance, disturbance: np.ndarray
) -> np.ndarray:
    """Return the parameter vector (THETA_SIZE,) shared by all stages; raises ProblemError on unusable numbers."""
    eta = avoidance.eta if avoidance.enabled else 0.0
    theta = np.concatenate(
        [
            model_parameters(vehicle, disturbance),
            weights.Q,
            weights.Q_f,
            weights.R,
            weights.R_delta,
            limits.input_min,
            limits.input_max,
            [eta],
        ]
    )
    if not np.all(np.isfinite(theta)):
        raise ProblemError("parameters: got a value that is not finite")
    if np.any(theta[MODEL_SIZE : MODEL_SIZE + 2 * NX + 2 * NU] < 0) or eta < 0:
        raise ProblemError("weights: got a negative value, expected none")
    if np.any(limits.input_min > limits.input_max):
        raise ProblemError(f"limits: got input_min {limits.input_min} above input_max {limits.input_max}")
    return theta


def pack_stages(
    structure: Structure, x_ref: np.ndarray, u_ref: np.ndarray, slots: Sequence[np.ndarray] = ()
) -> np.ndarray:
    """Return the stage data (stage_size, N + 1).

    Args:
        structure: of the problem.
        x_ref: (N + 1, 10) reference states.
        u_ref: (4,) or (N, 4) reference inputs.
        slots: at most ``obstacle_slots`` arrays (N + 1, 5), one per obstacle, see SLOT_SIZE.

    Raises:
        ProblemError: wrong shape or a value that is not finite.
    """
    N = structure.horizon
    if np.shape(x_ref) != (N + 1, NX) or len(slots) > structure.obstacle_slots:
        raise ProblemError(
            f"references: got shape {np.shape(x_ref)} and {len(slots)} obstacles, "
            f"expected {(N + 1, NX)} and at most {structure.obstacle_slots}"
        )
    data = np.empty((structure.stage_size, N + 1), order="F")
    data[:NX] = x_ref.T
    data[NX : NX + NU, :N] = np.broadcast_to(u_ref, (N, NU)).T
    data[NX : NX + NU, N] = data[NX : NX + NU, N - 1]
    for i in range(structure.obstacle_slots):
        rows = slice(NX + NU + SLOT_SIZE * i, NX + NU + SLOT_SIZE * (i + 1))
        data[rows] = slots[i].T if i < len(slots) else np.array(EMPTY_SLOT)[:, None]
    if not np.all(np.isfinite(data)):
        raise ProblemError("references or obstacles: got a value that is not finite")
    return data


class Symbols:
    """Symbols of one stage and the parameter vector split into its parts."""

    def __init__(self, structure: Structure) -> None:
        self.x = ca.SX.sym("x", NX)
        self.u = ca.SX.sym("u", NU)
        self.u_before = ca.SX.sym("u_before", NU)
        self.stage = ca.SX.sym("stage", structure.stage_size)
        self.theta = ca.SX.sym("theta", THETA_SIZE)
        sizes = np.cumsum([0, MODEL_SIZE, NX, NX, NU, NU, NU, NU, 1])
        parts = [self.theta[a:b] for a, b in zip(sizes[:-1], sizes[1:])]
        self.model, self.Q, self.Q_f, self.R, self.R_delta, self.u_min, self.u_max, self.eta = parts


def next_state(structure: Structure, s: Symbols) -> ca.SX:
    """Return F(x, u) (10,)."""
    return discrete(s.x, s.u, s.model, structure.dt, structure.integrator)


def residuals(structure: Structure, s: Symbols, terminal: bool) -> Tuple[ca.SX, ca.SX]:
    """Return residuals r and weights w with stage cost sum w r^2, which is what Gauss-Newton needs."""
    error = s.x - s.stage[:NX]
    error[YAW] -= 2 * ca.pi * ca.floor((error[YAW] + ca.pi) / (2 * ca.pi))
    potential = [_potential_root(s.x[:3], slot) for slot in _slots(structure, s.stage)]
    eta = [0.5 * s.eta] * len(potential)
    if terminal:
        return ca.vertcat(error, *potential), ca.vertcat(s.Q_f, *eta)
    return (
        ca.vertcat(error, s.u - s.stage[NX : NX + NU], s.u - s.u_before, *potential),
        ca.vertcat(s.Q, s.R, s.R_delta, *eta),
    )


def stage_cost(structure: Structure, s: Symbols, terminal: bool) -> ca.SX:
    """Return the cost of one stage (Eq. 5 with Eqs. 8, 9)."""
    r, w = residuals(structure, s, terminal)
    return ca.dot(w, r * r)


def _slots(structure: Structure, stage: ca.SX) -> Sequence[ca.SX]:
    first = NX + NU
    return [stage[first + SLOT_SIZE * i : first + SLOT_SIZE * (i + 1)] for i in range(structure.obstacle_slots)]


def _potential_root(position: ca.SX, slot: ca.SX) -> ca.SX:
    offset = position - slot[:3]
    # the small constant keeps the derivative finite at the very centre of an obstacle
    d = ca.sqrt(offset[0] ** 2 + offset[1] ** 2 + slot[3] * offset[2] ** 2 + 1e-6)
    return ca.fmax(0, 1 / d - slot[4])
