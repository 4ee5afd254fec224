# SPDX-License-Identifier: MIT
"""A bare 50 Hz process that hears the attitude and publishes: what this machine does to any such.

ROS Subscribers: dji_sdk/attitude. ROS Publishers: bare_stream (sensor_msgs/Joy): stamp of the tick;
axes: age [s] of the newest attitude when the message left, NaN before there is one.
"""

import math

import rospy
from geometry_msgs.msg import QuaternionStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

RATE = 50.05  # [Hz] a hair off, so that its phase against the telemetry sweeps


def main() -> None:
    """Entry point of the node."""
    rospy.init_node("bare_stream")
    newest = [math.nan]  # [s]

    def on_attitude(message: QuaternionStamped) -> None:
        newest[0] = message.header.stamp.to_sec()

    rospy.Subscriber(
        "dji_sdk/attitude", QuaternionStamped, on_attitude, queue_size=1, tcp_nodelay=True
    )
    publisher = rospy.Publisher("bare_stream", Joy, queue_size=1, tcp_nodelay=True)
    rate = rospy.Rate(RATE)
    try:
        while not rospy.is_shutdown():
            now, stamp = rospy.Time.now(), newest[0]
            age = rospy.Time.now().to_sec() - stamp
            publisher.publish(Joy(header=Header(stamp=now), axes=[age]))
            rate.sleep()
    except rospy.ROSInterruptException:
        pass
