# SPDX-License-Identifier: MIT
"""Closed-loop flights of which every problem is taken down."""

from dataclasses import dataclass
from typing import Any, List, Optional

import numpy as np

from nmpc_control.ocp import Structure
from nmpc_control.params import Parameters
from nmpc_control.scenario import Scenario
from nmpc_control.sqp import SqpSolver
from uav_sim.closed_loop.bench.parameters import PLANT
from uav_sim.closed_loop.bench.problem import Recorder
from uav_sim.closed_loop.loop import ClosedLoop, Log, fly
from uav_sim.closed_loop.simulate import new_loop

_PUSH = 3.0  # [m/s] sudden change of the velocity
_PUSHES_AT = (0.15, 0.35, 0.55, 0.75)  # part of the trajectory's time


@dataclass(frozen=True)
class RecordedFlight:
    """A flight with what was posed and solved in it."""

    scenario: Scenario
    parameters: Parameters
    recorder: Recorder
    loop: ClosedLoop
    pushes: List[int]  # index of the first problem after each push

    @property
    def log(self) -> Log:
        """What happened, sample by sample."""
        return self.loop.log


class _Enough(Exception):  # noqa: N818 - ends a flight, is no error
    pass


def structure_of(parameters: Parameters) -> Structure:
    """Return the structure of the problem that these parameters pose."""
    p = parameters.solver
    return Structure(p.horizon, p.dt, p.integrator, p.obstacle_slots)


def exact_solver(structure: Structure, tolerance: float = 1e-6) -> SqpSolver:
    """Return the compiled solver without budget: what it solves does not depend on the load."""
    return SqpSolver(structure, tolerance, 200, 30.0)


def record(
    scenario: Scenario,
    parameters: Parameters,
    solver: Any,
    pushes_seed: Optional[int] = None,
    until: Optional[float] = None,
) -> RecordedFlight:
    """Fly a scenario from its initial position.

    Args:
        scenario: what to fly.
        parameters: of the controller.
        solver: what flies.
        pushes_seed: of the directions in which the aircraft is pushed in mid-flight; None: never.
        until: end the flight at this part of the trajectory's time.
    """
    loop = new_loop(scenario, parameters, PLANT)
    flight = RecordedFlight(scenario, parameters, Recorder(solver), loop, [])
    loop.controller.nmpc.solver = flight.recorder
    rng = np.random.default_rng(pushes_seed)

    def on_progress(progress: float) -> None:
        done = len(flight.pushes)
        if until is not None and progress >= until:
            raise _Enough
        if pushes_seed is not None and done < len(_PUSHES_AT) and progress >= _PUSHES_AT[done]:
            way = rng.normal(size=3) * [1.0, 1.0, 0.3]
            plant = loop.aircraft.plant
            plant.velocity = tuple(plant.velocity + _PUSH * way / np.linalg.norm(way))
            flight.pushes.append(len(flight.recorder.instances))

    try:
        fly(scenario, loop, on_progress=on_progress)
    except _Enough:
        loop.log.end = loop.t
    return flight
