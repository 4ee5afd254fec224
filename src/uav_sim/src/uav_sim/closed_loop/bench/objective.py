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
    next_state,
    stage_cost,
)
from nmpc_control.state import NU, NX


class Objective:
    """Total cost of a problem as a function of its inputs, by rollout from its initial state."""

    def __init__(self, structure: Structure) -> None:
        s = Symbols(structure)
        step = ca.Function("step", [s.x, s.u, s.theta], [next_state(structure, s)])
        self._stage = ca.Function(
            "stage",
            [s.x, s.u, s.u_before, s.stage, s.theta],
            [stage_cost(structure, s, terminal=False)],
        )
        last = ca.Function(
            "last", [s.x, s.stage, s.theta], [stage_cost(structure, s, terminal=True)]
        )
        N = structure.horizon
        x0, u_before, theta = (
            ca.MX.sym("x0", NX),
            ca.MX.sym("u_before", NU),
            ca.MX.sym("theta", THETA_SIZE),
        )
        U, stages = ca.MX.sym("U", NU, N), ca.MX.sym("stages", structure.stage_size, N + 1)
        us, data = ca.horzsplit(U), ca.horzsplit(stages)
        x, before, cost, states = x0, u_before, 0, [x0]
        for k in range(N):
            cost += self._stage(x, us[k], before, data[k], theta)
            x, before = step(x, us[k], theta), us[k]
            states.append(x)
        cost += last(x, data[N], theta)
        self._total = ca.Function(
            "total", [x0, u_before, U, stages, theta], [cost, ca.horzcat(*states)]
        )

    def __call__(self, instance: Instance, inputs: np.ndarray) -> Tuple[float, np.ndarray]:
        """Return cost and states (N + 1, 10) for inputs (N, 4), which are clipped to their bounds."""
        clipped = np.clip(inputs, instance.input_min, instance.input_max)
        i = instance
        cost, states = self._total(i.x0, i.u_before, clipped.T, i.stages, i.theta)
        return float(cost), np.asarray(states).T

    def stage(self, instance: Instance, u: np.ndarray) -> float:
        """Return the cost of stage 0 under an input (4,)."""
        i = instance
        return float(self._stage(i.x0, u, i.u_before, i.stages[:, 0], i.theta))
