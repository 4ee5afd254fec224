# SPDX-License-Identifier: MIT
"""Stage functions split into what depends on the parameters alone and the rest.

Exponentials of the lags, bounds and factors are the same in all stages of a sweep: computed once,
they are not computed sixty times.
"""

from typing import List, NamedTuple

import casadi as ca


class StageFunction(NamedTuple):
    """A stage function of which the last argument is ``prepare(theta)``."""

    prepare: ca.Function
    stage: ca.Function


def stage_function(
    name: str, arguments: List[ca.SX], theta: ca.SX, outputs: List[ca.SX]
) -> StageFunction:
    """Return ``outputs``, made dense, as function of the arguments and the prepared values."""
    dense = [ca.densify(output) for output in outputs]
    stacked = ca.vertcat(*[ca.vec(output) for output in dense])
    rest, symbols, values = ca.extract_parametric(stacked, theta)
    shared = ca.vertcat(theta, *symbols)
    ends = [0]
    for output in dense:
        ends.append(ends[-1] + output.numel())
    split = [
        ca.reshape(part, output.shape) for part, output in zip(ca.vertsplit(rest, ends), dense)
    ]
    return StageFunction(
        ca.Function(f"{name}_prepare", [theta], [ca.vertcat(theta, *values)]),
        ca.Function(name, [*arguments, shared], split),
    )
