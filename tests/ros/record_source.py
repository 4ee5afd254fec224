#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Publishes 100 kB of noise every 20 ms from when somebody listens."""

import base64
import os

import rospy
from std_msgs.msg import String

rospy.init_node("record_source")
publisher = rospy.Publisher("nmpc/noise", String, queue_size=100)
while not publisher.get_num_connections() and not rospy.is_shutdown():
    rospy.rostime.wallsleep(0.05)
while not rospy.is_shutdown():
    publisher.publish(base64.b64encode(os.urandom(75_000)).decode())
    rospy.rostime.wallsleep(0.02)
