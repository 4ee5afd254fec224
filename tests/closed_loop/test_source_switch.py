# SPDX-License-Identifier: MIT
"""A flight that changes from Vicon to GPS and back: neither plans nor inputs jump."""

import dataclasses

import numpy as np

from nmpc_control.mode_inputs import PLANNED
from nmpc_control.params import load_parameters
from nmpc_control.scenario import load_scenario
from nmpc_control.source_params import GPS, VICON, load_source_parameters
from uav_sim.closed_loop.flight_record import world_of
from uav_sim.closed_loop.loop import ClosedLoop, fly
from uav_sim.closed_loop.simulate import load_guard_parameters
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.preset import load_preset
from uav_sim.sensors import ErrorParameters

SCENARIO = """
name: change
duration: 6.0
reference: {type: line, start: [0.0, 0.0, 3.0], end: [6.0, 0.0, 3.0]}
weights: outdoor
"""
CHANGES = {2.0: GPS, 4.0: VICON}  # [s] on the trajectory's clock
BOTH = load_source_parameters(position_source=VICON, standby=GPS)
AT_ONCE = dataclasses.replace(
    BOTH, switching=dataclasses.replace(BOTH.switching, blend_time=1e-3, blend_speed=1e3)
)


def surroundings():
    """Indoors, but with GPS that is off by half a metre or so."""
    level = load_disturbance("indoor")
    position = ErrorParameters(white=0.005, drift=0.5, time_constant=60.0)
    sensors = dataclasses.replace(level.sensors, position=position)
    return Disturbance(dataclasses.replace(level, sensors=sensors, gps_health=5), 5)


def fly_with(tmp_path, sources, changes):
    """Return the log, what each change said, and the largest step of state and tilt commanded."""
    file = tmp_path / "change.yaml"
    file.write_text(SCENARIO)
    scenario = load_scenario(str(file))
    parameters = load_parameters("dji_hil", scenario.weights)
    world = world_of(scenario, parameters.vehicle.radius)
    loop = ClosedLoop(
        load_preset("dji_hil"), world, parameters, load_guard_parameters(), surroundings(), sources
    )
    said, pending = [], dict(changes)

    def change(progress):
        start = loop.log.clock_start
        for time in [t for t in pending if start is not None and loop.t >= start + t]:
            controller, guard = loop.sources
            said.append(guard.select(pending.pop(time), loop.t))
            controller.follow(guard.last_switch)

    log = fly(scenario, loop, on_progress=change)
    assert len(said) == len(changes)
    steps = [s for s in log.steps if s.estimate.t > log.clock_start + 1.5]
    places = np.array([s.estimate.vector[:3] for s in steps])
    speeds = np.array([s.estimate.vector[6:9] for s in steps])
    times = np.diff([s.estimate.t for s in steps])
    expected = 0.5 * (speeds[1:] + speeds[:-1]) * times[:, None]
    jump = np.linalg.norm(np.diff(places, axis=0) - expected, axis=1).max()
    tilts = [o.applied[1:3] for t, o in log.outputs if t > log.clock_start + 1.5 and o.applied]
    return loop, said, jump, np.abs(np.diff(tilts, axis=0)).max()


def test_a_change_of_source_in_flight_does_not_jump_and_its_twin_does(tmp_path):
    loop, said, jump, tilt = fly_with(tmp_path, BOTH, CHANGES)
    assert [done for done, _ in said] == [True, True], said
    begun = loop.log.clock_start
    assert all(o.mode in PLANNED for t, o in loop.log.outputs if t > begun)
    assert loop.guard.ladder.rejected == 0
    assert not loop.aircraft.collisions

    _, _, _, plain_tilt = fly_with(tmp_path, BOTH, {})
    _, _, twin_jump, twin_tilt = fly_with(tmp_path, AT_ONCE, CHANGES)
    assert jump < 0.1  # GPS wanders by 0.02 m on each axis from plan to plan
    assert tilt < plain_tilt + 0.02
    assert twin_jump > 0.4
    assert twin_tilt > tilt + 0.1
