# SPDX-License-Identifier: MIT
"""A prediction is drawn only for as long as plans are flown."""

import pytest

pytest.importorskip("nmpc_msgs.msg", reason="no ROS messages: build the workspace and source it")

from geometry_msgs.msg import Point, Pose
from visualization_msgs.msg import Marker

from nmpc_control.ros.scene import Scene
from nmpc_msgs.msg import ControllerStatus, Prediction

LINES = {"prediction (red)", "horizon (yellow)"}


@pytest.mark.parametrize(
    ("mode", "stays"),
    [
        (ControllerStatus.MODE_FLYING, True),
        (ControllerStatus.MODE_HOVERING, True),
        (ControllerStatus.MODE_BRAKING, False),
        (ControllerStatus.MODE_MANUAL, False),
    ],
)
def test_the_last_prediction_does_not_stay(mode, stays):
    scene = Scene("world", vehicle_radius=0.5, safety_distance=0.5, text_height=0.5)
    points = [Point(0.0, 0.0, 1.0), Point(1.0, 0.0, 1.0)]
    scene.set_prediction(Prediction(poses=[Pose(position=p) for p in points], references=points))
    assert {marker.ns for marker in scene.changes().markers} == LINES
    scene.set_status(ControllerStatus(mode=mode))
    gone = {marker.ns for marker in scene.changes().markers if marker.action == Marker.DELETE}
    assert gone == (set() if stays else LINES)
