# SPDX-License-Identifier: MIT
"""A position controller in the manner of DJI's demonstrations: it knows nothing but dji_sdk.

Takes off by task and waits a fixed time, flies a square by position offsets, lands by task.
"""

import json
import math
import sys

import rospy
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import Joy, NavSatFix
from std_msgs.msg import UInt8

from dji_sdk.srv import DroneTaskControl, QueryDroneVersion, SDKControlAuthority, SetLocalPosRef

M100_VERSION = 0x03010A00
M100_ON_GROUND, M100_IN_AIR = 1, 3
TAKE_OFF, LAND = 4, 6
HEIGHT, SIDE, NEAR = 3.0, 2.0, 0.2  # [m]


class PositionDemo:
    """Flies from corner to corner in the callback of local_position, which sets the rate."""

    def __init__(self):
        self.status, self.fix, self.position = None, None, None
        self.corners, self.reached, self.settled = [], [], 0
        self.statuses = []
        for name in ("sdk_control_authority", "drone_task_control", "query_drone_version"):
            rospy.wait_for_service(f"dji_sdk/{name}", 20.0)
        self.authority = rospy.ServiceProxy("dji_sdk/sdk_control_authority", SDKControlAuthority)
        self.task = rospy.ServiceProxy("dji_sdk/drone_task_control", DroneTaskControl)
        self.version = rospy.ServiceProxy("dji_sdk/query_drone_version", QueryDroneVersion)
        self.reference = rospy.ServiceProxy("dji_sdk/set_local_pos_ref", SetLocalPosRef)
        self.setpoint = rospy.Publisher(
            "dji_sdk/flight_control_setpoint_ENUposition_yaw", Joy, queue_size=1
        )
        rospy.Subscriber("dji_sdk/flight_status", UInt8, self.on_status, queue_size=10)
        rospy.Subscriber("dji_sdk/gps_position", NavSatFix, self.on_fix, queue_size=10)
        rospy.Subscriber("dji_sdk/local_position", PointStamped, self.on_position, queue_size=10)

    def on_status(self, message):
        self.status = message.data
        if message.data not in [status for status, _ in self.statuses[-1:]]:
            self.statuses.append((message.data, rospy.Time.now().to_sec()))

    def on_fix(self, message):
        self.fix = message

    def on_position(self, message):
        self.position = message.point
        if not self.corners:
            return
        (x, y), here = self.corners[0], message.point
        dx, dy = x - here.x, y - here.y
        self.setpoint.publish(Joy(axes=[dx, dy, HEIGHT, 0.0]))
        close = math.hypot(dx, dy) < NEAR and abs(HEIGHT - here.z) < NEAR
        self.settled = self.settled + 1 if close else 0
        if self.settled > 25:
            self.reached.append([here.x, here.y, here.z])
            self.corners.pop(0)
            self.settled = 0

    def wait(self, condition, timeout):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not condition() and rospy.Time.now() < end and not rospy.is_shutdown():
            rospy.sleep(0.02)
        return bool(condition())

    def run(self):
        seen = {"messages": self.wait(lambda: self.fix and self.status is not None, 20.0)}
        seen["authority"] = self.authority(1).result
        seen["is_m100"] = self.version().version == M100_VERSION
        seen["reference"] = self.reference().result
        ground = self.fix.altitude
        seen["take_off"] = self.task(TAKE_OFF).result
        rospy.sleep(10.0)
        seen["in_air"] = self.status == M100_IN_AIR
        seen["gained"] = self.fix.altitude - ground
        self.corners = [(SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE), (0.0, 0.0)]
        self.wait(lambda: not self.corners, 60.0)
        seen["reached"] = self.reached
        seen["land"] = self.task(LAND).result
        seen["on_ground"] = self.wait(lambda: self.status == M100_ON_GROUND, 40.0)
        seen["statuses"] = [status for status, _ in self.statuses]
        seen["landed_for"] = self.statuses[-1][1] - self.statuses[-2][1]
        seen["released"] = self.authority(0).result
        return seen


if __name__ == "__main__":
    rospy.init_node("flight_control_demo")
    sys.stdout.write(json.dumps(PositionDemo().run()) + "\n")
