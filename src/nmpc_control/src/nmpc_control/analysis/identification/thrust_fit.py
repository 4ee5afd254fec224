# SPDX-License-Identifier: MIT
"""Fit of the thrust map together with how late thrust is: a dead time, and a lag of the rotors.

    u'(t) = (percent(t - d) - u(t)) / lag

Slope and offset are linear and solved for each pair of dead time d and lag. A lag taken for dead
time makes the slope too small, by what the lag smooths of the thrust, and the offset too large.
"""

from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from nmpc_control.analysis.identification.confidence import BLOCK, block_covariance
from nmpc_control.analysis.identification.response import LONGEST_DEAD_TIME
from nmpc_control.analysis.identification.robust import LinearFit, trimmed_least_squares
from nmpc_control.analysis.identification.translation import Motion

VERTICAL = "vertical"
PER_CHARGE = "offset_per_charge"
LONGEST_LAG = 0.2  # [s] a stretch begins with a settled thrust, which it takes twice as long to be
_SCAN = np.arange(0.0, LONGEST_DEAD_TIME + 1e-9, 0.02)  # [s]
_LAGS = (0.01, 0.03, 0.06, 0.1, 0.15)  # [s] where a search begins
_EARLIEST = -0.005  # [s] of a dead time beside a lag, which must not take what stamps are late
_STEP = 0.005  # [s] of derivatives


class Late(NamedTuple):
    """How thrust follows its command."""

    dead_time: float  # [s]
    lag: float = 0.0  # [s] time constant of first order


class Terms(NamedTuple):
    """What is fitted beside slope and offset."""

    has_drag: bool
    charge: Optional[float]  # [percent] at which the offset is stated; None: it does not move

    @property
    def names(self) -> Tuple[str, ...]:
        """Names of the linear parameters."""
        drag = (VERTICAL,) if self.has_drag else ()
        return ("slope", "offset", *drag, *(() if self.charge is None else (PER_CHARGE,)))


class ThrustProblem:
    """Vertical motion of some stretches, against what thrust and drag make of the commands."""

    def __init__(self, motions: Sequence[Motion], target: np.ndarray, terms: Terms) -> None:
        """Keep what is fitted; ``target`` (w,) [m/s^2] is vertical acceleration and gravity."""
        self._motions, self._target, self._terms = motions, target, terms

    def columns(self, late: Late) -> np.ndarray:
        """Return what the linear parameters multiply (w, p)."""
        rows = []
        for motion in self._motions:
            up = motion.up[:, 2]
            parts = [motion.percent(*late) * up, up]
            if self._terms.has_drag:
                parts.append(-motion.speed[:, 2])
            row = motion.mean(np.stack(parts, axis=1))
            if self._terms.charge is not None:
                charge = motion.level - self._terms.charge
                row = np.column_stack([row, motion.mean(up) * charge])
            rows.append(row)
        return np.concatenate(rows)

    def solve(self, late: Late) -> LinearFit:
        """Return the linear parameters for a dead time and a lag."""
        return trimmed_least_squares(self.columns(late), self._target)

    def _left(self, late: Late, used: np.ndarray) -> np.ndarray:
        """Return the residuals of some windows under their own best linear parameters."""
        columns, target = self.columns(late)[used], self._target[used]
        return target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]

    def best_dead_time(self) -> Tuple[Late, LinearFit]:
        """Return the dead time alone that fits best, and the fit with it."""

        def cost(dead_time: float) -> float:
            return float(np.median(np.abs(self.solve(Late(dead_time)).residuals)))

        begin = float(min(_SCAN, key=cost))
        used = self.solve(Late(begin)).used

        def trimmed_cost(dead_time: float) -> float:
            return float(np.sum(self._left(Late(dead_time), used) ** 2))

        bounds = (max(0.0, begin - 0.04), min(LONGEST_DEAD_TIME, begin + 0.04))
        best = minimize_scalar(trimmed_cost, bounds=bounds, method="bounded")
        late = Late(float(best.x))
        return late, self.solve(late)

    def with_lag(self, alone: Late, used: np.ndarray) -> Tuple[Late, LinearFit]:
        """Return the dead time and lag that fit best together, and the fit with them.

        Args:
            alone: the best dead time without a lag.
            used: (w,) windows that count.
        """
        starts = [Late(max(0.0, alone.dead_time - lag), lag) for lag in _LAGS]
        begin = min(starts, key=lambda late: float(np.sum(self._left(late, used) ** 2)))
        bottom, top = np.array([_EARLIEST, 0.0]), np.array([LONGEST_DEAD_TIME, LONGEST_LAG])
        found = least_squares(
            lambda x: self._left(Late(*x), used),
            np.clip(begin, bottom + 1e-3, top - 1e-3),
            bounds=(bottom, top),
            x_scale=0.02,
        )
        late = Late(*map(float, found.x))
        return late, self.solve(late)

    def covariance(
        self, late: Late, found: LinearFit, has_lag: bool
    ) -> Optional[Tuple[np.ndarray, int]]:
        """Return the covariance of the linear parameters, the dead time and the lag if any."""
        jacobian = [self.columns(late)]
        for name in late._fields[: 1 + has_lag]:
            value = getattr(late, name)
            below = min(_STEP, value) if name == "lag" else _STEP
            later = self.columns(late._replace(**{name: value + _STEP}))
            earlier = self.columns(late._replace(**{name: value - below}))
            jacobian.append((later - earlier) @ found.parameters / (_STEP + below))
        blocks = np.concatenate([motion.blocks(BLOCK) for motion in self._motions])
        used = found.used
        whole = -np.column_stack(jacobian)
        return block_covariance(whole[used], found.residuals[used], blocks[used])
