# SPDX-License-Identifier: MIT
"""Waits for the prediction on nmpc/markers; prints how many markers each namespace then holds."""

import json
import time

import rospy
from visualization_msgs.msg import Marker, MarkerArray


def main():
    rospy.init_node("marker_viewer")
    shown = {}

    def on_markers(array):
        for marker in array.markers:
            ids = shown.setdefault(marker.ns, set())
            (ids.add if marker.action == Marker.ADD else ids.discard)(marker.id)

    rospy.Subscriber("nmpc/markers", MarkerArray, on_markers)
    deadline = time.monotonic() + 40.0
    while "prediction (red)" not in shown and time.monotonic() < deadline:
        rospy.rostime.wallsleep(0.1)
    rospy.rostime.wallsleep(3.0)  # the whole scene is sent every 2 s
    print(json.dumps({ns: len(ids) for ns, ids in shown.items()}))  # noqa: T201 (the answer)


if __name__ == "__main__":
    main()
