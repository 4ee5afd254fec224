# SPDX-License-Identifier: MIT
"""Closed loops that the bench compares: by backend, by horizon, by weight preset."""

from dataclasses import dataclass, replace
from typing import Any, Callable, Dict, Optional

import numpy as np

from nmpc_control.params import Parameters
from nmpc_control.scenario import Scenario
from nmpc_control.state import Goal
from uav_sim.closed_loop.bench.backends import budgeted, converged, ipopt
from uav_sim.closed_loop.bench.objective import Objective
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.recording import (
    RecordedFlight,
    exact_solver,
    record,
    structure_of,
)

_Maker = Callable[[Parameters], Any]
BACKENDS: Dict[str, _Maker] = {
    "budgeted": budgeted,
    "converged": lambda parameters: converged(structure_of(parameters)),
    "ipopt": lambda parameters: ipopt(structure_of(parameters)),
}


@dataclass(frozen=True)
class FlightFigures:
    """What a flight amounts to while its trajectory's clock runs."""

    cost: float  # [1] stage costs of Eq. 5 along the flight, per second
    deviation_mean: float  # [m]
    deviation_max: float  # [m]
    clearance: float  # [m] hull to the nearest surface; inf without obstacles
    iterations_mean: float
    plans_rejected: int  # by the guard

    @classmethod
    def of(cls, flight: RecordedFlight) -> "FlightFigures":
        """Return the figures of a flight."""
        chosen = [i for i, s in enumerate(flight.log.steps) if s.goal is Goal.TRAJECTORY]
        chosen = [i for i in chosen if i + 1 < len(flight.recorder.instances)]
        instances, steps = flight.recorder.instances, flight.log.steps
        objective = Objective(flight.recorder.solver.structure)
        # the input before the next problem is the one really applied in this one
        costs = [objective.stage(instances[i], instances[i + 1].u_before) for i in chosen]
        deviations = [steps[i].deviation for i in chosen]
        return cls(
            cost=float(np.mean(costs) / flight.recorder.solver.structure.dt),
            deviation_mean=float(np.mean(deviations)),
            deviation_max=float(np.max(deviations)),
            clearance=min(flight.loop.aircraft.clearance.values(), default=float("inf")),
            iterations_mean=float(np.mean([steps[i].plan.iterations for i in chosen])),
            plans_rejected=flight.loop.guard.ladder.rejected,
        )


def fly_with(name: str, scenario: Scenario, until: Optional[float] = None) -> FlightFigures:
    """Return the figures of a scenario flown with one of ``BACKENDS``, at the compiled rate."""
    parameters = bench_parameters(scenario.weights)
    return FlightFigures.of(record(scenario, parameters, BACKENDS[name](parameters), until=until))


def fly_with_horizon(
    seconds: float, scenario: Scenario, until: Optional[float] = None
) -> RecordedFlight:
    """Return the flight of a scenario with another horizon [s], the same step."""
    parameters = bench_parameters(scenario.weights)
    horizon = round(seconds / parameters.solver.dt)
    parameters = replace(parameters, solver=replace(parameters.solver, horizon=horizon))
    return record(scenario, parameters, exact_solver(structure_of(parameters)), until=until)
