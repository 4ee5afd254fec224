# SPDX-License-Identifier: MIT
"""Random stories around the guard for hours of simulated time: ``make fuzz HOURS=5``.

Ends with a traceback and the shortest story that leads to it as soon as something happens that must
not; exit status 0 if nothing did.
"""

import sys
import time

from flight_stub import TICK
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test
from test_guard_machine import Story

STORIES = 50  # [1] between two lines of progress
STEPS = 60  # [1] of a story


def main(hours: float) -> None:
    """Tell stories until they have taken so many hours of simulated time."""
    begun = time.monotonic()
    long = settings(
        max_examples=STORIES,
        stateful_step_count=STEPS,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    flown = 0.0
    while flown < hours:
        run_state_machine_as_test(Story, settings=long)
        flown = Story.ticks * TICK / 3600.0
        wall = time.monotonic() - begun
        sys.stdout.write(f"{flown:.2f} of {hours:g} simulated hours, {wall:.0f} s of wall time\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(float(sys.argv[1]))
