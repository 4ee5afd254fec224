# SPDX-License-Identifier: MIT
"""ROS node nmpc_traffic: other vehicles become obstacles of this one.

The frames of the vehicles must be connected to the world frame of this one by tf2, or be it.

ROS Subscribers, of every other vehicle: nmpc/prediction (nmpc_msgs/Prediction), and where that ends
nmpc/odometry (nav_msgs/Odometry). Of this one nmpc/forget_obstacles (std_msgs/String): with the
name of this node all others are forgotten until they speak again.
ROS Publishers: obstacles (nmpc_msgs/ObstacleArray): them, each with the time of its own words.
ROS Parameters:
    ~others (str): their namespaces, as in "/dji2,/dji3".
    ~frame_id (str, world): world frame of this vehicle.
    ~rate (float, 10) [Hz] of the list.
"""

import sys
import threading
from functools import partial
from typing import Any, List, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, Vector3
from nav_msgs.msg import Odometry
from std_msgs.msg import Header, String

from nmpc_control.config import config_directory, from_dict, load_yaml
from nmpc_control.errors import ConfigError, NmpcError
from nmpc_control.obstacle import Obstacle
from nmpc_control.ros.frames import FrameError, Frames, rotation
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.traffic import Course, Traffic, TrafficParameters
from nmpc_msgs.msg import Obstacle as ObstacleMsg
from nmpc_msgs.msg import ObstacleArray, Prediction

_MOST_POSES = 1001  # [1] of a prediction
_WARNING_PERIOD = 5.0  # [s]


class TrafficNode:
    """Callbacks store courses, ``run`` publishes them."""

    def __init__(self, others: Sequence[str], params: TrafficParameters) -> None:
        self._frames = Frames(rospy.get_param("~frame_id", "world"))
        self._period = 1.0 / min(max(rospy.get_param("~rate", 10.0), 1.0), 50.0)
        self._traffic = Traffic(params)
        self._lock = threading.Lock()
        self._publisher = rospy.Publisher("obstacles", ObstacleArray, queue_size=1)
        subscriptions = Subscriptions()
        subscriptions.add("nmpc/forget_obstacles", String, self._on_forget, queue_size=10)
        for other in others:
            name = other.strip("/")
            for topic, kind, take in (
                ("prediction", Prediction, self._on_prediction),
                ("odometry", Odometry, self._on_odometry),
            ):
                subscriptions.add(f"{other}/nmpc/{topic}", kind, partial(take, name))

    def run(self) -> None:
        """Publish until shutdown."""
        last = 0.0
        while not rospy.is_shutdown():
            now = rospy.Time.now()
            with self._lock:
                if now.to_sec() < last - self._period:
                    self._traffic.forget()
                obstacles = self._traffic.report()
            last = now.to_sec()
            header = Header(stamp=now, frame_id=self._frames.world)
            self._publisher.publish(ObstacleArray(header, [_to_msg(o) for o in obstacles]))
            try:
                rospy.sleep(self._period)
            except rospy.ROSTimeMovedBackwardsException:
                continue
            except rospy.ROSInterruptException:
                break

    def _on_forget(self, message: String) -> None:
        if message.data == rospy.get_name():
            rospy.logwarn("told to forget the other vehicles: each is known again when it speaks")
            with self._lock:
                self._traffic.forget()

    def _on_prediction(self, name: str, message: Prediction) -> None:
        count = min(len(message.poses), len(message.twists), len(message.stamps))
        if not 1 <= count <= _MOST_POSES:
            return
        stamps = np.array([stamp.to_sec() for stamp in message.stamps[:count]])
        path_dt = float(stamps[-1] - stamps[0]) / (count - 1) if count > 1 else 0.0
        points = np.array([_row(pose.position) for pose in message.poses[:count]])
        velocity = np.array(_row(message.twists[0].linear))
        self._take(name, message.header.frame_id, stamps[0], points, velocity, path_dt)

    def _on_odometry(self, name: str, message: Odometry) -> None:
        q = message.pose.pose.orientation
        R = rotation(q.x, q.y, q.z, q.w)
        velocity = R @ _row(message.twist.twist.linear)
        points = np.array([_row(message.pose.pose.position)])
        stamp = message.header.stamp.to_sec()
        self._take(name, message.header.frame_id, stamp, points, velocity, 0.0)

    def _take(
        self,
        name: str,
        frame_id: str,
        stamp: float,
        points: np.ndarray,
        velocity: np.ndarray,
        path_dt: float,
    ) -> None:
        """Store a course given by points (M, 3) [m], the first at ``stamp`` [s]."""
        if not np.isfinite([*points.ravel(), *velocity, path_dt, stamp]).all():
            rospy.logwarn_throttle(_WARNING_PERIOD, f"{name} says what is not finite")
            return
        if not self._frames.is_world(frame_id):
            try:
                R, offset = self._frames.place(frame_id, stamp)
            except FrameError as error:
                if not self._frames.is_new:
                    rospy.logwarn_throttle(_WARNING_PERIOD, f"{name}: {error}")
                return
            points, velocity = points @ R.T + offset, R @ velocity
        path = points[1:] if path_dt > 0.0 and len(points) > 1 else None
        course = Course(stamp, points[0], velocity, path, path_dt if path is not None else 0.0)
        with self._lock:
            if path is not None:
                self._traffic.predict(name, course)
            else:
                self._traffic.measure(name, course)


def _to_msg(o: Obstacle) -> ObstacleMsg:
    message = ObstacleMsg(
        id=o.id,
        shape=ObstacleMsg.SPHERE,
        size=list(o.size),
        position=Point(*o.position),
        velocity=Vector3(*o.velocity),
        uncertainty_growth=o.growth,
        stamp=rospy.Time.from_sec(o.stamp),
    )
    if o.path is not None:
        message.predicted_dt = o.path_dt
        message.predicted_path = [Point(*point) for point in o.path]
    return message


def _row(vector: Any) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def other_namespaces(text: str, own: str) -> List[str]:
    """Return the namespaces in a list with commas; raises ConfigError.

    Args:
        text: as of ~others.
        own: this vehicle's namespace.
    """
    others = [f"/{name.strip().strip('/')}" for name in text.split(",") if name.strip().strip("/")]
    if not others or len(set(others)) < len(others) or f"/{own.strip('/')}" in others:
        expected = "namespaces of other vehicles, each once, as in /dji2,/dji3"
        raise ConfigError("parameter", "~others", text, expected)
    return others


def main() -> None:
    """Entry point of the node."""
    rospy.init_node("nmpc_traffic")
    path = config_directory() / "traffic.yaml"
    try:
        others = other_namespaces(rospy.get_param("~others", ""), rospy.get_namespace())
        params = from_dict(TrafficParameters, load_yaml(path), path.name)
    except NmpcError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    TrafficNode(others, params).run()
