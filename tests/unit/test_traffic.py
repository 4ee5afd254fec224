# SPDX-License-Identifier: MIT
"""Other vehicles are reported where they said they would be, and silence is not hidden."""

import numpy as np
import pytest

from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import Sighting
from nmpc_control.traffic import Course, Traffic, TrafficParameters

PARAMS = TrafficParameters(radius=0.5, growth=0.1)
AHEAD = np.array([[1.0, 0.0, 2.0], [1.0, 1.0, 2.0]])


def course(t, path=AHEAD):
    return Course(t, np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0]), path, 1.0)


@pytest.fixture
def traffic():
    return Traffic(PARAMS)


def test_a_prediction_says_where_a_vehicle_will_be(traffic):
    traffic.predict("dji2", course(10.0))
    (other,) = traffic.report()
    assert (other.id, list(other.size)) == ("dji2", [0.5])
    np.testing.assert_allclose(
        other.position_at(np.array([10.5, 11.5])), [[0.5, 0, 2], [1, 0.5, 2]]
    )


def test_odometry_counts_where_predictions_end(traffic):
    traffic.predict("dji2", course(10.0))
    traffic.measure("dji2", course(10.1, None))
    assert traffic.report()[0].path is not None
    traffic.measure("dji2", course(10.5, None))
    (other,) = traffic.report()
    assert (other.path, other.stamp) == (None, 10.5)


def hear(memory, t, traffic):
    """Take what is reported as a node's memory would."""
    judged = []
    for o in traffic.report():
        numbers = [tuple(map(float, a)) for a in (o.size, o.position, o.velocity, o.path.ravel())]
        judged.append(Sighting(o.id, o.shape, *numbers, o.path_dt, o.growth, o.stamp))
    memory.hear(t, "/nmpc_traffic", [(s, "") for s in judged])
    return memory.obstacles(t)


def test_a_silent_one_stays_in_the_way_until_it_is_forgotten_by_request(traffic):
    memory = ObstacleMemory(load_obstacle_parameters())
    here = np.array([8.0, 0.0, 2.0])
    traffic.predict("dji2", Course(10.0, here, np.zeros(3), np.tile(here, (9, 1)), 0.1))
    for t in np.arange(10.0, 3600.0, 7.0):
        (other,) = hear(memory, t, traffic)
        assert (other.stamp, list(other.position_at(t))) == (10.0, list(here))
        assert bool(memory.stale(t)) == (t > 12.0)
    traffic.forget()
    assert hear(memory, 3601.0, traffic) == ()
    assert memory.stale(3601.0) == ""
    traffic.predict("dji2", course(3602.0))
    assert len(hear(memory, 3602.0, traffic)) == 1, "who speaks is known again"


def test_one_that_hovers_still_ages(traffic):
    still = Course(10.0, np.zeros(3), np.zeros(3))
    traffic.measure("dji2", still)
    memory = ObstacleMemory(load_obstacle_parameters())
    for t in (10.0, 11.0, 12.0, 13.0):
        hear(memory, t, traffic)
    assert memory.stale(13.0) == "what /nmpc_traffic says of obstacle dji2 is 3.0 s old"
    assert not memory.rejected


def test_after_a_jump_of_the_clock_nobody_is_known(traffic):
    traffic.predict("dji2", course(10.0))
    traffic.measure("dji2", course(10.0, None))
    traffic.forget()
    assert traffic.report() == []
