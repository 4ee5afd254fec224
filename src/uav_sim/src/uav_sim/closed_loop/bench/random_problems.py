# SPDX-License-Identifier: MIT
"""Random problems: a scenario at a random time, a disturbed state, other obstacles.

They are scenes that can be flown: the hull passes between any two spheres, and the state lies
outside of all of them.
"""

from dataclasses import replace
from typing import List, Sequence

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import Parameters, load_weights
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.state import NX, POSITION, VELOCITY, YAW, YAW_RATE, hover_input
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.recording import exact_solver

_SCENARIOS = ("hexagon", "multi_obstacle", "one_obstacle", "spline", "circle_xy", "go_to_point")
_WEIGHTS = ("indoor", "outdoor", "position_priority", "velocity_priority")
_SIGMA = np.array([0.5, 0.5, 0.3, 0.1, 0.1, 0.2, 0.7, 0.7, 0.4, 0.1])  # of the disturbed state
_SIGMA_INPUT = np.array([0.5, 0.1, 0.1, 0.1])  # of the input before, about hover
_STRONG = 0.2  # part of the problems with a disturbance _STRONG_FACTOR as large
_STRONG_FACTOR = 3.0
_LOWEST = 0.5  # [m] height
_MOST_SPHERES = 4
_RADIUS = (0.2, 0.8)  # [m]
_ASIDE = (1.5, 1.5, 1.0)  # [m] sigma of their distance from the path
_PASSAGE = 1.2  # [m] least gap between two surfaces
_SPEED, _RATE = (1.2, 3.0), (0.2, 1.0)  # [m/s] limit; part of the usual input rate
_PERIOD = 0.05  # [s] since the solve that a warm start comes from


def random_problems(seed: int, count: int, bounded: float = 0.0) -> List[Problem]:
    """Return problems drawn with a seed; every second one is warm started, the others from hover.

    A warm start is the shifted solution of the problem before the disturbance.

    Args:
        seed: of the draw.
        count: number of problems.
        bounded: part of them with bounds of speed and input rate that are felt, half of these with
            Eq. 7 as an inequality.
    """
    rng = np.random.default_rng(seed)
    scenarios = [load_scenario(name) for name in _SCENARIOS]
    nmpc = Nmpc(bench_parameters())
    nmpc.solver = Recorder(exact_solver(nmpc.structure))
    weights = [load_weights(name) for name in _WEIGHTS]
    usual, result = nmpc.parameters, []
    for i in range(count):
        parameters = replace(usual, weights=weights[rng.integers(len(weights))])
        is_bounded = bounded > 0.0 and rng.random() < bounded
        nmpc.use(_bounded(rng, parameters) if is_bounded else parameters)
        result.append(_draw(rng, scenarios[rng.integers(len(scenarios))], nmpc, warm=i % 2 == 1))
    return result


def _bounded(rng: np.random.Generator, parameters: Parameters) -> Parameters:
    """Return parameters with bounds that will be felt: speed, input rate, for some Eq. 7."""
    limits = replace(
        parameters.limits,
        speed=rng.uniform(*_SPEED),
        input_rate=parameters.limits.input_rate * rng.uniform(*_RATE),
    )
    term = "hard" if rng.random() < 0.5 else parameters.avoidance.term
    return replace(parameters, limits=limits, avoidance=replace(parameters.avoidance, term=term))


def _draw(rng: np.random.Generator, scenario: Scenario, nmpc: Nmpc, warm: bool) -> Problem:
    t = rng.uniform(0.0, scenario.trajectory.duration)
    before, reference = (reference_states(nmpc, scenario, s) for s in (t - _PERIOD, t))
    obstacles = [*scenario.obstacles, *_spheres(rng, reference[:, POSITION], scenario.obstacles)]
    limits = nmpc.parameters.limits
    u_before = hover_input() + rng.normal(size=4) * _SIGMA_INPUT
    u_before = np.clip(u_before, limits.input_min, limits.input_max)
    nmpc.reset()
    if warm:
        nmpc.solve(t - _PERIOD, before[0], before, u_before, obstacles)
    x0 = _disturbed(rng, reference[0], obstacles, nmpc.parameters.vehicle.radius)
    nmpc.solve(t, x0, reference, u_before, obstacles)
    posed = nmpc.solver
    kind = "random_warm" if warm else "random_cold"
    return Problem(kind, nmpc.structure, posed.instances[-1], posed.guesses[-1])


def reference_states(nmpc: Nmpc, scenario: Scenario, t: float) -> np.ndarray:
    """Return the reference states (N + 1, 10) of a scenario from its time ``t`` [s] on."""
    steps = np.arange(nmpc.structure.horizon + 1)
    sample = scenario.trajectory.sample(t + nmpc.structure.dt * steps)
    x = np.zeros((len(steps), NX))
    x[:, POSITION], x[:, VELOCITY] = sample.position, sample.velocity
    x[:, YAW], x[:, YAW_RATE] = sample.yaw, sample.yaw_rate
    return x


def _disturbed(
    rng: np.random.Generator, x: np.ndarray, obstacles: Sequence[Obstacle], hull: float
) -> np.ndarray:
    """Return a state (10,) near ``x`` whose hull [m] touches neither obstacle nor ground."""
    while True:
        scale = _STRONG_FACTOR if rng.random() < _STRONG else 1.0
        disturbed = x + scale * rng.normal(size=NX) * _SIGMA
        free = all(obstacle.distance(disturbed[POSITION]) > hull for obstacle in obstacles)
        if free and disturbed[2] > _LOWEST:
            return disturbed


def _spheres(
    rng: np.random.Generator, path: np.ndarray, others: Sequence[Obstacle]
) -> List[Obstacle]:
    """Return some spheres on or beside the path (N + 1, 3), each with a passage to all others."""
    spheres: List[Obstacle] = []
    for i in range(rng.integers(_MOST_SPHERES + 1)):
        centre = path[rng.integers(len(path))] + rng.normal(size=3) * _ASIDE
        radius = rng.uniform(*_RADIUS)
        if all(o.distance(centre) > radius + _PASSAGE for o in [*others, *spheres]):
            spheres.append(Obstacle(f"random{i}", centre, np.array([radius])))
    return spheres
