import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import welch

from uav_sim.wind import (
    GustLevel,
    GustSigma,
    Wind,
    WindParameters,
    intensities,
    lag_pair,
    scale_lengths,
)

FOOT = 0.3048


def parameters(gusts, speed=0.0, direction=0.0, spread=0.0, **changes):
    values = {"length_factor": 1.0, "min_airspeed": 1.0, "period": 0.02, **changes}
    return WindParameters(speed, direction, spread, gusts, **values)


def blow(count, height=30.0, airspeed=20.0, step=0.5, seed="1", **changes):
    """Return gusts (count, 3), one per period of ``step`` seconds, seen flying east."""
    wind = Wind(parameters(GustSigma(2.0), period=step, **changes), seed, step)
    return np.array([wind.advance(height, (airspeed, 0.0, 0.0)) for _ in range(count)])


@pytest.mark.parametrize(
    ("feet", "along", "up"),  # MIL-F-8785C by hand
    [(10.0, 75.64, 10.0), (100.0, 505.17, 100.0), (1000.0, 1000.0, 1000.0)],
)
def test_scale_lengths_of_the_specification(feet, along, up):
    lengths = scale_lengths(feet * FOOT)
    assert lengths == pytest.approx((along * FOOT, up * FOOT), rel=1e-3)


def test_below_10_and_above_1000_feet_the_values_of_these_hold():
    assert scale_lengths(0.0) == scale_lengths(10.0 * FOOT)
    assert scale_lengths(5000.0) == scale_lengths(1000.0 * FOOT)


@pytest.mark.parametrize(("name", "knots"), [("light", 15), ("moderate", 30), ("severe", 45)])
def test_intensity_by_name(name, knots):
    horizontal, vertical = intensities(GustLevel(name), 20.0 * FOOT)
    assert vertical == pytest.approx(0.1 * knots * 0.514444, rel=1e-5)
    assert horizontal / vertical == pytest.approx(1.9292, rel=1e-3)  # 0.19346^-0.4


def test_intensity_by_sigma_is_the_horizontal_one():
    assert intensities(GustSigma(1.5), 1000.0 * FOOT) == pytest.approx((1.5, 1.5))
    assert intensities(GustSigma(1.5), 20.0 * FOOT) == pytest.approx((1.5, 1.5 / 1.9292), rel=1e-3)


@pytest.mark.parametrize(("step", "airspeed"), [(0.2, 100.0), (1.0, 20.0)])
def test_sigma_does_not_depend_on_the_step(step, airspeed):
    gusts = blow(15000, step=step, airspeed=airspeed)
    expected = [2.0, 2.0, intensities(GustSigma(2.0), 30.0)[1]]
    assert gusts.std(axis=0) == pytest.approx(expected, rel=0.08)
    assert abs(gusts.mean(axis=0)).max() < 0.5


def test_correlation_in_time_is_drydens():
    gusts, step, airspeed = blow(25000, step=1.0), 1.0, 20.0
    along, up = scale_lengths(30.0)
    for axis, length in ((0, along), (1, along), (2, up)):
        for lag in (1, 2, 6):
            r = airspeed * lag * step / length
            expected = math.exp(-r) * (1.0 if axis == 0 else 1.0 - 0.5 * r)
            x = gusts[:, axis]
            measured = np.mean(x[lag:] * x[:-lag]) / np.mean(x * x)
            assert measured == pytest.approx(expected, abs=0.08), (axis, lag)


def test_spectrum_is_that_of_the_specification():
    step, airspeed = 0.05, 20.0
    gusts = blow(40000, step=step)
    (along, up), (horizontal, vertical) = scale_lengths(30.0), intensities(GustSigma(2.0), 30.0)
    f, power = welch(gusts, 1.0 / step, nperseg=2048, axis=0)
    k = 2.0 * math.pi * f / airspeed  # [rad/m]

    def lateral(sigma, length):
        x = (length * k) ** 2
        return sigma**2 * length / math.pi * (1 + 3 * x) / (1 + x) ** 2

    longitudinal = horizontal**2 * 2 * along / math.pi / (1 + (along * k) ** 2)
    expected = np.stack([longitudinal, lateral(horizontal, along), lateral(vertical, up)], axis=1)
    expected *= 2.0 * math.pi / airspeed
    for low, high in ((0.03, 0.1), (0.1, 0.3), (0.3, 1.0)):
        band = (f >= low) & (f < high)
        ratio = power[band].mean(axis=0) / expected[band].mean(axis=0)
        assert ratio == pytest.approx([1.0] * 3, rel=0.25), (low, high)


@pytest.mark.parametrize("r", [0.01, 0.3, 2.0])
def test_filter_of_v_and_w_is_exact_over_any_step(r):
    """Van Loan's integral of the noise of p' = -p + sqrt(2) w, q' = p - q."""
    A, G = np.array([[-1.0, 0.0], [1.0, -1.0]]), np.diag([2.0, 0.0])
    big = expm(np.block([[-A, G], [np.zeros((2, 2)), A.T]]) * r)
    step = big[2:, 2:].T
    noise = step @ big[:2, 2:]
    a, b, pp, pq, qq = lag_pair(r)
    assert np.array([[a, 0.0], [b, a]]) == pytest.approx(step)
    assert np.array([[pp, pq], [pq, qq]]) == pytest.approx(noise, abs=1e-12)


def test_mean_wind_blows_where_it_should():
    wind = Wind(parameters(GustSigma(0.0), speed=6.0, direction=math.pi / 2), "1", 0.005)
    assert wind.advance(10.0, (3.0, 0.0, 0.0)) == pytest.approx((0.0, 6.0, 0.0))


def test_direction_is_drawn_within_its_spread():
    def direction(seed):
        x, y, _ = Wind(parameters(GustSigma(0.0), 6.0, 0.5, 0.3), str(seed), 0.005).mean
        return math.atan2(y, x)

    drawn = [direction(seed) for seed in range(200)]
    assert 0.2 <= min(drawn) < 0.25 and 0.75 < max(drawn) <= 0.8


def test_u_lies_along_the_mean_wind():
    """Only u has a correlation above (1 - r / 2) e^-r; here it shows on the north axis."""
    gusts = blow(15000, step=1.0, speed=1e-6, direction=math.pi / 2)
    lag, along = 4, scale_lengths(30.0)[0]
    r = 20.0 * lag / along
    north = np.mean(gusts[lag:, 1] * gusts[:-lag, 1]) / np.mean(gusts[:, 1] ** 2)
    assert north == pytest.approx(math.exp(-r), abs=0.08)


def test_gusts_pass_no_slower_than_the_least_airspeed():
    drifting = blow(2000, airspeed=0.0, min_airspeed=5.0)
    assert np.array_equal(drifting, blow(2000, airspeed=5.0))


@pytest.mark.parametrize(("period", "step", "steps"), [(0.02, 0.005, 4), (0.001, 0.005, 1)])
def test_a_gust_is_held_for_its_period(period, step, steps):
    assert Wind(parameters(GustSigma(1.0), period=period), "1", step).steps == steps


def test_the_seed_decides():
    assert np.array_equal(blow(100, seed="1"), blow(100, seed="1"))
    assert not np.array_equal(blow(100, seed="1"), blow(100, seed="2"))


def test_calm():
    assert parameters(GustSigma(0.0)).is_calm
    assert not parameters(GustSigma(0.1)).is_calm
    assert not parameters(GustLevel("light")).is_calm
    assert not parameters(GustSigma(0.0), speed=1.0).is_calm
