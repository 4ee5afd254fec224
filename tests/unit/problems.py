"""Problems that the solver tests share.

Random states beside a straight reference, with or without a sphere.
"""

import dataclasses
from typing import List, Sequence

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import Parameters, load_parameters

SPHERE = Obstacle("sphere", np.array([4.0, 0.3, 5.2]), np.array([0.6]))


def parameters(backend: str, term: str = "potential", **solver: object) -> Parameters:
    """Return the default parameters with another backend, obstacle term and solver options.

    No other way round is tried: what one solve from one guess finds is what is looked at.
    """
    base = load_parameters()
    chosen = dataclasses.replace(base.solver, backend=backend).with_budget(**solver)
    avoidance = dataclasses.replace(base.avoidance, term=term, guides=0)
    return dataclasses.replace(base, solver=chosen, avoidance=avoidance)


def tight(backend: str, term: str = "potential") -> Nmpc:
    """Return an optimiser that iterates until it is exact."""
    budget = {"tolerance": 1e-9, "max_iterations": 500, "warm_iterations": 500}
    return Nmpc(parameters(backend, term, time_budget=30.0, **budget))


def straight_reference(nmpc: Nmpc, speed: float = 1.5) -> np.ndarray:
    """Return the reference states (N + 1, 10) of a straight flight along x at 5 m."""
    N = nmpc.structure.horizon
    x_ref = np.zeros((N + 1, 10))
    x_ref[:, 0] = speed * nmpc.structure.dt * np.arange(N + 1)
    x_ref[:, 2], x_ref[:, 6] = 5.0, speed
    return x_ref


def random_states(count: int, seed: int) -> List[np.ndarray]:
    """Return states within some metres and metres per second of the start of the reference."""
    rng = np.random.default_rng(seed)
    scale = [1.5, 1.5, 1.0, 0.1, 0.1, 0.5, 1.0, 1.0, 0.5, 0.2]
    return [rng.normal(0.0, scale) + np.r_[0, 0, 5.0, np.zeros(7)] for _ in range(count)]


def scenes() -> Sequence[Sequence[Obstacle]]:
    """Return the obstacle lists that problems are posed with."""
    return (), (SPHERE,)
