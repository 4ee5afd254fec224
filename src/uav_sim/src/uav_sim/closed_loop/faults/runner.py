# SPDX-License-Identifier: MIT
"""Rows of the matrix, one by one or in several processes."""

import logging
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from multiprocessing import get_context
from typing import Callable, Dict, List, Sequence, Tuple

from uav_sim.closed_loop.faults.escape import way_out
from uav_sim.closed_loop.faults.flight import fly
from uav_sim.closed_loop.faults.judgement import Row, row_of
from uav_sim.closed_loop.faults.matrix import Case, Expectation, load_cases, load_expectations

Job = Tuple[str, str]  # names of case and situation
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


def jobs(only: Sequence[str] = ()) -> List[Job]:
    """Return all rows, or those whose "fault/situation" contains one of some words."""
    pairs = [(name, s) for name, case in load_cases().items() for s in case.situations]
    return [job for job in pairs if not only or any(word in "/".join(job) for word in only)]


def fly_row(job: Job) -> Row:
    """Return the row of a flight, judged."""
    logging.getLogger("uav_sim.faults").setLevel(logging.ERROR)
    name, situation = job
    cases, expectations = _matrix()
    return judged(cases[name], situation, expectations[name][situation])


def judged(case: Case, situation: str, expected: Expectation) -> Row:
    """Return the row of a case in a situation; a collision is tried to be avoided."""
    flight = fly(case, situation)
    row = row_of(case, situation, flight, expected)
    if row["collision"]:
        way = way_out(case, situation, flight)
        row["unavoidable"] = not way
        if way and expected.unavoidable:
            row["failures"].append(f"the collision could be avoided: {way}")
    row["passed"] = not row["failures"]
    return row


def run(todo: Sequence[Job], workers: int, on_row: Callable[[Row], None]) -> None:
    """Fly rows; ``on_row`` gets each when it is finished, in any order.

    Raises:
        BrokenProcessPool: a worker died.
    """
    if workers == 1:
        for job in todo:
            on_row(_safely(job))
        return
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))  # read when a worker imports NumPy
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_safely, job) for job in todo]):
            on_row(future.result())


def _safely(job: Job) -> Row:
    try:
        return fly_row(job)
    except Exception as error:  # noqa: BLE001 (one row must not end the others)
        return failed_row(job, f"{type(error).__name__}: {error}")


def failed_row(job: Job, error: str) -> Row:
    """Return the row of a flight that raised."""
    expected = _matrix()[1][job[0]][job[1]]
    return {
        "fault": job[0],
        "situation": job[1],
        "final_mode": "",
        "reason": "",
        "expected_mode": expected.mode,
        "expected": expected.end,
        "before": "",
        "way": [],
        "collision": False,
        "collided_with": [],
        "clearance_m": None,
        "nan_published": 0,
        "command_gap_ms_max": 0.0,
        "reaction_s": None,
        "takeover_s": 0.0,
        "sinks_m": 0.0,
        "end_speed_m_s": 0.0,
        "on_ground": False,
        "against_landing_s": 0.0,
        "unavoidable": None,
        "failures": [error],
        "passed": False,
    }


@lru_cache(maxsize=1)
def _matrix() -> Tuple[Dict[str, Case], Dict[str, Dict[str, Expectation]]]:
    return load_cases(), load_expectations()
