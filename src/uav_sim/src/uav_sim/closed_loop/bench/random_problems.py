# SPDX-License-Identifier: MIT
"""Random problems: a scenario at a random time, a disturbed state, other obstacles.

They are scenes that can be flown: the hull passes between any two spheres, and the state lies outside of all of them.
"""

from typing import Dict, List, Sequence

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.params import load_parameters
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.state import NX, POSITION, VELOCITY, YAW, YAW_RATE, Obstacle, hover_input
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.problems import PLANT, exact_solver, structure_of

_SCENARIOS = ("hexagon", "multi_obstacle", "one_obstacle", "spline", "circle_xy", "go_to_point")
_WEIGHTS = ("indoor", "outdoor", "position_priority", "velocity_priority")
_SIGMA = np.array([0.5, 0.5, 0.3, 0.1, 0.1, 0.2, 0.7, 0.7, 0.4, 0.1])  # of the disturbed state
_STRONG = 0.2  # part of the problems with a disturbance this many times as large
_STRONG_FACTOR = 4.0
_MOST_SPHERES = 4
_RADIUS = (0.2, 0.8)  # [m]
_ASIDE = (1.5, 1.5, 1.0)  # [m] sigma of their distance from the path
_PASSAGE = 1.2  # [m] least gap between two surfaces
_PERIOD = 0.05  # [s] since the solve that a warm start comes from


def random_problems(seed: int, count: int) -> List[Problem]:
    """Return problems drawn with a seed; every second one is warm started, the others begin from hover.

    A warm start is the shifted solution of the problem before the disturbance. No state lies within the hull of an
    obstacle.
    """
    rng = np.random.default_rng(seed)
    scenarios = [load_scenario(name) for name in _SCENARIOS]
    optimisers = _optimisers()
    return [
        _draw(
            rng,
            scenarios[rng.integers(len(scenarios))],
            optimisers[_WEIGHTS[rng.integers(len(_WEIGHTS))]],
            i,
        )
        for i in range(count)
    ]


def _optimisers() -> Dict[str, Nmpc]:
    result = {}
    for name in _WEIGHTS:
        nmpc = Nmpc(load_parameters(PLANT, name))
        nmpc.solver = exact_solver(structure_of(nmpc.parameters))
        result[name] = nmpc
    return result


def _draw(rng: np.random.Generator, scenario: Scenario, nmpc: Nmpc, index: int) -> Problem:
    t = rng.uniform(0.0, scenario.trajectory.duration)
    before, reference = (_reference(nmpc, scenario, s) for s in (t - _PERIOD, t))
    obstacles = list(scenario.obstacles) + _spheres(rng, reference[:, POSITION], scenario.obstacles)
    hull = nmpc.parameters.vehicle.radius
    x0 = reference[0]
    for _ in range(1000):
        scale = _STRONG_FACTOR if rng.random() < _STRONG else 1.0
        x0 = reference[0] + scale * rng.normal(size=NX) * _SIGMA
        if all(obstacle.distance(x0[POSITION]) > hull for obstacle in obstacles):
            break
    limits = nmpc.parameters.limits
    u_before = np.clip(
        hover_input() + rng.normal(size=4) * [0.5, 0.1, 0.1, 0.1],
        limits.input_min,
        limits.input_max,
    )
    recorder = Recorder(nmpc.solver)
    nmpc.reset()
    if index % 2:
        nmpc.solve(t - _PERIOD, before[0], before, u_before, obstacles)
    nmpc.solver = recorder
    nmpc.solve(t, x0, reference, u_before, obstacles)
    nmpc.solver = recorder.solver
    kind = "random_warm" if index % 2 else "random_cold"
    return Problem(kind, nmpc.structure, recorder.instances[0], recorder.guesses[0])


def _reference(nmpc: Nmpc, scenario: Scenario, t: float) -> np.ndarray:
    """Return the reference states (N + 1, 10) of a scenario from its time ``t`` [s] on."""
    sample = scenario.trajectory.sample(
        t + nmpc.structure.dt * np.arange(nmpc.structure.horizon + 1)
    )
    x = np.zeros((nmpc.structure.horizon + 1, NX))
    x[:, POSITION], x[:, VELOCITY] = sample.position, sample.velocity
    x[:, YAW], x[:, YAW_RATE] = sample.yaw, sample.yaw_rate
    return x


def _spheres(
    rng: np.random.Generator, path: np.ndarray, others: Sequence[Obstacle]
) -> Sequence[Obstacle]:
    """Return some spheres on or beside the path (N + 1, 3); a hull fits between any two obstacles."""
    spheres: List[Obstacle] = []
    for i in range(rng.integers(_MOST_SPHERES + 1)):
        centre = path[rng.integers(len(path))] + rng.normal(size=3) * _ASIDE
        radius = rng.uniform(*_RADIUS)
        if all(o.distance(centre) > radius + _PASSAGE for o in [*others, *spheres]):
            spheres.append(Obstacle(f"random{i}", centre, np.array([radius])))
    return spheres
