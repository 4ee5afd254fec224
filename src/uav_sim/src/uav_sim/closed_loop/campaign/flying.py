# SPDX-License-Identifier: MIT
"""Fly one flight of a campaign: a row of figures, JSON types only."""

import math
import time
from functools import lru_cache
from typing import Any, Dict, List

import numpy as np

from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import Metrics
from nmpc_control.params import Parameters
from nmpc_control.scenario import Scenario
from uav_sim.closed_loop.campaign.draw import HULL, MARGIN, Flight, leg_scenario
from uav_sim.closed_loop.campaign.settings import Settings
from uav_sim.closed_loop.flight_record import record_of
from uav_sim.closed_loop.loop import ClosedLoop, NoFlightError, fly
from uav_sim.closed_loop.simulate import new_loop
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.world import World

Row = Dict[str, Any]

ENTERED = 1e-3  # [m] inside the margin that counts as entered: clearance is known to a millimetre
_TIMES, _EXTRA = 3.0, 30.0  # a flight ends after so many times its free time and so many seconds
_EXTRA_CLOSED = 15.0  # [s] the same where there is no way
_HOVER_SPEED = 0.3  # [m/s] at the end of a flight that was held up


class _TimeOverError(Exception):
    """The flight takes too long."""


def fly_row(flight: Flight, settings: Settings) -> Row:
    """Return the figures of one flight; ``feasible`` is None where nothing tells yet.

    Raises:
        ConfigError: settings that are wrong.
    """
    begin = time.perf_counter()
    parameters = settings.parameters()
    plant = settings.preset(flight.seed)
    free = free_time(plant, parameters_key(settings), flight.sketch.length, flight.sketch.speed)
    row: Row = {
        "index": flight.index,
        "seed": flight.seed,
        "plant": plant,
        "speed_m_s": flight.sketch.speed,
        "spheres": len(flight.sketch.spheres),
        "closed": flight.sketch.is_closed,
        "feasible": None,
        "free_time_s": free,
    }
    disturbance = Disturbance(load_disturbance(settings.disturbance), flight.seed)
    scenario = flight.scenario() if settings.avoidance else _bare(flight)
    loop = new_loop(scenario, parameters, plant, flight.world(), disturbance)
    loop.senses = loop.senses and settings.avoidance
    outcome = _fly(scenario, loop, _limit(flight, free))
    row.update(_figures(flight, scenario, loop, parameters))
    row["outcome"] = ", ".join(word for word in (_in_words(row), outcome) if word)
    row["late_s"] = None
    if row["arrived"] and row["navigation_time_s"] is not None and free is not None:
        row["late_s"] = round(row["navigation_time_s"] - free, 3)
    row["wall_s"] = round(time.perf_counter() - begin, 3)
    return row


def parameters_key(settings: Settings) -> Settings:
    """Return what the free flight depends on, as settings without the rest."""
    return Settings("free", 0, settings.plant, changes=settings.changes)


@lru_cache(maxsize=256)
def free_time(plant: str, settings: Settings, length: float, speed: float) -> Any:
    """Return the navigation time [s] of the same leg without obstacles in calm air, else None."""
    points = np.array([[0.0, 0.0, 12.0], [length, 0.0, 12.0]])
    scenario = leg_scenario("free", *points, speed)
    loop = new_loop(scenario, settings.parameters(), plant, World((), HULL))
    if _fly(scenario, loop, _TIMES * length / speed + _EXTRA):
        return None
    time_needed = flight_metrics(record_of(scenario, loop.log, 0), HULL)["navigation_time_s"]
    return None if time_needed is None else round(time_needed, 3)


def _bare(flight: Flight) -> Scenario:
    """Return the leg without what is known of obstacles."""
    return leg_scenario(flight.suite, flight.start, flight.end, flight.sketch.speed)


def _limit(flight: Flight, free: Any) -> float:
    """Return the simulated time [s] at which a flight ends at the latest."""
    free = flight.sketch.length / flight.sketch.speed if free is None else free
    return free + _EXTRA_CLOSED if flight.sketch.is_closed else _TIMES * free + _EXTRA


def _fly(scenario: Scenario, loop: ClosedLoop, limit: float) -> str:
    """Fly until arrival or the limit [s]; return what went wrong with the flight itself."""

    def watch(progress: float) -> None:
        if loop.t > limit:
            raise _TimeOverError

    try:
        fly(scenario, loop, on_progress=watch)
    except _TimeOverError:
        loop.log.end = loop.t
        return f"not arrived after {limit:.0f} s"
    except NoFlightError as error:
        loop.log.end = loop.t
        return str(error)
    ended = loop.controller.itinerary.outcome
    return "" if ended is None or ended.arrived else ended.message


def _figures(flight: Flight, scenario: Scenario, loop: ClosedLoop, parameters: Parameters) -> Row:
    log, collisions = loop.log, loop.aircraft.collisions
    metrics: Metrics = flight_metrics(record_of(scenario, log, len(collisions)), HULL)
    clearance = min(loop.aircraft.clearance.values(), default=math.inf)
    start = log.clock_start if log.clock_start is not None else log.end
    times = [1e3 * s.plan.solve_time for s in log.steps if s.estimate.t >= start]
    end_speed = math.hypot(*log.truths[-1].velocity) if log.truths else math.inf
    entered = clearance < MARGIN - ENTERED
    arrived = bool(metrics["arrived"])
    return {
        "arrived": arrived,
        "held": not arrived and not collisions and not entered and end_speed < _HOVER_SPEED,
        "collisions": len(collisions),
        "collided_with": sorted({collision.id for collision in collisions}),
        "margin_entered": entered,
        "worst_margin_m": _finite(clearance - MARGIN),
        "clearance_m": _finite(clearance),
        "navigation_time_s": metrics["navigation_time_s"],
        "deviation_m": metrics["average_deviation_m"],
        "deviation_truth_m": metrics["average_deviation_truth_m"],
        "solve_time_ms": quantiles(times),
        "solve_times_us": [round(1e3 * t) for t in times],
        "plans_rejected": loop.guard.ladder.rejected,
        "plans_found_ratio": metrics["plans_found_ratio"],
    }


def quantiles(times: List[float]) -> Row:
    """Return p50, p95, p99 and maximum of times [ms]; None without any."""
    if not times:
        return dict.fromkeys(("p50", "p95", "p99", "max"))
    p50, p95, p99 = np.percentile(times, [50, 95, 99])
    values = {"p50": p50, "p95": p95, "p99": p99, "max": max(times)}
    return {name: round(float(value), 4) for name, value in values.items()}


def _in_words(row: Row) -> str:
    if row["collisions"]:
        return f"hit {', '.join(row['collided_with'])}"
    if row["arrived"]:
        return "arrived, margin entered" if row["margin_entered"] else "arrived"
    if row["held"]:
        return "held up, hovers"
    return "not arrived"


def _finite(value: float) -> Any:
    return round(value, 4) if math.isfinite(value) else None
