# SPDX-License-Identifier: MIT
"""Velocity from poses of motion capture: how exact, through drop-outs, and beside a bad marker."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.motion_filter import MotionFilter
from nmpc_control.source_params import load_source_parameters
from uav_sim.disturbance import load_disturbance
from uav_sim.vicon import Vicon

VICON = load_source_parameters().vicon
STEP = 0.005  # [s]
PERIOD = 0.02  # [s] of commands


def path(t):
    """Return position and velocity (3,) of a brisk flight: up to 2 m/s and 2 m/s^2."""
    w = np.array([1.0, 0.8, 0.5])
    size = np.array([2.0, 1.5, 1.0])
    return size * np.sin(w * t), size * w * np.cos(w * t)


def capture(duration, seed, **change):
    """Return the poses that the simulator's motion capture delivers, by stamp."""
    parameters = dataclasses.replace(load_disturbance("indoor").vicon, **change)
    vicon, poses = Vicon(parameters, f"{seed}"), []
    for k in range(round(duration / STEP)):
        poses += vicon.poses(k * STEP, tuple(path(k * STEP)[0]), (0.0, 0.0, 0.0))
    return sorted(poses, key=lambda pose: pose.t)


def filtered(poses):
    """Return errors (n, 3) [m/s] of the velocity at every pose after the first second."""
    motion, errors = MotionFilter(VICON.sigma, VICON.jerk), []
    motion.begin(poses[0].t, poses[0].position)
    for pose in poses[1:]:
        motion.update(pose.t, pose.position)
        if pose.t > 1.0:
            errors.append(motion.motion.velocity - path(pose.t)[1])
    return np.array(errors)


def differences(poses):
    """Return the same of differences over the period of commands."""
    n = round(PERIOD * 100)
    pairs = [(a, b) for a, b in zip(poses, poses[n:]) if a.t > 1.0]
    found = [(np.subtract(b.position, a.position)) / (b.t - a.t) for a, b in pairs]
    return np.array(found) - np.array([path(b.t)[1] for _, b in pairs])


def rms(errors):
    return float(np.sqrt(np.mean(errors**2)))


@pytest.mark.parametrize("dropouts", [0.05, 1.0])
def test_velocity_is_good_to_five_centimetres_per_second(dropouts):
    poses = capture(20.0, 4, dropout_rate=dropouts)
    errors = filtered(poses)
    assert rms(errors) < 0.05
    assert np.abs(errors).max() < 0.4  # after the longest drop-out
    assert rms(differences(poses)) > 2.5 * rms(errors)


def test_what_it_says_of_its_own_error_is_true():
    motion = MotionFilter(VICON.sigma, VICON.jerk)
    poses = capture(10.0, 5, dropout_rate=0.0)
    motion.begin(poses[0].t, poses[0].position)
    assert motion.speed_sigma > 1.0
    for pose in poses[1:]:
        motion.update(pose.t, pose.position)
    assert 0.5 < motion.speed_sigma / rms(filtered(poses)) < 2.0


def test_a_drop_out_of_the_longest_kind_is_carried_on():
    """0.2 s of a turn: better by far than where it was, and than a straight line."""
    poses = [pose for pose in capture(6.0, 6, dropout_rate=0.0) if not 5.0 < pose.t < 5.2]
    motion = MotionFilter(VICON.sigma, VICON.jerk)
    motion.begin(poses[0].t, poses[0].position)
    for pose in poses[1:]:
        if pose.t > 5.1:
            break
        motion.update(pose.t, pose.position)
    end = motion.t + 0.2
    position, velocity = path(end)
    carried = motion.motion.after(0.2)
    straight = motion.motion.position + 0.2 * motion.motion.velocity
    assert np.linalg.norm(carried.position - position) < 0.03
    assert np.linalg.norm(carried.velocity - velocity) < 0.25
    assert np.linalg.norm(carried.position - position) < np.linalg.norm(straight - position)


def test_a_marker_taken_for_another_moves_the_velocity_little():
    poses = capture(4.0, 7, dropout_rate=0.0)
    spoilt = [
        pose._replace(position=tuple(np.add(pose.position, [0.05, 0.0, 0.0]))) if k == 300 else pose
        for k, pose in enumerate(poses)
    ]
    difference = np.abs(filtered(spoilt) - filtered(poses)).max()
    assert 0.0 < difference < 0.15
    assert np.abs(differences(spoilt)).max() > 2.0
