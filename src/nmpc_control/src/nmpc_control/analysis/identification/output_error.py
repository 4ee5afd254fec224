# SPDX-License-Identifier: MIT
"""Output-error fit of responses: simulated from the commands alone, compared with what followed."""

from dataclasses import dataclass
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.optimize import least_squares

from nmpc_control.analysis.identification.confidence import BLOCK, block_covariance
from nmpc_control.analysis.identification.passages import Passage
from nmpc_control.analysis.identification.response import GRID, LONGEST_DEAD_TIME, Order

LIMITS = (0.02, 1.5)  # [rad] of the tilt limit
_DEAD_TIMES = np.arange(0.0, LONGEST_DEAD_TIME, 0.03)  # [s] where a search begins
_LIMIT_SHARES = (0.3, 0.5, 0.7, 0.9, 1.1)  # of the largest command
_STEP = 1e-4  # of shapes (relative) and of the limit [rad], for derivatives
_OUTLIER = 0.03  # [rad] residuals beyond this lose weight in a robust fit


@dataclass(frozen=True)
class ResponseModel:
    """Which numbers are fitted: gain, shape and dead time of each axis, and a common limit."""

    order: Order
    axes: int
    has_limit: bool = False
    shares_dead_time: bool = False

    def unpack(self, p: np.ndarray) -> Tuple[np.ndarray, float]:
        """Return the axes' parameters (axes, k) in the order's names, and the limit."""
        limit = float(p[-1]) if self.has_limit else np.inf
        p = p[:-1] if self.has_limit else p
        if not self.shares_dead_time:
            return p.reshape(self.axes, -1), limit
        rows = p[:-1].reshape(self.axes, -1)
        return np.column_stack([rows, np.full(self.axes, p[-1])]), limit

    def bounds(self) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return lower bounds, upper bounds and typical sizes of the fitted parameters."""
        order = self.order
        rows = [np.tile(b, (self.axes, 1)) for b in (order.lower, order.upper, order.typical)]
        low, high, typical = (self._pack(r, x) for r, x in zip(rows, (*LIMITS, 0.5)))
        return low, high, typical

    def _pack(self, rows: np.ndarray, limit: float) -> np.ndarray:
        p = rows.ravel()
        if self.shares_dead_time:
            p = np.append(rows[:, :-1].ravel(), rows[:, -1].mean())
        return np.append(p, limit) if self.has_limit else p

    def start(self, passages: Sequence[Passage]) -> np.ndarray:
        """Return where to begin: the best of a grid, with the gains that fit best."""
        largest = max(np.linalg.norm(passage.commands, axis=1).max() for passage in passages)
        limits = [largest * share for share in _LIMIT_SHARES] if self.has_limit else [np.inf]
        best, chosen = np.inf, None
        for limit in limits:
            inputs = [passage.inputs(limit) for passage in passages]
            for shape in self.order.shapes:
                outputs = [
                    [p.outputs(self.order, shape, u[:, axis]) for axis in range(self.axes)]
                    for p, u in zip(passages, inputs)
                ]
                for dead_time in _DEAD_TIMES:
                    gains, cost = _best_gains(passages, outputs, dead_time)
                    if cost < best:
                        rows = np.column_stack(
                            [gains, np.tile([*shape, dead_time], (self.axes, 1))]
                        )
                        best, chosen = cost, self._pack(rows, limit)
        low, high, _ = self.bounds()
        margin = 1e-3 * (high - low)
        return np.clip(chosen, low + margin, high - margin)

    def simulate(self, p: np.ndarray, passages: Sequence[Passage]) -> List[np.ndarray]:
        """Return the model's samples (n, axes) for each passage."""
        rows, limit = self.unpack(p)
        found = []
        for passage in passages:
            inputs = passage.inputs(limit)
            columns = [
                gain * passage.sample(passage.outputs(self.order, shape, u), dead_time)
                for (gain, *shape, dead_time), u in zip(rows, inputs.T)
            ]
            found.append(np.stack(columns, axis=1))
        return found

    def residuals(self, p: np.ndarray, passages: Sequence[Passage]) -> np.ndarray:
        """Return model less measurement, all samples and axes in a row."""
        pairs = zip(self.simulate(p, passages), passages)
        return np.concatenate([(model - passage.values).ravel() for model, passage in pairs])

    def jacobian(self, p: np.ndarray, passages: Sequence[Passage]) -> np.ndarray:
        """Return the derivative (n * axes, parameters) of the residuals."""
        rows, limit = self.unpack(p)
        parts = []
        for passage in passages:
            inputs = passage.inputs(limit)
            beyond = passage.inputs(limit + _STEP) if self.has_limit else inputs
            part = np.zeros((len(passage.times), self.axes, len(p)))
            for axis, row in enumerate(rows):
                derivative = self._derivative(passage, row, inputs[:, axis], beyond[:, axis])
                columns = self._columns(axis, len(p))
                part[:, axis, columns] = derivative[:, : len(columns)]
            parts.append(part.reshape(-1, len(p)))
        return np.concatenate(parts)

    def _columns(self, axis: int, size: int) -> List[int]:
        """Return where an axis's parameters, and the limit, are among all."""
        count = len(self.order.names)
        if self.shares_dead_time:
            own = [axis * (count - 1) + i for i in range(count - 1)]
            own.append(self.axes * (count - 1))
        else:
            own = [axis * count + i for i in range(count)]
        return [*own, size - 1] if self.has_limit else own

    def _derivative(
        self, passage: Passage, row: np.ndarray, u: np.ndarray, beyond: np.ndarray
    ) -> np.ndarray:
        """Return the derivative (n, k + 1) of one axis by its own parameters and the limit."""
        gain, shape, dead_time = row[0], row[1:-1], row[-1]
        output = passage.outputs(self.order, shape, u)
        y = passage.sample(output, dead_time)
        columns = [y]
        for i in range(len(shape)):
            other = shape.copy()
            other[i] *= 1.0 + _STEP
            moved = passage.sample(passage.outputs(self.order, other, u), dead_time)
            columns.append(gain * (moved - y) / (other[i] - shape[i]))
        ends = (passage.sample(output, dead_time + side * GRID / 2.0) for side in (1.0, -1.0))
        columns.append(gain * np.subtract(*ends) / GRID)
        moved = passage.sample(passage.outputs(self.order, shape, beyond), dead_time)
        columns.append(gain * (moved - y) / _STEP)
        return np.stack(columns, axis=1)


class Fit(NamedTuple):
    """A fitted model."""

    model: ResponseModel
    parameters: np.ndarray
    jacobian: np.ndarray
    residuals: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        """Parameters of each axis (axes, k)."""
        return self.model.unpack(self.parameters)[0]

    @property
    def limit(self) -> float:
        """Limit of the commands' norm; inf where none is fitted."""
        return self.model.unpack(self.parameters)[1]

    def covariance(self, passages: Sequence[Passage]) -> Optional[Tuple[np.ndarray, int]]:
        """Return the parameters' covariance and the number of independent blocks behind it."""
        blocks = [np.repeat(p.blocks(BLOCK), self.model.axes) for p in passages]
        return block_covariance(self.jacobian, self.residuals, np.concatenate(blocks))


def fit(
    model: ResponseModel,
    passages: Sequence[Passage],
    start: Optional[np.ndarray] = None,
    is_robust: bool = False,
) -> Fit:
    """Return the model that fits best.

    Args:
        model: what is fitted.
        passages: at least one, with samples.
        start: parameters to begin with; None: searched.
        is_robust: samples that do not follow at all count little.
    """
    low, high, typical = model.bounds()
    first = model.start(passages) if start is None else np.clip(start, low, high)
    result = least_squares(
        model.residuals,
        first,
        jac=model.jacobian,
        bounds=(low, high),
        x_scale=typical,
        args=(passages,),
        loss="soft_l1" if is_robust else "linear",
        f_scale=_OUTLIER,
        xtol=1e-6,
        ftol=1e-8,
        max_nfev=60,
        tr_solver="lsmr",  # of few columns: a decomposition would only keep threads waiting
    )
    return Fit(model, result.x, result.jac, result.fun)


def fit_percent(measured: np.ndarray, model: np.ndarray) -> Optional[float]:
    """Return 100 (1 - |y - model| / |y - mean(y)|); None where the measurement is constant."""
    spread = np.linalg.norm(measured - measured.mean())
    return float(100.0 * (1.0 - np.linalg.norm(measured - model) / spread)) if spread else None


def fit_percents(
    model: ResponseModel, p: np.ndarray, passages: Sequence[Passage]
) -> List[Optional[float]]:
    """Return the fit [percent] of each axis over all passages."""
    simulated = np.concatenate(model.simulate(p, passages))
    measured = np.concatenate([passage.values for passage in passages])
    return [fit_percent(y, m) for y, m in zip(measured.T, simulated.T)]


def _best_gains(
    passages: Sequence[Passage], outputs: Sequence[List[np.ndarray]], dead_time: float
) -> Tuple[np.ndarray, float]:
    """Return the gain of each axis, and the sum of squares that is left with them."""
    gains, cost = [], 0.0
    for axis in range(len(outputs[0])):
        y = np.concatenate([passage.values[:, axis] for passage in passages])
        x = np.concatenate([p.sample(o[axis], dead_time) for p, o in zip(passages, outputs)])
        power = x @ x
        gain = float(np.clip(x @ y / power, 0.0, 3.0)) if power > 0.0 else 1.0
        gains.append(gain)
        cost += float(np.sum((y - gain * x) ** 2))
    return np.array(gains), cost
