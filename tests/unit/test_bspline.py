# SPDX-License-Identifier: MIT
"""B-splines against what follows from their definition."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from nmpc_control.bspline import BSpline
from nmpc_control.curves import ArcLength, CurveError, circle, lemniscate

POINTS = np.array([[0.0, 0, 1], [2, 2, 2], [4, -2, 3], [6, 3, 2], [8, 0, 1], [9, 4, 4], [12, 5, 0]])
S = np.linspace(0.0, 1.0, 401)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("knots", ["uniform", "chord", "centripetal"])
def test_interpolation_passes_through_every_point_at_its_parameter(degree: int, knots: str) -> None:
    curve = BSpline.interpolate(POINTS, degree, knots)
    exponent = {"uniform": 0.0, "chord": 1.0, "centripetal": 0.5}[knots]
    steps = np.linalg.norm(np.diff(POINTS, axis=0), axis=1) ** exponent
    sites = np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])
    assert np.allclose(curve(sites), POINTS, atol=1e-9)


def test_interpolation_on_an_explicit_knot_vector_passes_at_its_greville_abscissae() -> None:
    knots = [0, 0, 0, 0, 3, 4, 9, 10, 10, 10, 10]
    curve = BSpline.interpolate(POINTS, 3, knots)
    sites = [sum(knots[i + 1 : i + 4]) / 30.0 for i in range(len(POINTS))]
    assert np.allclose(curve(sites), POINTS, atol=1e-9)
    assert np.allclose(curve.breaks, [0.0, 0.3, 0.4, 0.9, 1.0])


def test_natural_ends_do_not_bend_and_three_points_suffice() -> None:
    points = np.array([[0.0, 0, 3], [0, 5, 3], [5, 5, 3]])
    curve = BSpline.interpolate(points, 3, ends="natural")
    assert np.allclose(curve([0.0, 0.5, 1.0]), points)
    assert np.allclose(curve([0.0, 1.0], 2), 0.0, atol=1e-9)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_a_polynomial_of_the_degree_is_reproduced(degree: int) -> None:
    def polynomial(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s)
        return np.stack([1.0 + s**degree, s, 2.0 - 3.0 * s**degree], axis=1)

    curve = BSpline.interpolate(polynomial(np.linspace(0, 1, 7)), degree)
    sites = S if degree > 1 else S[:: len(S) // 6]
    assert np.allclose(curve(sites), polynomial(sites), atol=1e-9)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize("knots", ["uniform", "chord", "centripetal"])
def test_basis_functions_are_a_partition_of_unity(degree: int, knots: str) -> None:
    curve = BSpline.approximate(POINTS, degree, knots)
    basis = BSpline(curve.knots, np.eye(len(POINTS)), degree)(S)
    assert np.allclose(basis.sum(axis=1), 1.0)
    assert basis.min() >= -1e-12
    assert np.count_nonzero(basis > 1e-12, axis=1).max() <= degree + 1


@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("knots", ["uniform", "chord", "centripetal"])
def test_approximation_stays_in_the_hull_and_off_the_inner_points(degree: int, knots: str) -> None:
    curve = BSpline.approximate(POINTS, degree, knots)
    hull = ConvexHull(POINTS).equations
    assert (curve(S) @ hull[:, :3].T + hull[:, 3] <= 1e-9).all()
    assert np.allclose(curve([0.0, 1.0]), POINTS[[0, -1]])
    for point in POINTS[1:-1]:
        assert np.linalg.norm(curve(S) - point, axis=1).min() > 0.1


def test_quadratic_bezier_is_the_textbook_one() -> None:
    curve = BSpline.approximate([[0.0, 0, 0], [1, 2, 0], [2, 0, 0]], 2)
    expected = np.stack([2 * S, 4 * S * (1 - S), 0 * S], axis=1)
    assert np.allclose(curve(S), expected)
    assert np.allclose(curve(S, 1), np.stack([2 + 0 * S, 4 - 8 * S, 0 * S], axis=1))


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_derivatives_match_finite_differences(degree: int) -> None:
    curve = BSpline.interpolate(POINTS, degree, "chord")
    s, h = np.linspace(0.01, 0.99, 97), 1e-6
    s = s[np.abs(s[:, None] - curve.breaks).min(axis=1) > 1e-4]
    for order in (1, 2):
        difference = (curve(s + h, order - 1) - curve(s - h, order - 1)) / (2 * h)
        assert np.allclose(curve(s, order), difference, rtol=1e-4, atol=1e-4)


def test_a_polyline_turns_at_its_corners_and_derivatives_are_those_to_the_right() -> None:
    curve = BSpline.interpolate([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], 1)
    assert np.allclose(curve([0.25, 0.5, 1.0], 1), [[2, 0, 0], [0, 2, 0], [0, 2, 0]])
    assert np.allclose(curve(S, 2), 0.0)
    assert curve.length == pytest.approx(2.0)


@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("make", [BSpline.interpolate, BSpline.approximate])
def test_closed_curves_return_smoothly(degree: int, make: object) -> None:
    curve = make(POINTS, degree, closed=True)
    for order in range(degree):
        assert np.allclose(curve([0.0], order), curve([1.0], order), atol=1e-6)


def test_a_closed_interpolation_passes_through_all_points_and_back() -> None:
    curve = BSpline.interpolate(POINTS, 3, closed=True)
    sites = np.linspace(0, 1, len(POINTS) + 1)
    assert np.allclose(curve(sites), np.vstack([POINTS, POINTS[:1]]), atol=1e-9)


def test_fit_finds_the_curve_that_made_the_points() -> None:
    made = BSpline.approximate(POINTS, 3)
    found = BSpline.fit(made(np.linspace(0, 1, 60)), control_points=7, degree=3)
    assert np.allclose(found.control_points, POINTS, atol=1e-8)


def test_fit_averages_noise_and_keeps_the_ends() -> None:
    rng = np.random.default_rng(1)
    line = np.linspace([0.0, 0, 0], [10.0, 0, 0], 200)
    noisy = line + rng.normal(0.0, 0.1, line.shape)
    curve = BSpline.fit(noisy, control_points=4, degree=3)
    assert np.allclose(curve([0.0, 1.0]), noisy[[0, -1]])
    assert np.sqrt(np.mean(curve(S)[:, 1:] ** 2)) < 0.05


@pytest.mark.parametrize("radius", [0.5, 3.2])
def test_length_of_a_circle_and_its_inverse(radius: float) -> None:
    arc = ArcLength(circle([1.0, 2, 3], radius))
    assert arc.total == pytest.approx(2 * math.pi * radius, rel=1e-12)
    assert np.allclose(arc.parameter(S * arc.total), S, atol=1e-12)


def test_length_of_a_parabola_is_the_closed_form() -> None:
    curve = BSpline.approximate([[0.0, 0, 0], [0.5, 0, 0], [1.0, 1.0, 0]], 2)  # y = x^2
    assert curve.length == pytest.approx(math.sqrt(5) / 2 + math.asinh(2.0) / 4, rel=1e-9)


@pytest.mark.parametrize("knots", ["uniform", "chord"])
def test_parameter_of_a_length_inverts_the_length(knots: str) -> None:
    arc = ArcLength(BSpline.interpolate(POINTS, 3, knots))
    lengths = S * arc.total
    assert np.allclose(arc.at(arc.parameter(lengths)), lengths, atol=1e-7)
    assert arc.parameter([-1.0, 1e9]).tolist() == [0.0, 1.0]


def test_figure_eight_crosses_its_center_with_the_given_size() -> None:
    points = lemniscate([0.0, 0, 2], 2.5, 1.0)(S)
    a = 2 * math.pi * S
    expected = np.stack([2.5 * np.sin(a), 2.5 * np.sin(a) * np.cos(a), 2 + np.cos(a)], axis=1)
    assert np.allclose(points, expected)


CLAMPED = [0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: BSpline.interpolate(POINTS[:3], 3),
            "degree: got 3, expected a whole number in [1, 2]",
        ),
        (lambda: BSpline.approximate(POINTS, 7), "degree: got 7"),
        (lambda: BSpline.interpolate(POINTS, 0), "degree: got 0"),
        (lambda: BSpline.interpolate(POINTS, 2.5), "degree: got 2.5"),
        (lambda: BSpline.interpolate(POINTS[:1], 1), "two points or more"),
        (lambda: BSpline.interpolate([], 1), "two points or more"),
        (lambda: BSpline.interpolate([[0, 0, 0], [1, 1]], 1), "points"),
        (lambda: BSpline.interpolate([[0, 0, 0], [1, math.nan, 1]], 1), "points[1]"),
        (lambda: BSpline.interpolate([[0, 0, 0], [0, 0, 0], [1, 1, 1]], 2), "points[1]"),
        (lambda: BSpline.approximate(POINTS[[0, 0, 1, 2]], 3, "chord"), "points[1]"),
        (lambda: BSpline.interpolate(POINTS, 3, "equal"), "knots: got 'equal'"),
        (lambda: BSpline.interpolate(POINTS, 3, CLAMPED[:-1]), "11 numbers"),
        (lambda: BSpline.interpolate(POINTS, 3, CLAMPED[::-1]), "never fall"),
        (lambda: BSpline.interpolate(POINTS, 3, [0, 0, 0, 1, *CLAMPED[4:]]), "clamped"),
        (lambda: BSpline.interpolate(POINTS, 2, [0, 0, 0, 1, 1, 1, 2, 4, 4, 4]), "at most 2 times"),
        (lambda: BSpline.interpolate(POINTS, 3, ["a"] * 11), "knots"),
        (lambda: BSpline.interpolate(POINTS, 3, CLAMPED, closed=True), "knots"),
        (lambda: BSpline.interpolate(POINTS, 2, ends="natural"), "ends"),
        (lambda: BSpline.approximate(POINTS, 3, "chord", closed=True), "closed"),
        (lambda: BSpline.fit(POINTS, 8), "control_points: got 8"),
        (lambda: BSpline.fit(POINTS, 3), "degree: got 3"),
    ],
)
def test_bad_input_is_a_named_error(call: object, words: str) -> None:
    with pytest.raises(CurveError) as caught:
        call()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
