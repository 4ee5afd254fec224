# SPDX-License-Identifier: MIT
"""Linear least squares without what does not belong: contacts, sensors that jump."""

from typing import NamedTuple

import numpy as np

_TRIM = 8.0  # robust standard deviations: contacts are far beyond, an imperfect model is not
_FLOOR = 0.02  # [m/s^2] smaller residuals are no reason to drop others
_ROUNDS = 10


class LinearFit(NamedTuple):
    """Solution of a trimmed linear least-squares problem."""

    parameters: np.ndarray  # (p,)
    residuals: np.ndarray  # (n,) target less model, of all rows
    used: np.ndarray  # (n,) rows that were not trimmed


def trimmed_least_squares(columns: np.ndarray, target: np.ndarray) -> LinearFit:
    """Return the solution in which rows beyond eight robust standard deviations do not count."""
    used = np.ones(len(target), dtype=bool)
    for _ in range(_ROUNDS):
        parameters = np.linalg.lstsq(columns[used], target[used], rcond=None)[0]
        residuals = target - columns @ parameters
        spread = 1.4826 * np.median(np.abs(residuals[used]))
        chosen = np.abs(residuals) <= _TRIM * max(spread, _FLOOR)
        if chosen.sum() <= len(parameters) or (chosen == used).all():
            break
        used = chosen
    return LinearFit(parameters, residuals, used)


def r_squared(target: np.ndarray, residuals: np.ndarray) -> float:
    """Return the share of the target's variance that is explained."""
    variance = float(np.var(target))
    return 1.0 - float(np.mean(residuals**2)) / variance if variance > 0.0 else float("nan")
