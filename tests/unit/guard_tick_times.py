# SPDX-License-Identifier: MIT
"""Print how long a tick of the guard takes, and the check of a plan in it, beside many obstacles.

No test: wall time depends on the machine. ``python tests/unit/guard_tick_times.py``
"""

import statistics
import sys
import time

import numpy as np
from flight_stub import PARAMS, VEHICLE, Aircraft, Flight, make_plan

from nmpc_control.clearance_check import as_field, check_clearance
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import Goal, hover_state

START = np.array([0.0, 0.0, 5.0])


def scattered(count, t):
    """Return spheres that drift, at least 3 m beside the way."""
    rng = np.random.default_rng(0)
    obstacles = []
    while len(obstacles) < count:
        position = rng.uniform([-30.0, -30.0, 2.0], [30.0, 30.0, 8.0])
        if abs(position[1]) > 3.0:
            moves = dict(velocity=rng.normal(0.0, 0.3, 3), stamp=t, growth=0.05)
            radius = np.array([rng.uniform(0.4, 1.5)])
            obstacles.append(Obstacle(f"o{len(obstacles)}", position, radius, **moves))
    return tuple(obstacles)


def times(act, count):
    """Return the times [ms] of so many calls."""
    result = []
    for _ in range(count):
        begin = time.perf_counter()
        act()
        result.append(1e3 * (time.perf_counter() - begin))
    return result


def tick_times(count):
    """Return the times [ms] of the clearance check alone, and of ticks with one new plan."""
    flight = Flight(aircraft=Aircraft().airborne(START)).hovering()
    flight.aircraft.airborne(START, [2.0, 0.0, 0.0])
    flight.obstacles = scattered(count, flight.t)
    state = hover_state(START)
    state[6] = 2.0
    plan, field = make_plan(state, flight.t), as_field(flight.obstacles)
    check = times(lambda: check_clearance(plan, flight.t, VEHICLE, field, PARAMS.plan_check), 100)
    offered = iter([(plan, Goal.TRAJECTORY)])
    flight.solver = lambda t, x: next(offered, (None, Goal.HOLD))
    return check, times(flight.tick, 20)


def main():
    """Print one line for each number of obstacles."""
    for count in (0, 16, 64, 256):
        check, ticks = tick_times(count)
        line = f"{count:4d} obstacles: clearance {statistics.median(check):.2f} ms, tick "
        sys.stdout.write(f"{line}{statistics.median(ticks):.2f} ms, worst {max(ticks):.2f} ms\n")


if __name__ == "__main__":
    main()
