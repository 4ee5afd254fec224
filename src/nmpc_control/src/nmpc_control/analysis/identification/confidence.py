# SPDX-License-Identifier: MIT
"""Intervals of least-squares parameters whose residuals are correlated in time.

Residuals of a flight are far from white: neighbouring samples repeat one another, and intervals
from their number would be several times too narrow. Here the scores are summed over blocks longer
than that correlation, and the spread of the sums gives the covariance (a sandwich estimator with
clusters; Liang and Zeger, Biometrika 73, 1986), with Student's t for the number of blocks.
"""

from typing import Dict, Optional, Sequence, Tuple

import numpy as np
from scipy.stats import t as student

from nmpc_control.analysis.identification.estimate import Interval

BLOCK = 1.0  # [s]
FEWEST_BLOCKS = 5


def block_covariance(
    jacobian: np.ndarray, residuals: np.ndarray, blocks: np.ndarray
) -> Optional[Tuple[np.ndarray, int]]:
    """Return the parameters' covariance (p, p) and the number of blocks.

    Args:
        jacobian: (n, p) of the residuals.
        residuals: (n,)
        blocks: (n,) number of each residual's block, any integers.

    Returns:
        None where there are too few blocks, or the parameters cannot be told apart.
    """
    names, index = np.unique(blocks, return_inverse=True)
    count, size = len(names), jacobian.shape[1]
    if count < max(FEWEST_BLOCKS, size + 2):
        return None
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.isfinite(jacobian).all() or (scale == 0.0).any():
        return None
    columns = jacobian / scale
    information = columns.T @ columns
    if np.linalg.cond(information) > 1e12:
        return None
    scores = np.zeros((count, size))
    np.add.at(scores, index, columns * residuals[:, None])
    bread = np.linalg.inv(information)
    meat = scores.T @ scores * count / (count - 1)
    return bread @ meat @ bread / np.outer(scale, scale), count


def intervals(
    names: Sequence[str], values: Sequence[float], found: Optional[Tuple[np.ndarray, int]]
) -> Dict[str, Optional[Interval]]:
    """Return the 95 % intervals by name; None where there is no covariance."""
    if found is None:
        return dict.fromkeys(names)
    covariance, count = found
    half = student.ppf(0.975, count - 1) * np.sqrt(np.diag(covariance))
    return {n: (float(v - h), float(v + h)) for n, v, h in zip(names, values, half)}


def is_loose(value: float, interval: Optional[Interval], share: float, floor: float = 0.0) -> bool:
    """Return whether an interval reaches further than a share of the value, or a floor."""
    return interval is None or (interval[1] - interval[0]) / 2.0 > max(share * abs(value), floor)
