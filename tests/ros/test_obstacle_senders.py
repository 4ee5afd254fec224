# SPDX-License-Identifier: MIT
"""Whose silence the port notices, and who is heard without being understood; without a master."""

from io import BytesIO

import numpy as np
import pytest

pytest.importorskip("nmpc_msgs.msg", reason="no ROS messages: build the workspace and source it")

import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import Header

from nmpc_control.estimator import Estimator
from nmpc_control.obstacle_sighting import MAX_OBSTACLES
from nmpc_control.ros import obstacle_port
from nmpc_control.ros.frames import FrameError, Frames
from nmpc_control.ros.obstacle_port import ADDED_TOPIC, KNOWN_TOPIC, TOPIC, ObstaclePort
from nmpc_msgs.msg import Obstacle, ObstacleArray


class World:
    """A port whose clock is set by hand."""

    def __init__(self, monkeypatch):
        self.t, self.is_placed = 100.0, False
        monkeypatch.setattr(obstacle_port.rospy.Time, "now", lambda: rospy.Time.from_sec(self.t))
        monkeypatch.setattr(obstacle_port.rospy, "logwarn", lambda words: None)
        monkeypatch.setattr(obstacle_port, "RETRY_PERIOD", 0.0)
        monkeypatch.setattr(ObstaclePort, "_work", lambda port: None)
        monkeypatch.setattr(Frames, "place", self.place)
        self.port = ObstaclePort("world")

    def place(self, frame_id, t):
        if not self.is_placed:
            raise FrameError(f"frame {frame_id!r} is not known")
        return np.eye(3), np.zeros(3)

    def say(self, *obstacles, topic=TOPIC, sender="/laser", latching="0", frame="world", md5=None):
        data, message = BytesIO(), rospy.AnyMsg()
        ObstacleArray(Header(frame_id=frame), obstacles).serialize(data)
        message._buff = data.getvalue()
        message._connection_header = {
            "callerid": sender,
            "md5sum": md5 or ObstacleArray._md5sum,
            "latching": latching,
        }
        self.port._on_message(topic, message)
        self.port._take_in()

    def look(self, later=0.0):
        self.t += later
        self.port._take_in()
        seen, stale = self.port.look(self.t, Estimator())
        return len(seen), stale


@pytest.fixture
def world(monkeypatch):
    return World(monkeypatch)


def sphere(name="tree", x=20.0, radius=0.5):
    return Obstacle(id=name, size=[radius], position=Point(x, 1.0, 2.0))


CROWD = [sphere(f"tree {i}") for i in range(MAX_OBSTACLES + 1)]


@pytest.mark.parametrize("obstacles", [[sphere()], []])
def test_a_sender_that_repeats_itself_and_falls_silent_is_stale(world, obstacles):
    for _ in range(30):
        world.say(*obstacles)
        assert world.look(0.1) == (len(obstacles), "")
    known, stale = world.look(2.0)
    assert (known, stale) == (len(obstacles), "/laser reported obstacles and is silent for 2.1 s")
    assert world.port.knows("/laser")
    assert world.port.forget("/laser") == len(obstacles)
    assert world.look() == (0, "")
    assert not world.port.knows("/laser")


@pytest.mark.parametrize("how", [{"latching": "1"}, {"topic": ADDED_TOPIC}, {"topic": KNOWN_TOPIC}])
def test_what_is_said_once_and_for_good_is_not(world, how):
    world.say(sphere(), **how)
    assert world.look(600.0) == (1, "")


@pytest.mark.parametrize("latching", ["0", "1"])
@pytest.mark.parametrize("first", [(), (sphere(),)])
@pytest.mark.parametrize(
    ("obstacles", "how", "words"),
    [
        (CROWD, {}, "/laser sends 257 obstacles, at most 256 are taken"),
        ([sphere()], {"md5": "0"}, "/laser sends a type that it does not name, or another version"),
        ([sphere()], {"frame": "nowhere"}, "/laser: frame 'nowhere' is not known"),
    ],
)
def test_a_sender_that_is_not_understood_is_as_good_as_silent(
    world, first, obstacles, how, words, latching
):
    if first:
        world.say(*first, latching=latching)
    for _ in range(20):
        assert world.look(0.1)[1] == ""
        world.say(*obstacles, latching=latching, **how)
    known, stale = world.look(0.2)
    assert known == len(first)
    assert stale.startswith(words)
    world.say(sphere(), latching=latching)
    assert world.look() == (1, ""), "the twin that is understood"


def test_a_list_whose_frame_becomes_known_counts_from_when_it_came(world):
    world.say(sphere(), frame="laser")
    world.look(1.9)
    world.is_placed = True
    assert world.look() == (1, "")
    assert world.look(0.2) == (1, "/laser reported obstacles and is silent for 2.1 s")


def test_scenario_obstacles_that_cannot_be_read_hold_the_aircraft_back_until_they_can(world):
    world.say(*CROWD, topic=KNOWN_TOPIC, sender="/nmpc_controller")
    assert world.look(2.1)[1].startswith("/nmpc_controller sends 257 obstacles")
    world.say(sphere(), topic=KNOWN_TOPIC, sender="/nmpc_controller")
    assert world.look(99.0) == (1, "")


def test_of_a_crowd_the_nearest_to_the_aircraft_count(world):
    aircraft = Estimator()
    aircraft.add_attitude(100.0, (0.0, 0.0, 0.0, 1.0))
    aircraft.add_imu(100.0, (0.0, 0.0, 0.0))
    aircraft.add_velocity(100.0, (0.0, 0.0, 0.0))
    aircraft.add_position(100.0, (0.0, 0.0, 2.0))
    world.say(*CROWD[:MAX_OBSTACLES], sender="/depth")
    world.say(sphere("person", 2.0))
    seen, stale = world.port.look(world.t, aircraft)
    assert (len(seen), stale) == (MAX_OBSTACLES, "")
    assert "person" in [o.id for o in seen]
