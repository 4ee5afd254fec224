# SPDX-License-Identifier: MIT
"""The cost of inputs under the exact dynamics: the same yardstick for every backend."""

from typing import Tuple

import casadi as ca
import numpy as np

from nmpc_control.ocp import (
    THETA_SIZE,
    Instance,
    Structure,
    Symbols,
    inequalities,
    next_state,
    penalty_weights,
    stage_cost,
)
from nmpc_control.state import NU, NX

COST_FLOOR = 1e-3  # least cost that a gap is relative to: near the reference, costs are rounding


def relative_gap(cost: float, best: float) -> float:
    """Return the relative excess of a cost over the best known."""
    return (cost - best) / max(best, COST_FLOOR)


class Objective:
    """Total cost of a problem, with the L1 penalty on its softened bounds, as a function of inputs.

    The states follow by rollout from the initial state, so no plan gains by violated dynamics.
    """

    def __init__(self, structure: Structure) -> None:
        s = Symbols(structure)
        excess = ca.fmax(0, inequalities(structure, s))
        penalty = ca.dot(penalty_weights(structure, s), excess)
        inner = stage_cost(structure, s, terminal=False) + penalty
        last = stage_cost(structure, s, terminal=True) + penalty
        x_next = next_state(structure, s)
        self._stage = ca.Function("stage", [s.x, s.u, s.u_before, s.stage, s.theta], [inner])
        self._step = ca.Function("step", [s.x, s.u, s.theta], [x_next])
        self._last = ca.Function("last", [s.x, s.stage, s.theta], [last])
        self._total = self._rollout(structure)
        self._steps = self._step.map(structure.horizon)

    def _rollout(self, structure: Structure) -> ca.Function:
        N = structure.horizon
        x, before = ca.MX.sym("x0", NX), ca.MX.sym("u_before", NU)
        U, stages = ca.MX.sym("U", NU, N), ca.MX.sym("stages", structure.stage_size, N + 1)
        theta = ca.MX.sym("theta", THETA_SIZE)
        arguments = [x, before, U, stages, theta]
        cost, states = 0, [x]
        for u, stage in zip(ca.horzsplit(U), ca.horzsplit(stages)):
            cost += self._stage(x, u, before, stage, theta)
            x, before = self._step(x, u, theta), u
            states.append(x)
        cost += self._last(x, stages[:, N], theta)
        return ca.Function("total", arguments, [cost, ca.horzcat(*states)])

    def __call__(self, instance: Instance, inputs: np.ndarray) -> Tuple[float, np.ndarray]:
        """Return cost and states (N + 1, 10) for inputs (N, 4), clipped to their bounds."""
        i = instance
        clipped = np.clip(inputs, i.input_min, i.input_max)
        cost, states = self._total(i.x0, i.u_before, clipped.T, i.stages, i.theta)
        return float(cost), np.asarray(states).T

    def stage(self, instance: Instance, u: np.ndarray) -> float:
        """Return the cost of stage 0 under an input (4,)."""
        i = instance
        return float(self._stage(i.x0, u, i.u_before, i.stages[:, 0], i.theta))

    def defect(self, instance: Instance, states: np.ndarray, inputs: np.ndarray) -> float:
        """Return the largest violation of dynamics (SI units) or input bounds by a plan."""
        i = instance
        dynamics = states[1:].T - np.asarray(self._steps(states[:-1].T, inputs.T, i.theta))
        outside = np.maximum(i.input_min - inputs, inputs - i.input_max)
        return float(max(np.max(np.abs(dynamics)), np.max(outside), 0.0))
