# SPDX-License-Identifier: MIT
"""Pieces of the estimation against closed forms, brute force and known distributions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter, lsim

from nmpc_control.analysis.identification.confidence import block_covariance, intervals
from nmpc_control.analysis.identification.output_error import (
    ResponseModel,
    fit,
    fit_percent,
)
from nmpc_control.analysis.identification.passages import Passage
from nmpc_control.analysis.identification.response import (
    FIRST,
    GRID,
    LONGEST_DEAD_TIME,
    SECOND,
    held_mean,
    lagged_mean,
    respond,
)
from nmpc_control.analysis.identification.robust import r_squared, trimmed_least_squares

STEP = np.concatenate([np.zeros(40), np.ones(400)])
TIMES = GRID * np.arange(len(STEP) + 1)
SINCE = np.maximum(TIMES - 40 * GRID, 0.0)


@given(omega=st.floats(2.0, 40.0), zeta=st.floats(0.2, 0.95))
@settings(max_examples=25, deadline=None)
def test_second_order_step_is_the_closed_form(omega, zeta):
    damped = omega * np.sqrt(1.0 - zeta**2)
    decay = np.exp(-zeta * omega * SINCE)
    wave = np.cos(damped * SINCE) + zeta * omega / damped * np.sin(damped * SINCE)
    assert respond(SECOND, (omega, zeta), STEP) == pytest.approx(1.0 - decay * wave, abs=1e-9)


@given(time_constant=st.floats(0.02, 1.0))
@settings(max_examples=25, deadline=None)
def test_first_order_step_is_the_closed_form(time_constant):
    expected = 1.0 - np.exp(-SINCE / time_constant)
    assert respond(FIRST, (time_constant,), STEP) == pytest.approx(expected, abs=1e-9)


def test_overdamped_response_to_anything_equals_scipy():
    u = np.random.default_rng(0).normal(size=300)
    u[0] = 0.0
    times = GRID * np.arange(len(u) + 1)
    system = ([64.0], [1.0, 2.0 * 1.7 * 8.0, 64.0])
    _, expected, _ = lsim(system, np.append(u, u[-1]), times, interp=False)
    assert respond(SECOND, (8.0, 1.7), u) == pytest.approx(expected, abs=1e-9)


def test_constant_input_stays_where_it_is():
    assert respond(SECOND, (10.0, 0.7), np.full(50, 0.3)) == pytest.approx(0.3)


@given(st.lists(st.floats(0.001, 0.05), min_size=2, max_size=20), st.integers(0, 100))
@settings(max_examples=25, deadline=None)
def test_held_mean_equals_brute_force(steps, seed):
    times = np.cumsum(steps)
    values = np.random.default_rng(seed).normal(size=(len(times), 2))
    grid = np.linspace(times[0], times[-1] + 0.02, 12)
    found = held_mean(times, values, grid)
    for (a, b), row in zip(zip(grid[:-1], grid[1:]), found):
        fine = a + (np.arange(4000) + 0.5) / 4000 * (b - a)
        held = values[np.searchsorted(times, fine, side="right") - 1]
        assert row == pytest.approx(held.mean(axis=0), abs=2e-2)


@given(
    st.lists(st.floats(0.001, 0.05), min_size=2, max_size=20),
    st.floats(0.005, 0.2),
    st.integers(0, 100),
)
@settings(max_examples=25, deadline=None)
def test_lagged_mean_equals_a_fine_simulation(steps, lag, seed):
    times = np.concatenate([[0.0], np.cumsum(np.maximum(1, np.round(np.array(steps) / 1e-3)))])
    values = np.random.default_rng(seed).normal(size=len(times))
    fine = 1e-5 * np.arange(round(times[-1] * 100) + 2001)  # commands on it: held is exact
    times *= 1e-3
    held = values[np.searchsorted(times, fine + 1e-9, side="right") - 1]
    lagged = held[0] + lsim(([1.0], [lag, 1.0]), held - held[0], fine, interp=False)[1]
    area = np.concatenate([[0.0], np.cumsum(0.5e-5 * (lagged[1:] + lagged[:-1]))])
    grid = np.linspace(0.0, fine[-1], 12)
    expected = np.diff(np.interp(grid, fine, area)) / np.diff(grid)
    assert lagged_mean(times, values, grid, lag) == pytest.approx(expected, abs=1e-4)


def passage(gain, omega, zeta, dead_time, limit, seed=0):
    """Return commands at 50 Hz and the exact response to them, sampled unevenly."""
    generator = np.random.default_rng(seed)
    sent = np.arange(0.0, 20.0, 0.02)
    commands = np.repeat(generator.uniform(-0.8, 0.8, (len(sent) // 20, 2)), 20, axis=0)
    fine = 0.0005
    grid = np.arange(0.0, 20.0, fine)
    norm = np.linalg.norm(commands, axis=1, keepdims=True)
    limited = commands * np.minimum(1.0, limit / norm)
    late = np.searchsorted(sent, grid - dead_time + 1e-12, side="right") - 1
    u = limited[np.maximum(late, 0)] * (late >= 0)[:, None]
    system = ([gain * omega**2], [1.0, 2.0 * zeta * omega, omega**2])
    y = np.stack([lsim(system, column, grid, interp=False)[1] for column in u.T], axis=1)
    times = np.sort(generator.uniform(2.0, 19.9, 1500))
    values = np.stack([np.interp(times, grid, column) for column in y.T], axis=1)
    model_grid = np.arange(-LONGEST_DEAD_TIME, 20.0, GRID)
    first = np.concatenate([[-LONGEST_DEAD_TIME], sent])
    return Passage(model_grid, first, np.vstack([[0.0, 0.0], commands]), times, values, 0)


@pytest.mark.parametrize("dead_time", [0.0, 0.0431, 0.1187])
def test_fit_finds_an_independent_plant_at_any_dead_time(dead_time):
    truth = (0.93, 7.3, 0.55, dead_time)
    found = fit(ResponseModel(SECOND, 2, has_limit=True), [passage(*truth, limit=0.6)])
    assert found.limit == pytest.approx(0.6, rel=0.005)
    for row in found.rows:
        assert row[:3] == pytest.approx(truth[:3], rel=0.01)
        assert row[3] == pytest.approx(dead_time, abs=0.001)


@pytest.mark.parametrize("shares", [False, True])
@pytest.mark.parametrize("order", [FIRST, SECOND], ids=["first", "second"])
def test_jacobian_is_the_derivative(order, shares):
    data = [passage(1.0, 9.0, 0.7, 0.07, limit=0.6)]
    model = ResponseModel(order, 2, has_limit=True, shares_dead_time=shares)
    p = model.start(data) + 0.004
    jacobian = model.jacobian(p, data)
    for column, direction in zip(jacobian.T, np.eye(len(p))):
        h = 2e-3 * direction
        numeric = (model.residuals(p + h, data) - model.residuals(p - h, data)) / 4e-3
        assert np.linalg.norm(column - numeric) < 0.03 * np.linalg.norm(numeric)


def test_intervals_of_correlated_residuals_are_honest():
    """The mean of an AR(1) process: intervals as if independent would miss far more often."""
    generator = np.random.default_rng(0)
    count, correlation, trials, hits = 4000, 0.98, 200, 0
    for _ in range(trials):
        e = lfilter([1.0], [1.0, -correlation], generator.normal(size=count))
        mean = e.mean()
        found = block_covariance(np.ones((count, 1)), mean - e, np.arange(count) // 250)
        low, high = intervals(("mean",), (mean,), found)["mean"]
        hits += low <= 0.0 <= high
    assert 0.85 < hits / trials <= 1.0


def test_too_little_data_or_parameters_that_cannot_be_told_apart_give_no_interval():
    one = np.ones((40, 1))
    assert block_covariance(one, np.ones(40), np.arange(40) // 20) is None
    assert block_covariance(np.hstack([one, one]), np.ones(40), np.arange(40)) is None
    assert intervals(("a",), (1.0,), None) == {"a": None}


def test_outliers_do_not_move_a_trimmed_fit():
    generator = np.random.default_rng(1)
    x = generator.uniform(-1.0, 1.0, 400)
    y = 2.0 * x + 1.0 + 0.05 * generator.normal(size=400)
    y[::40] += 30.0
    found = trimmed_least_squares(np.column_stack([x, np.ones_like(x)]), y)
    assert found.parameters == pytest.approx([2.0, 1.0], abs=0.02)
    assert not found.used[::40].any()
    assert found.used.sum() == 390
    assert r_squared(y[found.used], found.residuals[found.used]) > 0.99


def test_fit_percent_of_extremes():
    y = np.array([0.0, 1.0, 2.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.ones(3)) == 0.0
    assert fit_percent(np.ones(3), y) is None
