# SPDX-License-Identifier: MIT
"""The guard's model against exact exponentials and scipy's adaptive integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nmpc_control.params import load_vehicle
from nmpc_control.prediction import derivative, predict, step
from nmpc_control.state import GRAVITY, VELOCITY, YAW_RATE, hover_input, hover_state

VEHICLES = [load_vehicle(name) for name in ("dji_hil", "eth", "paper")]
STATE = [1.0, -2.0, 3.0, 0.2, -0.1, 2.5, 1.5, -0.5, 0.3, 0.4]
INPUT = [11.0, -0.3, 0.25, -0.6]


def integrated(state, u, duration, vehicle):
    solution = solve_ivp(
        lambda _, x: derivative(x, u, vehicle), (0.0, duration), state, rtol=1e-11, atol=1e-12
    )
    return solution.y[:, -1]


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
def test_step_agrees_with_adaptive_integration(vehicle):
    x = step(STATE, INPUT, 0.02, vehicle)
    np.testing.assert_allclose(x, integrated(STATE, INPUT, 0.02, vehicle), atol=1e-5)


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda v: v.name)
def test_lags_are_exact_for_a_long_step(vehicle):
    x = step(STATE, INPUT, 0.7, vehicle)
    for i, reference, lag in ((3, -0.3, vehicle.roll), (4, 0.25, vehicle.pitch)):
        final = lag.gain * reference
        assert x[i] == pytest.approx(
            final + (STATE[i] - final) * math.exp(-0.7 / lag.time_constant)
        )
    lag = vehicle.yaw_rate
    final, decay = -0.6 * lag.gain, math.exp(-0.7 / lag.time_constant)
    assert x[YAW_RATE] == pytest.approx(final + (0.4 - final) * decay)
    turned = final * 0.7 + (0.4 - final) * lag.time_constant * (1.0 - decay)
    assert x[5] == pytest.approx(2.5 + turned)


def test_one_long_step_errs_with_the_fourth_order():
    vehicle = VEHICLES[0]
    errors = []
    for dt in (0.08, 0.04):
        exact = integrated(STATE, INPUT, dt, vehicle)
        errors.append(np.abs(step(STATE, INPUT, dt, vehicle) - exact)[VELOCITY].max())
    assert errors[0] / errors[1] > 2**4  # local error of a fourth-order step: about 2^5


def test_hover_stays_and_drag_brakes():
    vehicle = VEHICLES[0]
    at_rest = hover_state(np.array([1.0, 2.0, 3.0]), 0.7)
    np.testing.assert_allclose(step(at_rest, hover_input(), 0.5, vehicle), at_rest, atol=1e-12)
    moving = at_rest.copy()
    moving[VELOCITY] = 2.0, -1.0, 0.5
    x = np.array(step(moving, hover_input(), 0.1, vehicle))
    expected = moving[VELOCITY] * np.exp(-vehicle.drag * 0.1)
    np.testing.assert_allclose(x[VELOCITY], expected, atol=1e-8)


def test_positive_pitch_accelerates_forward_and_positive_roll_to_the_right():
    vehicle = VEHICLES[0]
    facing_north = hover_state(np.zeros(3), math.pi / 2)
    facing_north[4] = 0.1
    assert derivative(facing_north, hover_input(), vehicle)[7] == pytest.approx(
        GRAVITY * math.sin(0.1)
    )
    facing_north[3:5] = 0.1, 0.0
    assert derivative(facing_north, hover_input(), vehicle)[6] == pytest.approx(
        GRAVITY * math.sin(0.1)
    )


def test_inputs_act_after_the_delay_and_hold():
    vehicle = VEHICLES[0]
    first, second = [10.0, 0.2, 0.0, 0.3], [9.0, -0.2, 0.1, 0.0]
    inputs = [(4.9, first), (5.0, second)]
    x = np.array(STATE)
    acting = [
        (hover_input(), 5.0, 4.9 + vehicle.delay),
        (first, 4.9 + vehicle.delay, 5.0 + vehicle.delay),
        (second, 5.0 + vehicle.delay, 5.5),
    ]
    for u, start, end in acting:
        x = integrated(x, u, end - start, vehicle)
    np.testing.assert_allclose(predict(STATE, 5.0, 5.5, inputs, vehicle), x, atol=1e-5)


def test_prediction_forgets_inputs_replaced_before_it_begins():
    vehicle = VEHICLES[1]  # no dead time
    history = [(0.0, [20.0, 0.4, 0.4, 1.0]), (1.0, INPUT)]
    alone = predict(STATE, 2.0, 2.3, [(1.0, INPUT)], vehicle)
    np.testing.assert_array_equal(predict(STATE, 2.0, 2.3, history, vehicle), alone)
    assert not np.allclose(alone, predict(STATE, 2.0, 2.3, [], vehicle))


def test_prediction_into_the_past_returns_the_state():
    np.testing.assert_array_equal(predict(STATE, 2.0, 1.0, [(0.0, INPUT)], VEHICLES[0]), STATE)


def test_not_a_number_stays_visible():
    assert math.isnan(step(STATE, [math.nan, 0.0, 0.0, 0.0], 0.1, VEHICLES[0])[8])
