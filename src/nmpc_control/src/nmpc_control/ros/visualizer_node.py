# SPDX-License-Identifier: MIT
"""Draws a flight for RViz; may run on the ground station, and nothing depends on it.

ROS Subscribers: nmpc/trajectory, nmpc/odometry, nmpc/prediction, nmpc/obstacles, nmpc/room,
nmpc/status, and uav_sim/ground_truth where there is a simulator.

ROS Publishers: nmpc/markers (visualization_msgs/MarkerArray). Green: the whole reference. Blue: the
flown path, with the trajectory's clock every 5 s. Red: the prediction. Yellow: the reference over
the horizon. Thin grey: the true path of a simulation. Red bodies: obstacles; the translucent yellow
shell is ``safety_distance`` off their surface, and the aircraft's hull (blue disc) is to stay out
of it. Yellow edges: the room.

ROS Parameters:
    ~frame_id (str, world): frame of everything.
    ~vehicle (str, dji_hil): file under config/vehicles, for the radius of the hull.
    ~rate (float, 10) [Hz, wall time]: how often changes are drawn.
    ~text_height (float, 0.6) [m].
"""

import sys
import threading
from typing import Callable

import rospy
from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from nmpc_control.errors import NmpcError
from nmpc_control.params import load_parameters
from nmpc_control.ros.scene import Scene
from nmpc_msgs.msg import ControllerStatus, ObstacleArray, Prediction

_REFRESH_PERIOD = 2.0  # [s] after which everything is drawn again, for viewers that missed a part


class VisualizerNode:
    """Feeds messages to the scene, and its changes to whoever looks."""

    def __init__(self) -> None:
        parameters = load_parameters(rospy.get_param("~vehicle", "dji_hil"))
        self._scene = Scene(
            frame=rospy.get_param("~frame_id", "world"),
            vehicle_radius=parameters.vehicle.radius,
            safety_distance=parameters.avoidance.safety_distance,
            text_height=rospy.get_param("~text_height", 0.6),
        )
        self._lock = threading.Lock()
        self._period = 1.0 / max(0.1, rospy.get_param("~rate", 10.0))
        self._publisher = rospy.Publisher("nmpc/markers", MarkerArray, queue_size=2)
        self._listen("nmpc/trajectory", MultiDOFJointTrajectory, self._scene.set_trajectory)
        self._listen("nmpc/odometry", Odometry, self._scene.set_odometry)
        self._listen("nmpc/prediction", Prediction, self._scene.set_prediction)
        self._listen("nmpc/obstacles", ObstacleArray, self._scene.set_obstacles)
        self._listen("nmpc/room", PolygonStamped, self._scene.set_room)
        self._listen("nmpc/status", ControllerStatus, self._scene.set_status)
        self._listen("uav_sim/ground_truth", Odometry, self._scene.set_truth)

    def run(self) -> None:
        """Draw until shutdown, in wall time: eyes do not run faster with a faster simulation."""
        viewers, since_refresh = 0, 0.0
        while not rospy.is_shutdown():
            before, viewers = viewers, self._publisher.get_num_connections()
            since_refresh += self._period
            if viewers:
                whole = viewers > before or since_refresh >= _REFRESH_PERIOD
                with self._lock:
                    array = self._scene.everything() if whole else self._scene.changes()
                if whole:
                    since_refresh = 0.0
                if array.markers:
                    self._publisher.publish(array)
            rospy.rostime.wallsleep(self._period)

    def _listen(self, topic: str, kind: type, take: Callable) -> None:
        def on_message(message: object) -> None:
            with self._lock:
                take(message)

        rospy.Subscriber(topic, kind, on_message, queue_size=5)


def main() -> None:
    """Entry point of the node."""
    rospy.init_node("nmpc_visualizer")
    try:
        node = VisualizerNode()
    except NmpcError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    node.run()
