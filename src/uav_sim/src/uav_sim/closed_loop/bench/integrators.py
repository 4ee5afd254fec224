# SPDX-License-Identifier: MIT
"""Accuracy, stability and speed by integrator and sampling time, against CVODES.

The paper samples faster by an Euler step in place of CVODES or Runge-Kutta (its discussion of the
flights). Here is what each of them costs, and what it gets wrong.
"""

import time
from dataclasses import replace
from typing import Dict, List, Sequence, Tuple

import casadi as ca
import numpy as np

from nmpc_control.model import INTEGRATORS, model_parameters, reference_step, step_function
from nmpc_control.nmpc import Nmpc
from nmpc_control.params import Vehicle, load_vehicle
from nmpc_control.scenario import load_scenario
from nmpc_control.state import POSITION, ROLL, VELOCITY, YAW, YAW_RATE, hover_input, hover_state
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.random_problems import reference_states
from uav_sim.closed_loop.bench.recording import exact_solver

VEHICLE = "paper"  # its lags are the fastest of all presets
SECONDS = 1.0  # [s] over which errors add up
_HORIZON = 6.0  # [s] the paper's
_DRAWS = 100
_LIMIT = 1e3  # [1] a greater relative error is written as this one
_PARTS = (POSITION, slice(ROLL, YAW), slice(YAW, YAW + 1), VELOCITY, slice(YAW_RATE, YAW_RATE + 1))


def study(steps: Sequence[float], count: int, repeats: int) -> List[Dict[str, object]]:
    """Return a row for every integrator and sampling time [s], CVODES' own cost included.

    Args:
        steps: sampling times [s].
        count: of problems that are solved with each.
        repeats: of every solve; the fastest counts.
    """
    vehicle = load_vehicle(VEHICLE)
    rows: List[Dict[str, object]] = []
    for dt in steps:
        exact = reference_step(dt)
        for name in (*INTEGRATORS, "cvodes"):
            step = exact if name == "cvodes" else step_function(dt, name)
            one, second = errors(step, exact, vehicle, dt)
            row = {"dt": dt, "rate_hz": 1.0 / dt, "integrator": name}
            row.update(step_error=one, second_error=second, lag_factor=_factor(step, vehicle))
            row.update(step_us=1e6 * _seconds(step, vehicle), solve_ms=None, solve_rate_hz=None)
            if name != "cvodes":
                milliseconds = _solve_ms(dt, name, count, repeats)
                row.update(solve_ms=milliseconds, solve_rate_hz=1e3 / milliseconds)
            rows.append(row)
    return rows


def errors(
    step: ca.Function, exact: ca.Function, vehicle: Vehicle, dt: float
) -> Tuple[float, float]:
    """Return the worst relative error after one step and after ``SECONDS``.

    Of position, attitude, velocity and yaw rate apart, each relative to the root mean square of
    what it changes in that time over all draws; so an accident that leaves a part where it was does
    not count as an infinite error.
    """
    begin, u = _draws()
    p = model_parameters(vehicle)
    result, ours, truth = [], begin, begin
    for count in (1, round(SECONDS / dt) - 1):
        for _ in range(count):
            ours, truth = np.asarray(step(ours, u, p)), np.asarray(exact(truth, u, p))
        error, change = np.nan_to_num(ours - truth, nan=np.inf), truth - begin
        ratios = [_size(error[part]).max() / _rms(_size(change[part])) for part in _PARTS]
        result.append(float(min(max(ratios), _LIMIT)))
    return result[0], result[1]


def _draws() -> Tuple[np.ndarray, np.ndarray]:
    """Return states (10, M) and inputs (4, M) all over what is flown."""
    rng = np.random.default_rng(0)
    states = rng.uniform(-1.0, 1.0, (_DRAWS, 10)) * [3, 3, 3, 0.4, 0.4, 3.1, 3, 3, 1, 1]
    return states.T, rng.uniform([5, -0.4, -0.4, -1], [15, 0.4, 0.4, 1], (_DRAWS, 4)).T


def _size(part: np.ndarray) -> np.ndarray:
    return np.linalg.norm(part, axis=0)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _factor(step: ca.Function, vehicle: Vehicle) -> float:
    """Return the factor on the attitude's error in one step; stable below 1 in magnitude."""
    x = hover_state(np.zeros(3))
    x[ROLL] = 1e-3
    return float(step(x, hover_input(), model_parameters(vehicle))[ROLL]) / 1e-3


def _seconds(step: ca.Function, vehicle: Vehicle) -> float:
    """Return the mean time [s] of one step in CasADi's interpreter."""
    x, u = _draws()
    p, times = model_parameters(vehicle), []
    for _ in range(5):
        start = time.perf_counter()
        step(x, u, p)
        times.append(time.perf_counter() - start)
    return min(times) / _DRAWS


def _solve_ms(dt: float, integrator: str, count: int, repeats: int) -> float:
    """Return the median time [ms] of a converged solve over the paper's horizon of 6 s."""
    parameters = bench_parameters()
    solver = replace(parameters.solver, integrator=integrator, dt=dt, horizon=round(_HORIZON / dt))
    nmpc = Nmpc(replace(parameters, solver=solver, vehicle=load_vehicle(VEHICLE)))
    nmpc.solver = recorder = Recorder(exact_solver(nmpc.structure))
    scenario = load_scenario("multi_obstacle")
    fastest = []
    for t in np.linspace(0.2, 0.8, count) * scenario.trajectory.duration:
        nmpc.reset()
        states = reference_states(nmpc, scenario, t)
        nmpc.solve(t, states[0], states, hover_input(), scenario.obstacles)
        nmpc.solve(t, states[0] + 0.02, states, hover_input(), scenario.obstacles)
        problem = Problem("", nmpc.structure, recorder.instances[-1], recorder.guesses[-1])
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            recorder.solver.solve(problem.instance, problem.guess)
            times.append(time.perf_counter() - start)
        fastest.append(1e3 * min(times))
    return float(np.median(fastest))
