# SPDX-License-Identifier: MIT
"""In a frame that moves, every entry is judged by its own stamp."""

import numpy as np
import pytest

pytest.importorskip("nmpc_msgs.msg", reason="no ROS messages: build the workspace and source it")

from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting
from nmpc_control.ros.frames import FrameError
from nmpc_control.ros.obstacle_port import MAX_STAMPS, ObstaclePort
from nmpc_control.ros.obstacle_wire import Head

BIRD = Sighting("bird", "sphere", (0.3,), (5.0, 0.0, 2.0), (-1.0, 0.0, 0.0), stamp=100.0)


class Moving:
    """The frame ``sensor`` at x = t - 100 s, remembered for 10 s as by tf2."""

    def __init__(self):
        self.asked = 0

    def is_world(self, frame_id):
        return frame_id == "world"

    def place(self, frame_id, t):
        self.asked += 1
        if frame_id != "sensor" or not 90.0 <= t <= 100.2:
            raise FrameError(f"frame {frame_id!r} is not known at {t} s")
        return np.eye(3), np.array([t - 100.0, 0.0, 0.0])


@pytest.fixture
def port():
    port = ObstaclePort.__new__(ObstaclePort)  # judging needs no ROS
    port.frames = Moving()
    return port


def judge(port, *sightings, frame="sensor"):
    judged = port.judge(Head(100.0, frame, len(sightings), 0), sightings)
    return [(s.id, s.position[0], bad) for s, bad in judged]


def test_an_old_stamp_refuses_its_own_entry_only(port):
    old, nan = BIRD._replace(id="old", stamp=1.0), BIRD._replace(id="nan", size=(np.nan,))
    early = BIRD._replace(id="early", stamp=99.0)
    seen = judge(port, old, nan, BIRD, early)
    assert seen == [
        ("old", 5.0, "frame"),
        ("nan", 5.0, "not finite"),
        ("bird", 5.0, ""),
        ("early", 4.0, ""),
    ]


def test_of_many_stamps_the_newest_are_placed_and_no_more_looked_up(port):
    many = [BIRD._replace(id=str(i), stamp=100.0 - 0.01 * i) for i in range(MAX_OBSTACLES)]
    found = [bad for _, _, bad in judge(port, *many)]
    assert found == [""] * MAX_STAMPS + ["frame"] * (MAX_OBSTACLES - MAX_STAMPS)
    assert port.frames.asked == MAX_STAMPS


@pytest.mark.parametrize("sightings", [(BIRD,), (BIRD, BIRD._replace(stamp=99.0)), ()])
def test_a_frame_that_is_known_at_no_stamp_refuses_the_list(port, sightings):
    judge(port, *sightings)
    with pytest.raises(FrameError):
        judge(port, *sightings, frame="nowhere")
