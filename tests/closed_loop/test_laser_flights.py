# SPDX-License-Identifier: MIT
"""Laser tracking from the simulated aircraft itself: its tilt, its delays, its noisy telemetry."""

import dataclasses
import math

import numpy as np
import pytest

from nmpc_control.laser_tracking.parameters import load_laser_parameters
from nmpc_control.laser_tracking.poses import PoseHistory
from nmpc_control.laser_tracking.scan import Scan
from nmpc_control.laser_tracking.tracker import LaserTracker
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.laser import Laser, load_laser
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset
from uav_sim.world import World

pytestmark = pytest.mark.long

VELOCITY = float(0x49)  # control byte: east, north, up [m/s], yaw rate [rad/s], ground frame
START = 50.0  # [s]
PARAMETERS = load_laser_parameters()
SETTLE = 2.0  # [s]
CROSSING = [
    {
        "id": "a",
        "shape": "cylinder",
        "position": [8.5, -3.0, 3.0],
        "radius": 0.3,
        "height": 16.0,
        "velocity": [0.0, 1.0, 0.0],
    },
]


def weave(t):
    """East, north, up [m/s] and yaw rate [rad/s]: to and fro at up to 1.5 m/s, turning."""
    return 0.8 * math.sin(1.1 * t), 1.5 * math.cos(0.9 * t), 0.0, 0.25 * math.cos(0.7 * t)


def track(preset, level, laser, seed, duration=4.0, parameters=PARAMETERS):
    """Return errors (k, 2) of position [m] and velocity [m/s] of the only obstacle, and the ids.

    Positions are compared in the frame of ``local_position``: its slow error is not the laser's.
    """
    plant = load_preset(preset)
    world = World.from_list(CROSSING, plant.radius)
    sim = SimulatedM100(plant, world, Disturbance(load_disturbance(level), seed))
    sim.laser = Laser(load_laser(laser), str(seed))
    sim.place((0.0, 0.0, 3.0), authority=True)
    tracker, poses = LaserTracker(parameters), PoseHistory(parameters.pose)
    hear = {
        "imu": lambda t, v: poses.estimator.add_imu(t, v.angular_velocity),
        "velocity": poses.estimator.add_velocity,
        "local_position": poses.estimator.add_position,
        "attitude": poses.add_attitude,
    }
    p, angles = sim.laser.parameters, sim.laser.angles
    rows, ids, k = [], set(), 0
    while sim.t < duration:
        if k % 4 == 0:
            sim.setpoint("generic", (*weave(sim.t), VELOCITY))
        k += 1
        for packet in sim.step():
            if packet.topic in hear:
                hear[packet.topic](START + packet.t, packet.value)
        if sim.new_scan is None or sim.t < 0.3:
            continue
        limits = (float(angles[-1]), p.angle_increment, 0.0, p.range_min, p.range_max)
        tracker.update(Scan(START + sim.t, p.angle_min, *limits, sim.new_scan), poses)
        if sim.t < SETTLE:
            continue
        (state,) = sim.sensed_obstacles
        found = tracker.obstacles()
        off = [float(np.hypot(*(o.position[:2] - state.position[:2]))) for o in found] or [1.0]
        nearest = int(np.argmin(off))
        velocity = found[nearest].velocity[:2] if found else np.zeros(2)
        rows.append((off[nearest], float(np.hypot(*(velocity - state.velocity[:2])))))
        ids.add(found[nearest].id if found else None)
    return np.array(rows), ids, len(tracker.obstacles())


@pytest.mark.parametrize(
    ("preset", "level", "laser"),
    [
        ("dji_hil", "none", "utm_30lx"),
        ("eth", "none", "ust_10lx"),
        ("dji_hil", "outdoor", "utm_30lx"),
    ],
)
def test_a_walker_seen_from_an_aircraft_that_weaves(preset, level, laser):
    rows, ids, count = track(preset, level, laser, seed=2)
    assert ids == {"laser_1"} and count == 1
    assert rows[:, 0].max() < 0.15 and rows[:, 1].max() < 0.3


def test_without_carrying_poses_on_their_noise_would_be_motion():
    raw = dataclasses.replace(PARAMETERS.pose, position_time=0.01, attitude_time=0.01)
    parameters = dataclasses.replace(PARAMETERS, pose=raw)
    rows, _, _ = track("dji_hil", "outdoor", "utm_30lx", seed=2, parameters=parameters)
    assert rows[:, 1].max() > 0.35
