#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Publishes lists of obstacles as fast as a runaway node would.

Usage: obstacle_flood.py COUNT RATE. Written once, or this program would be too slow to be a flood.
"""

import sys
from io import BytesIO

import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import Header

from nmpc_msgs.msg import Obstacle, ObstacleArray


class Written(ObstacleArray):
    """A message that is already bytes."""

    def serialize(self, buffer):
        buffer.write(self.written)


def main():
    count, rate = int(sys.argv[1]), float(sys.argv[2])
    rospy.init_node("flood")
    publisher = rospy.Publisher("obstacles", Written, queue_size=1)
    some = [
        Obstacle(id=f"flood {i}", size=[0.5], position=Point(50.0, 0.1 * i, 5.0), shape=0)
        for i in range(count)
    ]
    buffer = BytesIO()
    ObstacleArray(Header(frame_id="world"), some).serialize(buffer)
    message = Written()
    message.written = buffer.getvalue()
    ticks = rospy.Rate(rate)
    while not rospy.is_shutdown():
        publisher.publish(message)
        ticks.sleep()


if __name__ == "__main__":
    main()
