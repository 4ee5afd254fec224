# SPDX-License-Identifier: MIT
"""Log of a simulated flight as the record that the offline metrics read."""

from typing import Dict, List, Tuple

import numpy as np

from nmpc_control import dji
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Reference, Series
from nmpc_control.obstacle import Obstacle
from nmpc_control.scenario import Scenario
from nmpc_control.state import POSITION, VELOCITY
from uav_sim.body import BodyState
from uav_sim.closed_loop.loop import Log
from uav_sim.world import World

_REFERENCE_SAMPLES = 4000


def record_of(scenario: Scenario, log: Log, collisions: int) -> FlightRecord:
    """Return the record of a flight; its clock is the simulation's."""
    steps, outputs = log.steps, log.outputs
    solved = np.array([step.estimate.t for step in steps])
    sent = [(t, output.axes) for t, output in outputs if output.axes]
    duration = scenario.trajectory.duration
    times = np.linspace(0.0, duration, _REFERENCE_SAMPLES)
    truth_times = np.array([truth.t for truth in log.truths])
    return FlightRecord(
        scenario=scenario.name,
        source="simulation",
        position=Series(solved, [step.estimate.vector[POSITION] for step in steps]),
        velocity=Series(solved, [step.estimate.vector[VELOCITY] for step in steps]),
        attitude=Series(solved, [step.estimate.vector[3:6] for step in steps]),
        true_position=Series(truth_times, [truth.position for truth in log.truths]),
        reference=Reference(
            log.clock_start, Series(times, scenario.trajectory.sample(times).position)
        ),
        tracked_reference=Series(solved, [step.reference[POSITION] for step in steps]),
        obstacles=_tracks(scenario, log),
        commands=Series([t for t, _ in sent], [_command(axes) for _, axes in sent]),
        solver=Series(
            solved, [(s.plan.iterations, s.plan.solve_time, s.plan.found) for s in steps]
        ),
        status=Series([t for t, _ in outputs], [(output.mode, 0, 0) for _, output in outputs]),
        airborne=(outputs[0][0], log.end),
        automatic=(outputs[0][0], log.end),
        phase_end=log.end,
        reported_collisions=collisions,
    )


def _tracks(scenario: Scenario, log: Log) -> Tuple[ObstacleTrack, ...]:
    """Return where obstacles truly were; what does not move stands as in the scenario."""
    if not log.obstacles:
        return tuple(ObstacleTrack(obstacle) for obstacle in scenario.obstacles)
    seen: Dict[str, List[Tuple[float, BodyState]]] = {}
    for t, states in log.obstacles:
        for state in states:
            seen.setdefault(state.obstacle.id, []).append((t, state))
    return tuple(_track(samples) for samples in seen.values())


def _track(samples: List[Tuple[float, BodyState]]) -> ObstacleTrack:
    times = [t for t, _ in samples]
    body = samples[0][1].obstacle
    obstacle = Obstacle(body.id, np.array(body.position), np.array(body.size), body.shape)
    centres = Series(times, [state.position for _, state in samples])
    return ObstacleTrack(obstacle, centres, begin=times[0])


def _command(axes: dji.Axes) -> Tuple[float, float, float, float]:
    """Return thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN where not given."""
    if axes[4] != dji.ATTITUDE_THRUST:
        return (np.nan, np.nan, np.nan, axes[3])
    return (axes[2], axes[0], axes[1], axes[3])


def world_of(scenario: Scenario, radius: float) -> World:
    """Return the simulator's own world of a scenario, for a hull of a radius [m]."""
    return World.from_list(
        [_entry(obstacle) for obstacle in scenario.obstacles], radius, scenario.name
    )


def _entry(obstacle: Obstacle) -> Dict[str, object]:
    size: List[float] = [float(v) for v in obstacle.size]
    entry = {
        "id": obstacle.id,
        "shape": obstacle.shape,
        "position": [float(v) for v in obstacle.position],
        "velocity": [float(v) for v in obstacle.velocity],
    }
    if obstacle.shape == "box":
        return {**entry, "size": size}
    if obstacle.shape == "cylinder":
        return {**entry, "radius": size[0], "height": size[1]}
    return {**entry, "radius": size[0]}
