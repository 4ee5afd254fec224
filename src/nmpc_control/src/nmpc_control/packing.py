# SPDX-License-Identifier: MIT
"""Numbers of a problem, checked and packed for the solvers."""

from typing import Optional, Sequence

import numpy as np

from nmpc_control.errors import ProblemError
from nmpc_control.model import model_parameters
from nmpc_control.ocp import EMPTY_SLOT, PARTS, SLOT_SIZE, Structure
from nmpc_control.params import Avoidance, Limits, Vehicle, Weights
from nmpc_control.state import NU, NX


def pack_theta(
    vehicle: Vehicle,
    weights: Weights,
    limits: Limits,
    avoidance: Avoidance,
) -> np.ndarray:
    """Return the parameter vector (THETA_SIZE,) shared by all stages.

    Raises ProblemError on unusable numbers.
    """
    _check_numbers(vehicle, weights, limits, avoidance)
    eta, begins = {
        "potential": (avoidance.eta, avoidance.inflation),
        "barrier": (avoidance.cushion_gain, avoidance.cushion),
    }.get(avoidance.term, (0.0, 0.0))
    hard = avoidance.enabled and avoidance.term != "potential"
    theta = np.concatenate(
        [
            model_parameters(vehicle),
            weights.Q,
            weights.Q_f,
            weights.R,
            weights.R_delta,
            limits.input_min,
            limits.input_max,
            [eta if avoidance.enabled else 0.0, begins, limits.speed],
            limits.fence_min,
            limits.fence_max,
            limits.input_rate,
            [limits.soft_weight, avoidance.weight, float(hard), 1.0],
        ]
    )
    if not np.all(np.isfinite(theta)):
        raise ProblemError("parameters: got a value that is not finite")
    for name in ("Q", "Q_f", "R", "R_delta", "eta", "soft_weight", "obstacle_weight", "input_rate"):
        if np.any(theta[PARTS[name]] < 0):
            raise ProblemError(f"{name}: got {theta[PARTS[name]]}, expected no negative value")
    for low, high in (("u_min", "u_max"), ("fence_min", "fence_max")):
        if np.any(theta[PARTS[low]] >= theta[PARTS[high]]):
            raise ProblemError(
                f"{low}: got {theta[PARTS[low]]}, expected less than {high} {theta[PARTS[high]]}"
            )
    if not limits.speed > 0:
        raise ProblemError(f"speed: got {limits.speed}, expected more than 0")
    return theta


def _check_numbers(
    vehicle: Vehicle, weights: Weights, limits: Limits, avoidance: Avoidance
) -> None:
    """Raise ProblemError on a vector of wrong length or a number without meaning."""
    for name, vector, length in (
        ("Q", weights.Q, NX),
        ("Q_f", weights.Q_f, NX),
        ("R", weights.R, NU),
        ("R_delta", weights.R_delta, NU),
        ("input_min", limits.input_min, NU),
        ("input_max", limits.input_max, NU),
        ("input_rate", limits.input_rate, NU),
        ("fence_min", limits.fence_min, 3),
        ("fence_max", limits.fence_max, 3),
        ("drag", vehicle.drag, 3),
        ("disturbance", vehicle.disturbance, 3),
    ):
        if np.shape(vector) != (length,):
            raise ProblemError(f"{name}: got shape {np.shape(vector)}, expected {(length,)}")
    for name in ("roll", "pitch", "yaw_rate"):
        constant = getattr(vehicle, name).time_constant
        if not constant > 0:
            raise ProblemError(f"{name}.time_constant: got {constant}, expected more than 0")
    for name, value in (
        ("radius", vehicle.radius),
        ("safety_distance", avoidance.safety_distance),
        ("inflation", avoidance.inflation),
        ("cushion", avoidance.cushion),
        ("allowance", avoidance.allowance),
        ("eta", avoidance.eta),
        ("cushion_gain", avoidance.cushion_gain),
    ):
        if not 0 <= value < np.inf:
            raise ProblemError(f"{name}: got {value}, expected a number >= 0")
    if not 0 < avoidance.weight < np.inf:
        raise ProblemError(f"weight: got {avoidance.weight}, expected a number > 0")


def check_arguments(
    t: float,
    x0: np.ndarray,
    x_ref: np.ndarray,
    u_before: np.ndarray,
    u_ref: Optional[np.ndarray],
    horizon: int,
) -> None:
    """Raise ProblemError on a time that is not finite or an argument of wrong shape."""
    if not np.isfinite(t):
        raise ProblemError(f"time: got {t}, expected a finite one")
    shapes = {
        "x0": (x0, [(NX,)]),
        "x_ref": (x_ref, [(horizon + 1, NX)]),
        "u_before": (u_before, [(NU,)]),
    }
    if u_ref is not None:
        shapes["u_ref"] = (u_ref, [(NU,), (horizon, NU)])
    for name, (value, expected) in shapes.items():
        if np.shape(value) not in expected:
            raise ProblemError(f"{name}: got shape {np.shape(value)}, expected {expected[-1]}")


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
    filled = NX + NU + SLOT_SIZE * len(slots)
    for i, slot in enumerate(slots):
        data[NX + NU + SLOT_SIZE * i : NX + NU + SLOT_SIZE * (i + 1)] = slot.T
    empty = np.tile(EMPTY_SLOT, structure.obstacle_slots - len(slots))
    data[filled:] = empty[:, None]
    if not np.all(np.isfinite(data)):
        raise ProblemError("references or obstacles: got a value that is not finite")
    return data
