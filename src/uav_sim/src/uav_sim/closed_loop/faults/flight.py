# SPDX-License-Identifier: MIT
"""One flight of the matrix: a situation, and what goes wrong in it."""

import heapq
import math
from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

from nmpc_control.config import load_yaml
from nmpc_control.dji import Axes
from nmpc_control.guard_data import GuardOutput
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import Mode, Request
from nmpc_control.params import load_parameters
from nmpc_control.scenario import load_scenario
from uav_sim.closed_loop.faults.faulty_loop import FaultyLoop
from uav_sim.closed_loop.faults.kinds import make_trouble
from uav_sim.closed_loop.faults.matrix import Case, folder
from uav_sim.closed_loop.faults.trouble import Trouble
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.errors import SimulatorError
from uav_sim.spread import any_preset
from uav_sim.world import World

PLANT = "dji_hil"
FAULT_AT = {"hover": 4.0, "turn": 9.0, "beside": 6.6}  # [s] of simulated time
SEED = 1
_START_LIMIT = 5.0  # [s]


@dataclass
class Flight:
    """What was flown."""

    loop: FaultyLoop
    t0: float  # [s] when the case began
    before: GuardOutput  # of the last tick before that


def fly(
    case: Case,
    situation: str,
    prepare: Callable[[FaultyLoop], None] = lambda loop: None,
    escape: Optional[Axes] = None,
) -> Flight:
    """Fly a case in a situation.

    Args:
        case: what goes wrong.
        situation: file below ``config/fault_matrix`` with way and obstacles.
        prepare: changes the loop before the flight, as to switch a protection off.
        escape: setpoint that is sent from the case's beginning on in place of the guard's.

    Raises:
        SimulatorError: the flight did not get under way.
    """
    path = folder() / f"{situation}.yaml"
    t0 = FAULT_AT[situation]
    troubles = [
        make_trouble(part.kind, part.parameters, case.name)
        for part in case.parts
        if part.is_trouble
    ]
    loop = _loop(case, str(path), situation, t0, troubles)
    scenario = load_scenario(str(path))
    prepare(loop)
    loop.aircraft.place(scenario.initial_position, yaw=scenario.start_yaw)
    while loop.guard.mode is not Mode.HOVERING:
        loop.inbox.request = Request.START
        loop.step()
        if loop.t > _START_LIMIT:
            raise SimulatorError(f"{situation}: not under way: {loop.log.outputs[-1][1].reason}")
    if scenario.trajectory.length > 0.0:
        loop.controller.itinerary.begin(loop.t, scenario.trajectory)
    while loop.t < t0 - 1e-9:
        loop.step()
    before, loop.pilot_heard = loop.log.outputs[-1][1], None
    _go_wrong(loop, case, troubles, t0, escape)
    return Flight(loop, t0, before)


def _loop(case: Case, path: str, situation: str, t0: float, troubles: List[Trouble]) -> FaultyLoop:
    parameters, entries = load_parameters(PLANT), list(load_yaml(path).get("obstacles") or [])
    parts = [part for part in case.parts if part.is_trouble]
    for trouble, part in zip(troubles, parts):
        entries += trouble.scenery(situation, t0 + part.after)
    world = World.from_list(entries, parameters.vehicle.radius, situation)
    disturbance = None
    if case.level != "none":
        disturbance = Disturbance(load_disturbance(case.level), SEED)
    guard = load_guard_parameters()
    return FaultyLoop(any_preset(PLANT), world, parameters, guard, disturbance)


def _go_wrong(
    loop: FaultyLoop, case: Case, troubles: List[Trouble], t0: float, escape: Optional[Axes]
) -> None:
    """Let it happen, part after part, and fly on to the end of the case."""
    events: List[Tuple[float, int, Callable[[], None]]] = []
    left = iter(troubles)
    for part in case.parts:
        if not part.is_trouble:
            loop.aircraft.faults.inject(
                part.kind, part.parameters, t0 + part.after, part.duration, source=case.name
            )
            continue
        trouble, begin = next(left), t0 + part.after
        heapq.heappush(events, (begin, len(events), _begin(loop, trouble)))
        if math.isfinite(part.duration):
            ended = begin + part.duration
            heapq.heappush(events, (ended, len(events), _end(loop, trouble)))
    if escape is not None:
        loop.escape = escape
    while loop.t < t0 + case.watch - 1e-9:
        while events and events[0][0] <= loop.t + 1e-9:
            heapq.heappop(events)[2]()
        loop.step()
    loop.log.end = loop.t


def _begin(loop: FaultyLoop, trouble: Trouble) -> Callable[[], None]:
    def act() -> None:
        loop.troubles.append(trouble)
        trouble.begin(loop)

    return act


def _end(loop: FaultyLoop, trouble: Trouble) -> Callable[[], None]:
    return lambda: loop.troubles.remove(trouble)
