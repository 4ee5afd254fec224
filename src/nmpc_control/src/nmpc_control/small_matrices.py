# SPDX-License-Identifier: MIT
"""Small symmetric matrices written out element by element, so that the generated C has no loops."""

from typing import List, Tuple

import casadi as ca


def pack_symmetric(P: ca.SX) -> ca.SX:
    """Return the upper triangle of a symmetric matrix as one dense column, half the storage."""
    return ca.densify(ca.vertcat(*[P[i, j] for j in range(P.shape[0]) for i in range(j + 1)]))


def unpack_symmetric(half: ca.SX, n: int) -> ca.SX:
    """Return the symmetric matrix (n, n) of a packed upper triangle."""
    P = ca.SX(n, n)
    index = 0
    for j in range(n):
        for i in range(j + 1):
            P[i, j] = half[index]
            P[j, i] = half[index]
            index += 1
    return P


def cholesky(M: ca.SX) -> Tuple[ca.SX, List[ca.SX]]:
    """Return the lower Cholesky factor of a small matrix and its squared pivots."""
    n = M.shape[0]
    L, pivots = ca.SX(n, n), []
    for j in range(n):
        pivots.append(M[j, j] - sum((L[j, i] ** 2 for i in range(j)), ca.SX(0)))
        L[j, j] = ca.sqrt(pivots[j])
        for i in range(j + 1, n):
            L[i, j] = (M[i, j] - sum((L[i, m] * L[j, m] for m in range(j)), ca.SX(0))) / L[j, j]
    return L, pivots


def forward_substitution(L: ca.SX, b: ca.SX) -> ca.SX:
    """Return L^{-1} b."""
    rows: List[ca.SX] = []
    for i in range(L.shape[0]):
        rows.append(
            (b[i, :] - sum((L[i, m] * rows[m] for m in range(i)), ca.SX(1, b.shape[1]))) / L[i, i]
        )
    return ca.vertcat(*rows)


def solve(L: ca.SX, b: ca.SX) -> ca.SX:
    """Return (L L^T)^{-1} b."""
    y = forward_substitution(L, b)
    n = L.shape[0]
    rows: List[ca.SX] = [None] * n
    for i in reversed(range(n)):
        rows[i] = (
            y[i, :] - sum((L[m, i] * rows[m] for m in range(i + 1, n)), ca.SX(1, b.shape[1]))
        ) / L[i, i]
    return ca.vertcat(*rows)
