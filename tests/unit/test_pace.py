# SPDX-License-Identifier: MIT
"""Among obstacles nobody sprints: the speed is bounded by the reference's, or by what comes."""

import dataclasses

import numpy as np
from problems import parameters, straight_reference

from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.state import VELOCITY, hover_input, hover_state

FAR = Obstacle("far", np.array([40.0, 0.0, 0.0]), np.array([1.0]))
COMING = dataclasses.replace(FAR, velocity=np.array([-3.0, 0.0, 0.0]), stamp=0.0)


def fastest(obstacles, pace=2.5, behind=12.0):
    """Return the greatest speed [m/s] of the plan of an aircraft that is late."""
    p = parameters("compiled", "barrier", time_budget=10.0, max_iterations=100)
    nmpc = Nmpc(dataclasses.replace(p, avoidance=dataclasses.replace(p.avoidance, pace=pace)))
    x_ref = straight_reference(nmpc, speed=1.0)
    x0 = hover_state(x_ref[0, :3] - [behind, 0.0, 0.0])
    plan = nmpc.solve(0.0, x0, x_ref, hover_input(), obstacles)
    return np.linalg.norm(plan.states[:, VELOCITY], axis=1).max()


def test_who_is_late_keeps_the_pace_among_obstacles():
    assert 2.4 < fastest([FAR]) < 2.6  # softened


def test_twin_without_the_bound_it_sprints():
    assert fastest([FAR], pace=0.0) > 3.5


def test_without_obstacles_and_before_fast_ones_it_may():
    assert fastest([]) > 3.5
    assert fastest([COMING]) > 3.5
