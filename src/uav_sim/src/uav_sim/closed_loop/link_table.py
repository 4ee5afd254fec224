# SPDX-License-Identifier: MIT
"""What the link to a controller on the ground may be like: flights over worse and worse ones.

One row a flight, without ROS: ``python -m uav_sim.closed_loop.link_table [SCENARIO] [--json F]``.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.errors import NmpcError
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.ladder import BRAKES
from nmpc_control.mode_inputs import Mode
from nmpc_control.params import load_parameters
from nmpc_control.scenario import Scenario, load_scenario
from uav_sim.closed_loop.flight_record import world_of
from uav_sim.closed_loop.link import LinkedLoop, LinkQuality
from uav_sim.closed_loop.loop import Log, NoFlightError, fly
from uav_sim.errors import SimulatorError
from uav_sim.preset import load_preset

LINKS: Tuple[LinkQuality, ...] = (
    LinkQuality(),
    LinkQuality(delay=0.005, jitter=0.005),
    LinkQuality(delay=0.02, jitter=0.01),
    LinkQuality(delay=0.05, jitter=0.02),
    LinkQuality(delay=0.1, jitter=0.02),
    LinkQuality(delay=0.15, jitter=0.02),
    LinkQuality(delay=0.005, jitter=0.005, loss=0.01),
    LinkQuality(delay=0.005, jitter=0.005, loss=0.05),
    LinkQuality(delay=0.005, jitter=0.005, loss=0.2),
    LinkQuality(delay=0.005, jitter=0.005, skew=0.05),
    LinkQuality(delay=0.005, jitter=0.005, skew=-0.05),
    LinkQuality(delay=0.005, jitter=0.005, skew=0.09),
    LinkQuality(delay=0.005, jitter=0.005, skew=-0.09),
    LinkQuality(delay=0.005, jitter=0.005, skew=0.3),
    LinkQuality(delay=0.005, jitter=0.005, skew=-0.3),
)


def linked(
    scenario: Scenario,
    link: LinkQuality,
    plant: str = "dji_hil",
    seed: int = 0,
    tolerance: Optional[float] = None,
) -> LinkedLoop:
    """Return aircraft, guard, link and controller before a flight; raises ConfigError.

    ``tolerance`` [s] of the clock's skew, instead of that in ``guard.yaml``.
    """
    parameters = load_parameters(plant, scenario.weights)
    guard = load_guard_parameters()
    if tolerance is not None:
        guard = dataclasses.replace(
            guard, link=dataclasses.replace(guard.link, clock_tolerance=tolerance)
        )
    world = world_of(scenario, parameters.vehicle.radius)
    return LinkedLoop(load_preset(plant), world, parameters, guard, link=link, seed=seed)


def row(scenario: Scenario, link: LinkQuality, plant: str = "dji_hil") -> Dict[str, Any]:
    """Return one flight: the link, whether it arrived, deviation [m], part of it spent braking."""
    loop = linked(scenario, link, plant)
    found: Dict[str, Any] = dataclasses.asdict(link)
    try:
        log = fly(scenario, loop)
    except NoFlightError as error:
        return {**found, "arrived": False, "reason": str(error)}
    deviation = deviations(scenario, log)
    flown = [output for t, output in log.outputs if log.clock_start and t >= log.clock_start]
    held = sum(o.mode is Mode.BRAKING or o.rung in BRAKES for o in flown)
    outcome = loop.controller.itinerary.outcome
    return {
        **found,
        "arrived": bool(outcome and outcome.arrived),
        "reason": outcome.message if outcome else loop.log.outputs[-1][1].reason,
        "deviation_mean_m": float(deviation.mean()),
        "deviation_max_m": float(deviation.max()),
        "braking": held / max(1, len(flown)),
        "collisions": len(loop.aircraft.collisions),
        "telemetry_to_plan_ms": 1e3 * loop.guard.link.delay,
        "offset_ms": 1e3 * loop.guard.link.offset,
    }


def deviations(scenario: Scenario, log: Log) -> np.ndarray:
    """Return true distances [m] from the reference at its own clock."""
    start, duration = log.clock_start, scenario.trajectory.duration
    flown = [truth for truth in log.truths if 0.0 <= truth.t - start <= duration]
    times = np.array([truth.t - start for truth in flown])
    reference = scenario.trajectory.sample(times).position
    return np.linalg.norm([t.position for t in flown] - reference, axis=1)


def table(rows: List[Dict[str, Any]]) -> str:
    """Return the rows as a table in Markdown."""
    head = (
        "| one way [ms] | jitter [ms] | loss [%] | skew [ms] | telemetry to plan [ms] "
        "| deviation mean, max [m] | braking [% of the time] | arrived |\n" + 8 * "|---" + "|"
    )
    return "\n".join([head, *map(_line, rows)])


def _line(r: Dict[str, Any]) -> str:
    link = f"| {1e3 * r['delay']:.0f} | {1e3 * r['jitter']:.0f} | {1e2 * r['loss']:.0f} "
    link += f"| {1e3 * r['skew']:.0f} "
    if "deviation_mean_m" not in r:
        return f"{link}| | | | not started: {r['reason']} |"
    deviation = f"{r['deviation_mean_m']:.2f}, {r['deviation_max_m']:.2f}"
    share = f"{1e2 * r['braking']:.1f}"
    end = "yes" if r["arrived"] else f"no: {r['reason']}"
    return f"{link}| {r['telemetry_to_plan_ms']:.0f} | {deviation} | {share} | {end} |"


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point; exit status 2 on bad input."""
    parser = argparse.ArgumentParser(prog="link_table", description=__doc__)
    parser.add_argument("scenario", nargs="?", default="hexagon")
    parser.add_argument("--plant", default="dji_hil")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(argv)
    try:
        scenario = load_scenario(options.scenario)
        rows = []
        for link in LINKS:
            rows.append(row(scenario, link, options.plant))
            sys.stdout.write(table(rows[-1:]).splitlines()[-1] + "\n")
            sys.stdout.flush()
        if options.json:
            options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    except (NmpcError, SimulatorError, OSError) as error:
        parser.error(str(error))
    sys.stdout.write("\n" + table(rows) + "\n")


if __name__ == "__main__":
    main()
