# SPDX-License-Identifier: MIT
"""Linear responses to held commands, discretised exactly on a uniform grid."""

import math
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

GRID = 0.005  # [s] step of the grid that responses are computed on
LONGEST_DEAD_TIME = 0.4  # [s]
_SHORTEST_LAG = 1e-6  # [s] below, there is none


class Order(NamedTuple):
    """A kind of response: gain first, dead time last, its shape between."""

    names: Tuple[str, ...]
    lower: Tuple[float, ...]
    upper: Tuple[float, ...]
    typical: Tuple[float, ...]
    shapes: Tuple[Tuple[float, ...], ...]  # where a search begins


SECOND = Order(
    names=("gain", "omega", "zeta", "dead_time_s"),
    lower=(0.01, 0.5, 0.1, 0.0),
    upper=(3.0, 60.0, 4.0, LONGEST_DEAD_TIME),
    typical=(1.0, 10.0, 1.0, 0.1),
    shapes=((4.0, 0.8), (10.0, 0.8), (20.0, 0.8), (8.0, 2.0)),
)
FIRST = Order(
    names=("gain", "time_constant_s", "dead_time_s"),
    lower=(0.01, 0.005, 0.0),
    upper=(3.0, 3.0, LONGEST_DEAD_TIME),
    typical=(1.0, 0.1, 0.1),
    shapes=((0.05,), (0.1,), (0.25,), (0.6,)),
)


def held_mean(times: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the mean of held values in each interval of a grid.

    Exact to second order for any change of the values between the points of the grid.

    Args:
        times: (c,) [s] from when on each value holds.
        values: (c, k)
        grid: (m + 1,) [s] within or after ``times``.

    Returns:
        (m, k)
    """
    edges = np.append(times, max(times[-1], grid[-1]) + 1.0)
    areas = np.diff(edges)[:, None] * values
    integral = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(areas, axis=0)])
    at_grid = np.stack([np.interp(grid, edges, column) for column in integral.T], axis=1)
    return np.diff(at_grid, axis=0) / np.diff(grid)[:, None]


def lagged_mean(times: np.ndarray, values: np.ndarray, grid: np.ndarray, lag: float) -> np.ndarray:
    """Return the mean in each interval of a grid of held values behind a first-order lag.

    Exact for values that change at any moment; before the first one, it had settled on that.

    Args:
        times: (c,) [s] from when on each value holds.
        values: (c,)
        grid: (m + 1,) [s] within or after ``times``.
        lag: [s] time constant; 0: none.

    Returns:
        (m,)
    """
    mean = held_mean(times, values[:, None], grid)[:, 0]
    if lag < _SHORTEST_LAG:
        return mean
    state, states = values[0], [values[0]]
    for value, decay in zip(values.tolist(), np.exp(-np.diff(times) / lag).tolist()):
        state = value + decay * (state - value)
        states.append(state)
    held = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, None)
    since = np.maximum(grid - times[held], 0.0)
    at_grid = values[held] + np.exp(-since / lag) * (np.array(states)[held] - values[held])
    # lag y' = u - y, integrated over an interval
    return mean - lag * np.diff(at_grid) / np.diff(grid)


def respond(order: Order, shape: Sequence[float], u: np.ndarray) -> np.ndarray:
    """Return the response (m + 1,) of unit gain at the grid's points, at rest before it.

    Args:
        order: kind of response.
        shape: omega [rad/s] and zeta, or the time constant [s].
        u: (m,) input, held in each interval of the grid.
    """
    numerator, denominator = _second(*shape) if order is SECOND else _first(*shape)
    start = u[0]
    return start + lfilter(numerator, denominator, np.append(u, u[-1]) - start)


def _first(time_constant: float) -> Tuple[List[float], List[float]]:
    """Return numerator and denominator of the held first-order response in powers of 1/z."""
    decay = math.exp(-GRID / time_constant)
    return [0.0, 1.0 - decay], [1.0, -decay]


def _second(omega: float, zeta: float) -> Tuple[List[float], List[float]]:
    """Return the same of the second-order response, from the exponential of its state matrix."""
    augmented = np.array(
        [[0.0, 1.0, 0.0], [-(omega**2), -2.0 * zeta * omega, omega**2], [0.0, 0.0, 0.0]]
    )
    step = expm(GRID * augmented)
    (a11, a12, b1), (a21, a22, b2) = step[:2]
    return [0.0, b1, a12 * b2 - a22 * b1], [1.0, -a11 - a22, a11 * a22 - a12 * a21]
