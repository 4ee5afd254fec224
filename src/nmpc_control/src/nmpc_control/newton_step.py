# SPDX-License-Identifier: MIT
"""What one Newton step says, which model the next one is taken from, and what is left to gain."""

import math
from dataclasses import dataclass
from typing import NamedTuple

_NEWTON_REGION = 0.02  # relative change of the cost below which the exact Hessian is tried
_DAMPING_FIRST, _DAMPING_FACTOR, _DAMPING_LAST = 1e-2, 10.0, 1e6
# a full step is trusted to leave at best this part of what it promised: by the exact Hessian, by
# Gauss-Newton, of which the promise is doubted by a factor, too, as it sees too much curvature
_LEFT_EXACT, _LEFT_GAUSS_NEWTON, _DOUBT = 1e-3, 0.5, 20.0


class Step(NamedTuple):
    """What a backward sweep says of its step."""

    promise: float  # by how much the cost falls by the full step, to second order
    slope: float  # of the cost along the step
    residual: float  # largest projected gradient, scaled by the input ranges
    active: int  # inputs on a bound
    changed: bool  # whether the step takes inputs to a bound or away from one
    exact: bool = False  # whether the model has the exact Hessian
    pivot: float = math.inf  # least of the recursion; not positive: there is no such step

    def descends(self, tolerance: float) -> bool:
        """Whether the step lowers the cost and its model, or there is nothing to lower."""
        return (self.slope < 0.0 and self.promise > 0.0) or self.residual <= tolerance

    @property
    def to_gain(self) -> float:
        """By how much the cost may fall from here."""
        return self.promise * (1.0 if self.exact else _DOUBT)


@dataclass
class StepModel:
    """Which model of the cost the next step is taken from."""

    newton: bool  # the exact Hessian, where it is positive; else Gauss-Newton
    damping: float = 0.0
    refusals: int = 0  # in a row, of the exact Hessian
    pause: int = 0  # iterations without trying it again

    def refused(self) -> None:
        """Let some steps pass before the exact Hessian is tried again."""
        self.newton = False
        self.refusals += 1
        self.pause = 2**self.refusals - 1

    @property
    def exhausted(self) -> bool:
        """Whether more damping is no use."""
        return self.damping >= _DAMPING_LAST

    def succeeded(self, decrease: float) -> None:
        """Choose the next model after a step that lowered the cost by a part of itself."""
        self.damping = self.damping / _DAMPING_FACTOR if self.damping > _DAMPING_FIRST else 0.0
        self.pause = max(0, self.pause - 1)
        self.newton = decrease <= _NEWTON_REGION and self.pause == 0

    def failed(self) -> None:
        """Take a more careful model after a step of which no length lowered the cost."""
        self.damping = max(self.damping * _DAMPING_FACTOR, _DAMPING_FIRST)
        self.newton = False


def left_to_gain(step: Step, decrease: float) -> float:
    """Return an estimate of what the cost can still fall by after a full step.

    What the model missed, ``promise - decrease``, is a term of third order T d^3 / 6; the gradient
    that the step leaves is T d^2 / 2, and a Newton step on that lowers the cost by half its square
    over the curvature. With d^2 times curvature = 2 promise, this is (9 / 4) missed^2 / promise.
    Where the active bounds change it says nothing: another sweep must tell.
    """
    if step.changed:
        return math.inf
    missed = abs(step.promise - decrease)
    least = (_LEFT_EXACT if step.exact else _LEFT_GAUSS_NEWTON * _DOUBT) * step.promise
    return max(9.0 / 4.0 * missed**2 / max(step.promise, 1e-300), least)
