# SPDX-License-Identifier: MIT
"""Fly many flights in parallel processes."""

import os
import signal
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from typing import Callable, Iterable, Iterator, Set

from uav_sim.closed_loop.campaign.feasibility import judge
from uav_sim.closed_loop.campaign.flying import Row, fly_row
from uav_sim.closed_loop.campaign.settings import Settings
from uav_sim.closed_loop.campaign.suites import draw_flight

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


def fly_number(settings: Settings, index: int) -> Row:
    """Return the row of one flight, judged; what a flight raises becomes its outcome."""
    flight = draw_flight(settings.suite, settings.seed, index)
    try:
        row = fly_row(flight, settings)
        row.update(judge(flight, row, settings))
    except Exception as error:  # noqa: BLE001 (one flight must not end a campaign of hundreds)
        return failed_row(index, flight.seed, f"{type(error).__name__}: {error}")
    return row


def failed_row(index: int, seed: int, error: str) -> Row:
    """Return the row of a flight that raised."""
    return {"index": index, "seed": seed, "error": error, "outcome": error}


def run(
    settings: Settings, indices: Iterable[int], workers: int, on_row: Callable[[Row], None]
) -> None:
    """Fly flights by number; ``on_row`` gets each row when it is finished.

    One worker flies in this process. KeyboardInterrupt waits for the flights under way and is
    raised again; their rows are not lost.

    Raises:
        BrokenProcessPool: a worker died.
    """
    if workers == 1:
        for index in indices:
            on_row(fly_number(settings, index))
        return
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))  # read when a worker imports NumPy
    todo = iter(indices)
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _leave_interrupts)
    under_way: Set["Future[Row]"] = set()
    try:
        while True:
            under_way |= _submitted(pool, settings, todo, workers - len(under_way))
            if not under_way:
                return
            under_way = _finished(under_way, on_row)
    except KeyboardInterrupt:
        under_way = {future for future in under_way if not future.cancel()}
        while under_way:
            under_way = _finished(under_way, on_row)
        raise
    finally:
        pool.shutdown()


def _submitted(
    pool: ProcessPoolExecutor, settings: Settings, todo: Iterator[int], count: int
) -> Set["Future[Row]"]:
    futures = set()
    for _ in range(count):
        index = next(todo, None)
        if index is None:
            break
        futures.add(pool.submit(fly_number, settings, index))
    return futures


def _finished(futures: Set["Future[Row]"], on_row: Callable[[Row], None]) -> Set["Future[Row]"]:
    done, rest = wait(futures, return_when=FIRST_COMPLETED)
    for future in done:
        on_row(future.result())
    return rest


def _leave_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group
