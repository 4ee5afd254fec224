# SPDX-License-Identifier: MIT
"""All kinds of trouble by name."""

from typing import Any, Dict, Mapping, Type

from uav_sim.closed_loop.faults import guard_troubles, solver_troubles, world_troubles
from uav_sim.closed_loop.faults.trouble import Trouble
from uav_sim.config import from_dict
from uav_sim.errors import ConfigError

TROUBLES: Dict[str, Type[Trouble]] = {
    "solver_raises": solver_troubles.SolverRaises,
    "solver_stalls": solver_troubles.SolverStalls,
    "solver_nan": solver_troubles.SolverNan,
    "solver_into_obstacle": solver_troubles.SolverIntoObstacle,
    "solver_finds_none": solver_troubles.SolverFindsNone,
    "controller_dead": solver_troubles.ControllerDead,
    "plans_late": solver_troubles.PlansLate,
    "plans_old": solver_troubles.PlansOld,
    "plans_out_of_bounds": solver_troubles.PlansOutOfBounds,
    "stamps_shifted": world_troubles.StampsShifted,
    "out_of_order": world_troubles.OutOfOrder,
    "vicon_silent": world_troubles.ViconSilent,
    "obstacles_silent": world_troubles.ObstaclesSilent,
    "obstacles_nan": world_troubles.ObstaclesNan,
    "obstacles_old": world_troubles.ObstaclesOld,
    "obstacles_flood": world_troubles.ObstaclesFlood,
    "obstacles_stand": world_troubles.ObstaclesStand,
    "obstacle_appears": world_troubles.ObstacleAppears,
    "guard_stops": guard_troubles.GuardStops,
    "guard_raises": guard_troubles.GuardRaises,
    "clock_steps": guard_troubles.ClockSteps,
    "call_blocks": guard_troubles.CallBlocks,
    "call_refused": guard_troubles.CallRefused,
    "asks": guard_troubles.Asks,
}


def make_trouble(kind: Any, parameters: Mapping[str, Any], source: str) -> Trouble:
    """Return a trouble that has not begun; raises ConfigError."""
    if not isinstance(kind, str) or kind not in TROUBLES:
        raise ConfigError(source, "trouble", kind, f"one of {', '.join(TROUBLES)}")
    return from_dict(TROUBLES[kind], dict(parameters), f"{source}: {kind}")
