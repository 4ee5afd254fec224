# SPDX-License-Identifier: MIT
"""The paper's own formulation (Eqs. 1-6, 8, 9) as its results were computed, to compare with.

CasADi MX graph, explicit Euler at 0.1 s, N = 60, multiple shooting, IPOPT with MUMPS, thrust in
percent with force = k percent, weights multiplied before squaring, a potential that begins 0.5 m
from a sphere's surface for the aircraft's centre. What belongs to its results is kept: N states and
no terminal stage, so that the last continuity equation demands an equilibrium; a reference whose N
points span the whole horizon, N / (N - 1) fast; yaw reference 0 without wrapping; warm start by
shifting one stage, from hover at first; Euler steps longer than the attitude lags can bear.

Neither the weights Q of the paper's simulations nor its IPOPT options are published in the paper;
they are fitted so that its closed loop gives the deviations and iterations of its two scenarios.
"""

import time
from dataclasses import dataclass
from typing import Any, Dict, Optional

import casadi as ca
import numpy as np

from nmpc_control.state import GRAVITY, NU, NX

N = 60
DT = 0.1  # [s]
MASS = 2.895  # [kg]
FORCE = 0.7646  # [N per percent] hover at 37.14 percent, as in the paper's table
HOVER = MASS * GRAVITY / FORCE  # [percent]
ETA = 1500.0
SAFETY_DISTANCE = 0.5  # [m] centre of the aircraft to a sphere's surface
INPUT_MIN = np.array([30.0, *np.radians([-20.0, -20.0, -150.0])])  # [percent, rad, rad, rad/s]
INPUT_MAX = np.array([60.0, *np.radians([20.0, 20.0, 150.0])])
# both multiplied before squaring; R is the paper's for indoors, Q is fitted (see below)
R = np.array([0.2, 0.5, 0.5, 0.1])
Q = np.array([2.0, 2.0, 18.0, 40.0, 40.0, 0.1, 1.25, 1.25, 6.0, 0.1])
# fitted too: IPOPT's defaults take 8 and 12 iterations in the paper's two scenarios
OPTIONS = {"tol": 1e-3, "acceptable_tol": 1e-3, "acceptable_iter": 1}

_ROLL, _PITCH, _YAW_RATE = 6.101 / 0.253, 6.497 / 0.267, 1.8 / 0.425  # [1/s] gain / tau
_DRAG = ca.DM([0.1, 0.1, 0.01])  # [1/s]


@dataclass(frozen=True)
class PaperGuess:
    """Where IPOPT starts."""

    states: np.ndarray  # (N, 10)
    inputs: np.ndarray  # (N, 4) thrust in percent


@dataclass(frozen=True)
class PaperSolution:
    """What one solve of the paper's formulation gave."""

    states: np.ndarray  # (N, 10)
    inputs: np.ndarray  # (N, 4) thrust in percent
    cost: float
    defect: float  # largest violation of a continuity equation or the initial state
    iterations: int
    status: str
    success: bool
    solve_time: float  # [s]

    def shifted(self) -> PaperGuess:
        """Return the guess for the next solve: one stage later, the last stage twice."""
        rows = np.minimum(np.arange(1, N + 1), N - 1)
        return PaperGuess(self.states[rows], self.inputs[rows])


def hover_guess(x0: np.ndarray) -> PaperGuess:
    """Return the guess of the first solve: the initial state (10,) held in hover."""
    return PaperGuess(np.tile(x0, (N, 1)), np.tile([HOVER, 0.0, 0.0, 0.0], (N, 1)))


def euler_step() -> ca.Function:
    """Return the discrete model (x (10,), u (4,)) -> x_next (10,); drag decelerates."""
    x, u = ca.MX.sym("x", NX), ca.MX.sym("u", NU)
    thrust = FORCE * u[0] / MASS
    cr, sr, cp, sp = ca.cos(x[3]), ca.sin(x[3]), ca.cos(x[4]), ca.sin(x[4])
    cy, sy = ca.cos(x[5]), ca.sin(x[5])
    e_z = ca.vertcat(cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp)
    acceleration = thrust * e_z - ca.vertcat(0, 0, GRAVITY) - _DRAG * x[6:9]
    lags = ca.vertcat(_ROLL * (u[1] - x[3]), _PITCH * (u[2] - x[4]), x[9])
    f = ca.vertcat(x[6:9], lags, acceleration, _YAW_RATE * (u[3] - x[9]))
    return ca.Function("euler", [x, u], [x + DT * f], ["x", "u"], ["x_next"])


class PaperFormulation:
    """The paper's problem for a number of spheres; a new number is a new graph."""

    def __init__(self, spheres: int, options: Optional[Dict[str, Any]] = None) -> None:
        ipopt = {"print_level": 0, "sb": "yes", **OPTIONS, **(options or {})}
        problem = _transcribe(spheres)
        self._solver = ca.nlpsol("paper", "ipopt", problem, {"print_time": False, "ipopt": ipopt})
        free = np.full(N * NX, np.inf)
        self._lower = np.concatenate([-free, np.tile(INPUT_MIN, N)])
        self._upper = np.concatenate([free, np.tile(INPUT_MAX, N)])

    def solve(
        self, x0: np.ndarray, reference: np.ndarray, spheres: np.ndarray, guess: PaperGuess
    ) -> PaperSolution:
        """Return the solution.

        Args:
            x0: (10,) state.
            reference: (N, 3) positions [m]; all other references are zero, the thrust's is hover.
            spheres: (n, 4) centre and radius [m].
            guess: where IPOPT starts.
        """
        start = time.perf_counter()
        result = self._solver(
            x0=np.concatenate([guess.states.ravel(), guess.inputs.ravel()]),
            p=np.concatenate([x0, reference.ravel(), spheres.ravel()]),
            lbx=self._lower,
            ubx=self._upper,
            lbg=0.0,
            ubg=0.0,
        )
        z = np.asarray(result["x"]).ravel()
        stats = self._solver.stats()
        return PaperSolution(
            states=z[: N * NX].reshape(N, NX),
            inputs=z[N * NX :].reshape(N, NU),
            cost=float(result["f"]),
            defect=float(np.max(np.abs(np.asarray(result["g"])))),
            iterations=int(stats["iter_count"]),
            status=str(stats["return_status"]),
            success=bool(stats["success"]),
            solve_time=time.perf_counter() - start,
        )


def _transcribe(count: int) -> Dict[str, ca.MX]:
    step = euler_step()
    X, U = ca.MX.sym("X", NX, N), ca.MX.sym("U", NU, N)
    x0, reference = ca.MX.sym("x0", NX), ca.MX.sym("reference", 3, N)
    spheres = ca.MX.sym("spheres", 4, count)
    cost, defects = 0, [X[:, 0] - x0]
    for k in range(N):
        x, u = X[:, k], U[:, k]
        error = Q * (x - ca.vertcat(reference[:, k], ca.DM.zeros(7)))
        effort = R * (u - ca.DM([HOVER, 0, 0, 0]))
        cost += ca.dot(error, error) + ca.dot(effort, effort)
        for i in range(count):
            cost += _potential(x[:3], spheres[:3, i], spheres[3, i] + SAFETY_DISTANCE)
        following = X[:, min(k + 1, N - 1)]  # at the end the state itself
        defects.append(following - step(x, u))
    return {
        "x": ca.veccat(X, U),
        "f": cost,
        "g": ca.vertcat(*defects),
        "p": ca.veccat(x0, reference, spheres),
    }


def _potential(position: ca.MX, centre: ca.MX, reach: ca.MX) -> ca.MX:
    d = ca.norm_2(position - centre)
    return ca.if_else(d < reach, 0.5 * ETA * (1 / d - 1 / reach) ** 2, 0)
