"""The symbolic model against exact solutions, SciPy's integrator and the plain-float twin."""

import dataclasses
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nmpc_control import prediction
from nmpc_control.model import (
    INTEGRATORS,
    MODEL_SIZE,
    continuous,
    model_parameters,
    reference_step,
    step_function,
)
from nmpc_control.params import Lag, Vehicle, load_vehicle
from nmpc_control.state import (
    GRAVITY,
    NU,
    NX,
    POSITION,
    VELOCITY,
    YAW,
    YAW_RATE,
    hover_input,
    hover_state,
)
from uav_sim.preset import FirstOrder, load_preset, preset_names

VEHICLES = ("dji_hil", "eth", "paper")
DT = 0.1  # [s] the paper's


def call(function: ca.Function, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.asarray(function(x, u, p)).ravel()


def random_state(rng: np.random.Generator) -> np.ndarray:
    return rng.normal(0, [3, 3, 3, 0.2, 0.2, 1.5, 2, 2, 1, 0.5])


def random_input(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform([5, -0.4, -0.4, -1], [15, 0.4, 0.4, 1])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_hover_is_an_equilibrium(integrator):
    p = model_parameters(load_vehicle("dji_hil"))
    x = hover_state(np.array([1.0, -2.0, 3.0]), yaw=0.7)
    assert call(step_function(DT, integrator), x, hover_input(), p) == pytest.approx(x, abs=1e-12)


@pytest.mark.parametrize("name", VEHICLES)
def test_exact_lag_is_within_one_percent_of_the_exact_solution_for_every_lag(name):
    vehicle = load_vehicle(name)
    F = step_function(DT, "exact_lag")
    u = np.array([GRAVITY, 0.3, 0.2, 0.5])
    x = call(F, hover_state(np.zeros(3)), u, model_parameters(vehicle))
    for index, lag, target in (
        (3, vehicle.roll, 0.3),
        (4, vehicle.pitch, 0.2),
        (9, vehicle.yaw_rate, 0.5),
    ):
        exact = lag.gain * target * (1 - np.exp(-DT / lag.time_constant))
        assert x[index] == pytest.approx(exact, rel=1e-12)


def simulated(name: str) -> Vehicle:
    """Return the vehicle of that name with the first-order lags of the simulated aircraft."""
    preset = load_preset(name)
    lags = {
        part: Lag(response.time_constant, response.gain)
        for part in ("roll", "pitch", "yaw_rate")
        for response in [getattr(preset, part)]
        if isinstance(response, FirstOrder)
    }
    return dataclasses.replace(load_vehicle(name), **lags)


ALL_LAGS = [
    *(pytest.param(load_vehicle(name), id=name) for name in VEHICLES),
    *(pytest.param(simulated(name), id=f"simulated {name}") for name in preset_names()),
]
PARTS = {
    "position": POSITION,
    "roll and pitch": slice(3, 5),
    "yaw": slice(YAW, YAW + 1),
    "velocity": VELOCITY,
    "yaw rate": slice(YAW_RATE, YAW_RATE + 1),
}


def worst_errors(vehicle: Vehicle, integrator: str, count: int = 100) -> dict:
    """Return the worst error by part of the state over random steps of 0.1 s.

    Relative to what that part changes in the same step (Euclidean norms).
    """
    p = model_parameters(replace(vehicle, disturbance=np.array([0.3, -0.2, 0.1])))
    F, exact = step_function(DT, integrator), reference_step(DT)
    rng = np.random.default_rng(1)
    worst = dict.fromkeys(PARTS, 0.0)
    for _ in range(count):
        x, u = random_state(rng), random_input(rng)
        truth = call(exact, x, u, p)
        error, change = call(F, x, u, p) - truth, truth - x
        for name, part in PARTS.items():
            ratio = np.linalg.norm(error[part]) / np.linalg.norm(change[part])
            worst[name] = max(worst[name], float(ratio))
    return worst


@pytest.mark.parametrize("vehicle", ALL_LAGS)
def test_exact_lag_is_within_one_percent_of_the_change_over_a_step(vehicle):
    worst = worst_errors(vehicle, "exact_lag")
    assert max(worst.values()) < 0.01, worst


def test_rk4_is_not_for_the_papers_lag():
    assert worst_errors(load_vehicle("paper"), "rk4")["roll and pitch"] > 0.5
    p = model_parameters(load_vehicle("paper"))
    tilted = hover_state(np.zeros(3))
    tilted[3] = 1.0
    decay = {
        name: call(F, tilted, hover_input(), p)[3]
        for name, F in (("rk4", step_function(DT, "rk4")), ("exact", reference_step(DT)))
    }
    assert decay["rk4"] == pytest.approx(0.57, abs=0.01)
    assert decay["exact"] == pytest.approx(0.09, abs=0.001)


@pytest.mark.parametrize("name", VEHICLES)
def test_reference_step_agrees_with_scipy_over_one_step(name):
    vehicle = load_vehicle(name)
    p = model_parameters(replace(vehicle, disturbance=np.array([0.3, -0.2, 0.1])))
    x_symbol, u_symbol, p_symbol = (
        ca.SX.sym("x", NX),
        ca.SX.sym("u", NU),
        ca.SX.sym("p", MODEL_SIZE),
    )
    f = ca.Function("f", [x_symbol, u_symbol, p_symbol], [continuous(x_symbol, u_symbol, p_symbol)])

    def derivative(_, y, u):
        return call(f, y, u, p)

    rng = np.random.default_rng(1)
    for _ in range(5):
        x, u = random_state(rng), random_input(rng)
        exact = solve_ivp(derivative, (0, DT), x, args=(u,), rtol=1e-10, atol=1e-12).y[:, -1]
        assert call(reference_step(DT), x, u, p) == pytest.approx(exact, abs=1e-8)


def test_one_euler_step_is_unstable_for_the_papers_lags_and_the_exact_one_is_not():
    p = model_parameters(load_vehicle("paper"))
    tilted = hover_state(np.zeros(3))
    tilted[3] = 0.1
    factors = {
        i: call(step_function(DT, i), tilted, hover_input(), p)[3] / 0.1
        for i in ("euler", "exact_lag")
    }
    assert factors["euler"] == pytest.approx(-1.41, abs=0.01)
    assert 0 < factors["exact_lag"] < 1


@pytest.mark.parametrize("axis", (0, 1, 2))
def test_speed_decays_under_drag(axis):
    vehicle = load_vehicle("dji_hil")
    x = hover_state(np.zeros(3))
    x[6 + axis] = 3.0
    after = call(step_function(DT), x, hover_input(), model_parameters(vehicle))
    assert after[6 + axis] == pytest.approx(3.0 * np.exp(-vehicle.drag[axis] * DT), rel=1e-6)


@pytest.mark.parametrize(
    ("index", "tilt", "sign"),
    [(3, 0.1, (0, -1)), (4, 0.1, (1, 0))],
    ids=["roll to the right", "pitch forward"],
)
def test_tilt_accelerates_in_the_direction_of_the_dji_signs(index, tilt, sign):
    x = hover_state(np.zeros(3))
    x[index] = tilt
    u = hover_input()
    u[index - 2] = tilt
    v = call(step_function(DT), x, u, model_parameters(load_vehicle("dji_hil")))[6:8]
    assert v == pytest.approx(np.array(sign) * GRAVITY * np.sin(tilt) * DT, abs=0.01)


@pytest.mark.parametrize(
    ("name", "tolerance"), [("dji_hil", 2e-3), ("eth", 2e-4), ("paper", 1.5e-2)]
)
def test_the_plain_float_twin_makes_the_same_step(name, tolerance):
    """Another quadrature, worse the faster the lags; the guard's own tolerances are far wider."""
    rng = np.random.default_rng(2)
    vehicle = load_vehicle(name)
    p = model_parameters(vehicle)
    for _ in range(30):
        x, u = random_state(rng), random_input(rng)
        assert call(step_function(DT), x, u, p) == pytest.approx(
            prediction.step(x, u, DT, vehicle), abs=tolerance
        )


def test_disturbance_is_an_acceleration_in_the_world_frame():
    d = np.array([0.5, -0.3, 0.2])
    vehicle = dataclasses.replace(load_vehicle("dji_hil"), drag=np.zeros(3), disturbance=d)
    after = call(
        step_function(DT), hover_state(np.zeros(3)), hover_input(), model_parameters(vehicle)
    )
    assert after[6:9] == pytest.approx(d * DT)
    assert after[:3] == pytest.approx(d * DT**2 / 2)
