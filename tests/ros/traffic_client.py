#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Two other vehicles that say where they go; prints what /dji1 is told of them as JSON."""

import json
import math
import sys

import rospy
import tf2_ros
from geometry_msgs.msg import (
    Point,
    Pose,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
)
from nav_msgs.msg import Odometry
from std_msgs.msg import Header, String

from nmpc_msgs.msg import ObstacleArray, Prediction

QUARTER = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # a left turn


def prediction(now):
    """Return 1 m/s along x from (5, 0, 2)."""
    message = Prediction(header=Header(stamp=now, frame_id="world"))
    for k in range(4):
        message.stamps.append(now + rospy.Duration.from_sec(0.1 * k))
        message.poses.append(Pose(position=Point(5.0 + 0.1 * k, 0.0, 2.0)))
        message.twists.append(Twist(linear=Vector3(1.0, 0.0, 0.0)))
    return message


def odometry(now):
    """Return 2 m/s ahead, turned left once by the attitude and once by the frame."""
    message = Odometry(header=Header(stamp=now, frame_id="dji3/world"))
    message.pose.pose = Pose(Point(1.0, 0.0, 3.0), QUARTER)
    message.twist.twist.linear.x = 2.0
    return message


def main():
    rospy.init_node("others")
    heard = []
    rospy.Subscriber("/dji1/obstacles", ObstacleArray, heard.append)
    first = rospy.Publisher("/dji2/nmpc/prediction", Prediction, queue_size=1)
    second = rospy.Publisher("/dji3/nmpc/odometry", Odometry, queue_size=1)
    transforms = tf2_ros.StaticTransformBroadcaster()
    header = Header(stamp=rospy.Time.now(), frame_id="world")
    place = Transform(Vector3(10.0, 0.0, 0.0), QUARTER)
    transforms.sendTransform(TransformStamped(header, "dji3/world", place))

    def tell(until, *vehicles):
        end = rospy.Time.now() + rospy.Duration(20.0)
        while not (heard and until(heard[-1])):
            if rospy.Time.now() > end:
                sys.exit(f"last heard: {heard[-1:]}")
            for publisher, make in vehicles:
                publisher.publish(make(rospy.Time.now()))
            rospy.sleep(0.1)
        return heard[-1]

    def age(message):
        return (message.header.stamp - message.obstacles[0].stamp).to_sec()

    both = tell(lambda m: len(m.obstacles) == 2, (first, prediction), (second, odometry))
    dji2, dji3 = both.obstacles
    seen = {
        "ids": [dji2.id, dji3.id],
        "path": [p.x for p in dji2.predicted_path] + [dji2.predicted_dt],
        "dji2": [list(dji2.size), dji2.position.x, dji2.velocity.x, age(both)],
        "dji3": [dji3.position.x, dji3.position.y, dji3.velocity.x, dji3.velocity.y],
    }
    late = tell(lambda m: age(m) > 1.0, (second, odometry))
    seen["silent"] = [late.obstacles[0].position.x, late.obstacles[0].id, len(late.obstacles)]
    forget = rospy.Publisher("/dji1/nmpc/forget_obstacles", String, queue_size=1)
    tell(lambda m: forget.get_num_connections(), (second, odometry))
    forget.publish("/dji1/nmpc_traffic")
    left = tell(lambda m: len(m.obstacles) < 2, (second, odometry))
    left = left if left.obstacles else tell(lambda m: m.obstacles, (second, odometry))
    seen["left"] = [o.id for o in left.obstacles]
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
