# SPDX-License-Identifier: MIT
"""Fly one scenario without ROS, faster than real time.

Controller, guard and simulated aircraft in one process.

With --disturbance there is wind, the sensors have errors, latency varies, and thrust and mass are
drawn around the nominal ones; --seed picks the draw. At "indoor" the position comes from motion
capture. The same seed gives the same flight.

With --plant paper a scenario that has a variant "paper" is flown as in the paper's table of
simulations: its geometry, duration, start at rest, and distances from the aircraft's centre.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import List, Optional, Tuple

from rich.progress import Progress

from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.record import Metrics
from nmpc_control.analysis.tables import as_text
from nmpc_control.config import load_yaml
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.params import Parameters, load_parameters
from nmpc_control.scenario import Scenario, load_scenario, scenario_path
from uav_sim.closed_loop.command import fail, failing_in_one_line
from uav_sim.closed_loop.flight_record import record_of, world_of
from uav_sim.closed_loop.loop import ClosedLoop, NoFlightError, fly
from uav_sim.closed_loop.options import between, seed
from uav_sim.disturbance import Disturbance, disturbance_names, load_disturbance
from uav_sim.preset import preset_names
from uav_sim.spread import any_preset
from uav_sim.world import World

_PROGRAM, _PAPER = "simulate", "paper"


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``simulate``; exit status 0 only if the flight arrived and hit nothing."""
    options = _parser().parse_args(argv)
    with failing_in_one_line(_PROGRAM):
        scenario, parameters = _prepare(options)
        try:
            metrics = simulate(
                scenario,
                parameters,
                options.plant,
                quiet=options.quiet,
                world=_world(options, scenario, parameters.vehicle.radius),
                disturbance=Disturbance(load_disturbance(options.disturbance), options.seed),
            )
        except NoFlightError as error:
            fail(_PROGRAM, str(error), status=1)
        if options.json:
            options.json.write_text(json.dumps(metrics, indent=2) + "\n", encoding="utf-8")
    if not options.quiet:
        sys.stdout.write(as_text([metrics]) + "\n")
    sys.exit(0 if metrics["arrived"] and metrics["collisions"] == 0 else 1)


def simulate(
    scenario: Scenario,
    parameters: Parameters,
    plant: str,
    quiet: bool = True,
    world: Optional[World] = None,
    disturbance: Optional[Disturbance] = None,
) -> Metrics:
    """Return the metrics of one simulated flight.

    Args:
        scenario: what to fly.
        parameters: of the controller; the vehicle's radius is the hull for avoidance, checks
            and metrics.
        plant: name of the plant preset.
        quiet: no progress bar.
        world: surroundings; None: the scenario's obstacles, all at rest.
        disturbance: of the flight, new; None: there is none.

    Raises:
        ConfigError: a preset that does not exist.
        NoFlightError: automatic flight did not begin.
    """
    loop = new_loop(scenario, parameters, plant, world, disturbance)
    with Progress(disable=quiet, transient=True) as bar:
        task = bar.add_task(f"{scenario.name} on {plant}", total=1.0)
        log = fly(scenario, loop, on_progress=lambda progress: bar.update(task, completed=progress))
    metrics = flight_metrics(
        record_of(scenario, log, len(loop.aircraft.collisions)), parameters.vehicle.radius
    )
    metrics["plant"] = plant
    if disturbance is not None:
        metrics["disturbance"] = disturbance.parameters.name
        metrics["seed"] = disturbance.seed
    metrics["clearance_truth_m"] = dict(loop.aircraft.clearance)
    metrics["plans_rejected"] = loop.guard.ladder.rejected
    return metrics


def new_loop(
    scenario: Scenario,
    parameters: Parameters,
    plant: str,
    world: Optional[World] = None,
    disturbance: Optional[Disturbance] = None,
) -> ClosedLoop:
    """Return aircraft and control before the flight; arguments as of ``simulate``.

    Raises ConfigError.
    """
    world = world or world_of(scenario, parameters.vehicle.radius)
    guard = load_guard_parameters()
    return ClosedLoop(any_preset(plant), world, parameters, guard, disturbance)


def _world(options: argparse.Namespace, scenario: Scenario, radius: float) -> World:
    """Return the surroundings in the scenario's file, also what moves."""
    path = scenario_path(options.scenario)
    data = load_yaml(path)
    variant = (data.get("variants") or {}).get(scenario.variant, {})
    obstacles = variant.get("obstacles", data.get("obstacles"))
    return World.from_list(obstacles, radius, path.name)


def _prepare(options: argparse.Namespace) -> Tuple[Scenario, Parameters]:
    variant = options.variant
    if variant is None and options.plant == _PAPER:
        variant = (
            _PAPER
            if _PAPER in (load_yaml(scenario_path(options.scenario)).get("variants") or {})
            else None
        )
    scenario = load_scenario(options.scenario, variant=variant)
    any_preset(options.plant)
    parameters = load_parameters(
        options.vehicle or options.plant, options.weights or scenario.weights
    )
    radius = options.vehicle_radius
    if radius is None:
        radius = 0.0 if variant == _PAPER and options.plant == _PAPER else parameters.vehicle.radius
    return scenario, dataclasses.replace(
        parameters,
        vehicle=dataclasses.replace(parameters.vehicle, radius=radius),
        solver=dataclasses.replace(
            parameters.solver, backend=options.backend or parameters.solver.backend
        ),
        avoidance=dataclasses.replace(parameters.avoidance, enabled=options.avoidance == "on"),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("scenario", help="name of a scenario, or path of a YAML file")
    parser.add_argument(
        "--plant",
        default="dji_hil",
        help=f"simulated aircraft: {', '.join(preset_names())}, or spread:SEED with --vehicle"
        " (default: %(default)s)",
    )
    parser.add_argument("--vehicle", help="the controller's model of it (default: as the plant)")
    parser.add_argument("--variant", help="variant of the scenario")
    parser.add_argument("--weights", help="weight preset (default: the scenario's)")
    parser.add_argument("--backend", choices=["compiled", "ipopt"], help="solver")
    parser.add_argument(
        "--avoidance", default="on", choices=["on", "off"], help="off: fly into obstacles"
    )
    parser.add_argument(
        "--vehicle-radius",
        type=between(0.0, 5.0, "metres"),
        help="hull [m] (default: the vehicle's 0.5)",
    )
    parser.add_argument(
        "--disturbance",
        default="none",
        metavar="LEVEL",
        help=f"{', '.join(disturbance_names())}, or path of a YAML file (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=seed, default=0, help="of everything random (default: %(default)s)"
    )
    parser.add_argument("--json", type=Path, help="write the metrics to this file")
    parser.add_argument("--quiet", action="store_true", help="no progress, no table")
    return parser
