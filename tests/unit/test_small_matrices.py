"""Written-out linear algebra against numpy."""

import casadi as ca
import numpy as np
import pytest

from nmpc_control.small_matrices import (
    cholesky,
    forward_substitution,
    pack_symmetric,
    solve,
    unpack_symmetric,
)


def evaluate(expression, symbols, values):
    return np.asarray(ca.Function("f", symbols, [expression])(*values))


def positive_matrix(n: int, seed: int) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(n, n))
    return root @ root.T + np.eye(n)


@pytest.mark.parametrize("n", [1, 2, 4, 7])
def test_cholesky_and_solve_agree_with_numpy(n):
    M, b = ca.SX.sym("M", n, n), ca.SX.sym("b", n, 3)
    values = positive_matrix(n, seed=n), np.random.default_rng(n).normal(size=(n, 3))
    L, pivots = cholesky(M)
    factor = evaluate(L, [M], values[:1])
    assert factor == pytest.approx(np.linalg.cholesky(values[0]))
    assert evaluate(ca.vertcat(*pivots), [M], values[:1]).ravel() == pytest.approx(
        np.diag(factor) ** 2
    )
    assert evaluate(solve(L, b), [M, b], values) == pytest.approx(np.linalg.solve(*values))
    assert evaluate(forward_substitution(L, b), [M, b], values) == pytest.approx(
        np.linalg.solve(factor, values[1])
    )


def test_the_least_pivot_shows_an_indefinite_matrix():
    M = ca.SX.sym("M", 2, 2)
    _, pivots = cholesky(M)
    values = evaluate(ca.vertcat(*pivots), [M], [np.array([[1.0, 2.0], [2.0, 1.0]])])
    assert values.min() == pytest.approx(-3.0)


@pytest.mark.parametrize("n", [1, 3, 14])
def test_packing_keeps_every_element(n):
    P = ca.SX.sym("P", n, n)
    matrix = positive_matrix(n, seed=n)
    packed = pack_symmetric(P)
    assert packed.shape == (n * (n + 1) // 2, 1)
    assert evaluate(unpack_symmetric(packed, n), [P], [matrix]) == pytest.approx(matrix)
