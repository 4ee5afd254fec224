#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A link between the aircraft's computer and a workstation, on one machine.

Forwards state and status to names below ``ground/`` and plans back, each after a delay; what the
link is like comes as JSON on ``link``: {"delay": [s], "jitter": [s], "up": bool, "skew": [s]}. The
workstation's clock is /ground/clock, ahead of /clock by the skew. Nothing is lost: TCP.
"""

import json
import random
import threading
import time
from collections import deque

import rospy
from geometry_msgs.msg import PointStamped, QuaternionStamped, Vector3Stamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Empty, String

from nmpc_msgs.msg import ControllerStatus, Plan

DOWN = {
    "dji_sdk/attitude": QuaternionStamped,
    "dji_sdk/imu": Imu,
    "dji_sdk/velocity": Vector3Stamped,
    "dji_sdk/local_position": PointStamped,
    "nmpc/status": ControllerStatus,
    "nmpc/hold_request": Empty,
    "nmpc/return_request": PointStamped,
}
UP = {"nmpc/plan": Plan}
STEP = 0.002  # [s] wall time


class Relay:
    def __init__(self):
        self.link = {"delay": 0.005, "jitter": 0.0, "up": True, "skew": 0.0}
        self._under_way = []
        self._lock = threading.Lock()
        for names, source, target in ((DOWN, "", "ground/"), (UP, "ground/", "")):
            for name, kind in names.items():
                self._forward(source + name, target + name, kind)
        self._clock = rospy.Publisher("/ground/clock", Clock, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("link", String, lambda m: self.link.update(json.loads(m.data)))

    def _forward(self, source, target, kind):
        publisher = rospy.Publisher(target, kind, queue_size=20, tcp_nodelay=True)
        waiting = deque()
        self._under_way.append((publisher, waiting))

        def take(message):
            due = time.monotonic() + self.link["delay"]
            if self.link["jitter"]:
                due += random.expovariate(1.0 / self.link["jitter"])
            with self._lock:
                waiting.append((max(due, waiting[-1][0] if waiting else 0.0), message))

        rospy.Subscriber(source, kind, take, queue_size=20, tcp_nodelay=True)

    def _on_clock(self, message):
        self._clock.publish(Clock(message.clock + rospy.Duration(self.link["skew"])))

    def run(self):
        while not rospy.is_shutdown():
            time.sleep(STEP)
            if not self.link["up"]:
                continue
            for publisher, waiting in self._under_way:
                while waiting and waiting[0][0] <= time.monotonic():
                    with self._lock:
                        _, message = waiting.popleft()
                    publisher.publish(message)


def main():
    rospy.init_node("link_relay")
    Relay().run()


if __name__ == "__main__":
    main()
