# SPDX-License-Identifier: MIT
"""B-spline curves of any degree on knots of choice (paper, "Path Representation with B-splines").

The parameter runs from 0 to 1. A named spacing puts point i at parameter u_i, where u grows by the
same amount (``uniform``), by the distance (``chord``) or by its square root (``centripetal``) from
point to point. An explicit knot vector has ``n + degree + 1`` values and is clamped: the first and
the last are repeated ``degree + 1`` times.
"""

from typing import Sequence, Union

import numpy as np
from scipy import interpolate

from nmpc_control.curves import ArcLength, CurveError

SPACINGS = {"uniform": 0.0, "chord": 1.0, "centripetal": 0.5}  # exponent of the distance
ENDS = ("not_a_knot", "natural")

Knots = Union[str, Sequence[float]]


class BSpline:
    """Curve ``c(s) = sum_i N_i(s) P_i``; columns beyond the third carry more than a position."""

    def __init__(self, knots: np.ndarray, control_points: np.ndarray, degree: int) -> None:
        self.knots = np.array(knots, float)  # (n + degree + 1,)
        self.control_points = np.array(control_points, float)  # (n, d)
        self.degree = degree
        self._spline = interpolate.BSpline(self.knots, self.control_points, degree)
        inner = self.knots[degree : len(self.knots) - degree]
        self.breaks = np.unique(np.clip(inner, 0.0, 1.0))

    def __call__(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return the point or derivative (M, d) at parameters s (M,), clipped to [0, 1]."""
        return self._spline(np.clip(np.atleast_1d(s), 0.0, 1.0), derivative)

    @property
    def length(self) -> float:
        """Arc length [m] over the first three columns."""
        return ArcLength(self.columns(0, 3)).total

    def columns(self, first: int, last: int) -> "BSpline":
        """Return the curve of some columns of the points, on the same knots."""
        return BSpline(self.knots, self.control_points[:, first:last], self.degree)

    @classmethod
    def interpolate(
        cls,
        points: np.ndarray,
        degree: int = 3,
        knots: Knots = "uniform",
        ends: str = "not_a_knot",
        closed: bool = False,
    ) -> "BSpline":
        """Return the curve through all points (n, d).

        Args:
            points: (n, d) [m].
            degree: 1 (a polyline) or more.
            knots: a spacing, or a clamped knot vector with the points at its Greville abscissae.
            ends: what replaces the missing conditions of a spacing: ``not_a_knot``, or ``natural``
                (no bending at the ends; degree 3 only, and three points are enough).
            closed: return smoothly to the first point; only with a spacing.

        Raises:
            CurveError: naming what does not fit.
        """
        points = _checked_points(points)
        if ends not in ENDS or (ends == "natural" and degree != 3):
            raise CurveError("ends", ends, "not_a_knot, or natural with degree 3")
        if closed and not np.array_equal(points[0], points[-1]):
            points = np.vstack([points, points[:1]])
        _check_degree(degree, 4 if ends == "natural" and len(points) == 3 else len(points))
        repeated = np.flatnonzero(np.all(np.diff(points[:, :3], axis=0) == 0.0, axis=1))
        if len(repeated):
            raise _same(points, repeated[0])
        if not isinstance(knots, str):
            if closed or ends != "not_a_knot":
                raise CurveError(
                    "knots", knots, "a spacing where the curve is closed or its ends are natural"
                )
            vector = _checked_knots(knots, len(points), degree)
            sites = _greville(vector, degree)
            return cls(vector, _solve(_basis(vector, degree, sites), points), degree)
        condition = "natural" if ends == "natural" else None
        if closed and degree > 1:
            condition = "periodic"
        sites = _sites(points, knots)
        vector = _not_a_knot(sites, degree) if condition is None else None
        spline = interpolate.make_interp_spline(sites, points, degree, vector, condition)
        return cls(spline.t, spline.c, degree)

    @classmethod
    def approximate(
        cls, points: np.ndarray, degree: int = 3, knots: Knots = "uniform", closed: bool = False
    ) -> "BSpline":
        """Return the curve with control points (n, d), from the first to the last.

        Raises:
            CurveError: naming what does not fit.
        """
        points = _checked_points(points)
        _check_degree(degree, len(points))
        if not closed:
            return cls(_knot_vector(points, knots, len(points), degree), points, degree)
        if knots != "uniform":
            raise CurveError("knots", knots, "uniform where an approximating curve is closed")
        n = len(points)
        return cls(
            (np.arange(n + 2 * degree + 1) - degree) / n,
            np.vstack([points, points[:degree]]),
            degree,
        )

    @classmethod
    def fit(
        cls, points: np.ndarray, control_points: int, degree: int = 3, knots: Knots = "uniform"
    ) -> "BSpline":
        """Return the least-squares curve with fewer control points, exact at both ends.

        Raises:
            CurveError: naming what does not fit.
        """
        points = _checked_points(points)
        _check_degree(degree, control_points)
        if control_points > len(points):
            raise CurveError(
                "control_points", control_points, f"at most the number of points, {len(points)}"
            )
        vector = _knot_vector(points, knots, control_points, degree)
        sites = _sites(points, knots if isinstance(knots, str) else "uniform")
        basis = _basis(vector, degree, sites)
        control = np.zeros((control_points, points.shape[1]))
        control[0], control[-1] = points[0], points[-1]
        rest = points - basis @ control
        control[1:-1] = _solve(basis[1:-1, 1:-1], rest[1:-1])
        return cls(vector, control, degree)


def _checked_points(points: np.ndarray) -> np.ndarray:
    try:
        array = np.array(points, float)
    except (TypeError, ValueError):
        raise CurveError("points", points, "rows of equally many numbers") from None
    if array.ndim != 2 or len(array) < 2:
        raise CurveError("points", array.tolist(), "two points or more")
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise CurveError(f"points[{row}]", array[row].tolist(), "finite numbers")
    return array


def _check_degree(degree: int, n: int) -> None:
    if (
        isinstance(degree, bool)
        or not isinstance(degree, (int, np.integer))
        or not 1 <= degree <= n - 1
    ):
        raise CurveError("degree", degree, f"a whole number in [1, {n - 1}] for {n} points")


def _same(points: np.ndarray, row: int) -> CurveError:
    return CurveError(
        f"points[{row + 1}]", points[row + 1, :3].tolist(), "another point than the one before"
    )


def _checked_knots(knots: Sequence[float], n: int, degree: int) -> np.ndarray:
    """Return a clamped knot vector scaled to [0, 1]."""
    try:
        vector = np.array(knots, float)
    except (TypeError, ValueError):
        raise CurveError("knots", knots, f"{', '.join(SPACINGS)} or a list of numbers") from None
    if vector.shape != (n + degree + 1,):
        raise CurveError(
            "knots", knots, f"{n + degree + 1} numbers for {n} points of degree {degree}"
        )
    if not np.isfinite(vector).all() or (np.diff(vector) < 0).any() or vector[0] == vector[-1]:
        raise CurveError("knots", knots, "finite numbers that never fall")
    if vector[degree] != vector[0] or vector[-degree - 1] != vector[-1]:
        raise CurveError(
            "knots", knots, f"the first and the last {degree + 1} to be equal (clamped)"
        )
    most = np.unique(vector[1:-1], return_counts=True)[1].max(initial=0)
    if most > degree:
        raise CurveError(
            "knots", knots, f"inner knots inside the ends, each at most {degree} times"
        )
    return (vector - vector[0]) / (vector[-1] - vector[0])


def _not_a_knot(sites: np.ndarray, degree: int) -> np.ndarray:
    """Return the knots at the inner sites, for even degrees midway (old SciPy: odd only)."""
    inner = sites if degree % 2 else (sites[1:] + sites[:-1]) / 2.0
    cut = (degree + 1) // 2
    ends = np.ones(degree + 1)
    return np.concatenate([sites[0] * ends, inner[cut:-cut], sites[-1] * ends])


def _sites(points: np.ndarray, spacing: str) -> np.ndarray:
    """Return the parameter (n,) of every point."""
    if spacing not in SPACINGS:
        raise CurveError("knots", spacing, f"{', '.join(SPACINGS)} or a list of numbers")
    steps = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1) ** SPACINGS[spacing]
    if (steps == 0.0).any():
        raise _same(points, int(np.argmin(steps)))
    sites = np.concatenate([[0.0], np.cumsum(steps)])
    return sites / sites[-1]


def _knot_vector(points: np.ndarray, knots: Knots, n: int, degree: int) -> np.ndarray:
    """Return the clamped knots for n control points, the inner ones spread like the points."""
    if not isinstance(knots, str):
        return _checked_knots(knots, n, degree)
    sites = _sites(points, knots)
    inner = np.interp(np.linspace(0, 1, n - degree + 1)[1:-1], np.linspace(0, 1, len(sites)), sites)
    return np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])


def _greville(vector: np.ndarray, degree: int) -> np.ndarray:
    windows = [vector[i : len(vector) - degree - 1 + i] for i in range(1, degree + 1)]
    return np.mean(windows, axis=0)


def _basis(vector: np.ndarray, degree: int, sites: np.ndarray) -> np.ndarray:
    """Return the values (m, n) of all basis functions at the sites."""
    return interpolate.BSpline(vector, np.eye(len(vector) - degree - 1), degree)(sites)


def _solve(basis: np.ndarray, values: np.ndarray) -> np.ndarray:
    solution, _, rank, _ = np.linalg.lstsq(basis, values, rcond=None)
    if rank < basis.shape[1]:
        raise CurveError("knots", len(basis), "points in the reach of every control point")
    return solution
