# SPDX-License-Identifier: MIT
"""How much of a solve is generated C, and how much is Python around it."""

import time
from contextlib import contextmanager
from typing import Iterator, List

from nmpc_control.compiled_function import Buffered
from nmpc_control.sqp import SqpSolver
from uav_sim.closed_loop.bench.problem import Problem

_REPLAYS = 20  # of the recorded sequence of calls


@contextmanager
def traced_calls() -> Iterator[List[Buffered]]:
    """Collect the compiled functions in the order in which they are called."""
    calls: List[Buffered] = []
    original = Buffered.__call__

    def call(function: Buffered) -> bool:
        calls.append(function)
        return original(function)

    Buffered.__call__ = call
    try:
        yield calls
    finally:
        Buffered.__call__ = original


def native_time(solver: SqpSolver, problem: Problem) -> float:
    """Return the time [s] of the generated C alone in one solve.

    The compiled functions that the solve calls are called again in the same order, with their fixed
    buffers and nothing in between; the fastest of some replays counts.
    """
    with traced_calls() as calls:
        solver.solve(problem.instance, problem.guess)
    best = float("inf")
    for _ in range(_REPLAYS):
        start = time.perf_counter()
        for call in calls:
            call()
        best = min(best, time.perf_counter() - start)
    return best
