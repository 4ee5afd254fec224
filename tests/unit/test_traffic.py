# SPDX-License-Identifier: MIT
"""Other vehicles are reported where they said they would be, and silence is not hidden."""

import numpy as np
import pytest

from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import Sighting
from nmpc_control.traffic import Course, Traffic, TrafficParameters

PARAMS = TrafficParameters(radius=0.5, growth=0.1, forget_after=30.0)
AHEAD = np.array([[1.0, 0.0, 2.0], [1.0, 1.0, 2.0]])


def course(t, path=AHEAD):
    return Course(t, np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0]), path, 1.0)


@pytest.fixture
def traffic():
    return Traffic(PARAMS)


def test_a_prediction_says_where_a_vehicle_will_be(traffic):
    traffic.predict("dji2", course(10.0))
    ((other,), gone) = traffic.report(10.1)
    assert (other.id, list(other.size), gone) == ("dji2", [0.5], [])
    np.testing.assert_allclose(
        other.position_at(np.array([10.5, 11.5])), [[0.5, 0, 2], [1, 0.5, 2]]
    )


def test_odometry_counts_where_predictions_end(traffic):
    traffic.predict("dji2", course(10.0))
    traffic.measure("dji2", course(10.1, None))
    assert traffic.report(10.1)[0][0].path is not None
    traffic.measure("dji2", course(10.5, None))
    (other,), _ = traffic.report(10.5)
    assert (other.path, other.stamp) == (None, 10.5)


def test_a_silent_one_keeps_the_time_of_its_last_words_and_is_dropped_late(traffic):
    traffic.predict("dji2", course(10.0))
    (other,), _ = traffic.report(39.9)
    assert other.stamp == 10.0
    assert traffic.report(40.1) == ([], ["dji2"])
    assert traffic.report(40.2) == ([], [])


def test_one_that_hovers_still_ages(traffic):
    still = Course(10.0, np.zeros(3), np.zeros(3))
    traffic.measure("dji2", still)
    (other,), _ = traffic.report(10.0)
    sighting = Sighting(
        other.id, other.shape, tuple(other.size), tuple(other.position), tuple(other.velocity)
    )
    path = tuple(other.path.ravel())
    sighting = sighting._replace(path=path, path_dt=other.path_dt, stamp=other.stamp)
    memory = ObstacleMemory(load_obstacle_parameters())
    for t in (10.0, 11.0, 12.0, 13.0):
        memory.hear(t, "/nmpc_traffic", [(sighting, "")])
    assert memory.stale(13.0) == "what /nmpc_traffic says of obstacle dji2 is 3.0 s old"
    assert not memory.rejected


def test_after_a_jump_of_the_clock_nobody_is_known(traffic):
    traffic.predict("dji2", course(10.0))
    traffic.measure("dji2", course(10.0, None))
    traffic.start_anew()
    assert traffic.report(1.0) == ([], [])
