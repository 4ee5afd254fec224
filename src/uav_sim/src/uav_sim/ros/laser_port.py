# SPDX-License-Identifier: MIT
"""The scans of a vehicle's laser as ROS sees them.

Publishers, below the vehicle's namespace:
    scan (sensor_msgs/LaserScan): in the frame ``laser``; one scan is taken at one instant.
    /tf: base_link to ``laser`` with each scan; it moves only where a gimbal levels the scanner.
"""

from typing import Sequence

import numpy as np
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from tf2_ros import TransformBroadcaster

from uav_sim.laser import Laser, rotation
from uav_sim.ros.ports import Ports

QUEUE = 5


class LaserPort:
    """Publishes scans and where the scanner sits."""

    def __init__(self, laser: Laser, ports: Ports) -> None:
        self._laser = laser
        self._frames = (ports.name("base_link"), ports.name("laser"))
        self._scan = ports.publisher("scan", LaserScan, QUEUE)
        self._transforms = TransformBroadcaster()

    def publish(self, stamp: rospy.Time, ranges: np.ndarray, rpy: Sequence[float]) -> None:
        """Publish ranges (n,) [m] taken at an attitude roll, pitch, yaw [rad]."""
        self._transforms.sendTransform(self._mount(stamp, rpy))
        self._scan.publish(scan_to_msg(self._laser, ranges, stamp, self._frames[1]))

    def _mount(self, stamp: rospy.Time, rpy: Sequence[float]) -> TransformStamped:
        p = self._laser.parameters
        steadied = np.eye(3)
        if p.level:
            steadied = rotation(rpy).T @ rotation((0.0, 0.0, rpy[2]))
        message = TransformStamped(
            header=Header(0, stamp, self._frames[0]), child_frame_id=self._frames[1]
        )
        message.transform.translation = Vector3(*(steadied @ np.asarray(p.mount_position)))
        attitude = Rotation.from_matrix(steadied @ rotation(p.mount_rpy))
        message.transform.rotation = Quaternion(*attitude.as_quat())
        return message


def scan_to_msg(laser: Laser, ranges: np.ndarray, stamp: rospy.Time, frame_id: str) -> LaserScan:
    """Return ranges (n,) [m] as a message."""
    p = laser.parameters
    return LaserScan(
        header=Header(0, stamp, frame_id),
        angle_min=p.angle_min,
        angle_max=float(laser.angles[-1]),
        angle_increment=p.angle_increment,
        time_increment=0.0,
        scan_time=1.0 / p.rate,
        range_min=p.range_min,
        range_max=p.range_max,
        ranges=ranges.tolist(),
    )
