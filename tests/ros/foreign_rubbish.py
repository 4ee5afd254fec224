# SPDX-License-Identifier: MIT
"""A broken controller: sends all that can be wrong in a setpoint to an aircraft that hovers."""

import json
import math
import sys
import time

import rospy
from geometry_msgs.msg import PointStamped, Vector3Stamped
from sensor_msgs.msg import Joy

from dji_sdk.srv import SDKControlAuthority

HOVER = [0.0, 0.0, 38.4, 0.0, 43.0]
NAN, INF = math.nan, math.inf
RUBBISH = {
    "generic": [
        [],
        [0.0, 0.0, 38.4, 0.0],
        [NAN, 0.0, 38.4, 0.0, 43.0],
        [0.0, 0.0, INF, 0.0, 43.0],
        [0.0, 0.0, 38.4, 0.0, NAN],
        [0.0, 0.0, 38.4, 0.0, 300.0],
        [0.0, 0.0, 38.4, 0.0, -1.0],
        [0.0, 0.0, 0.0, 0.0, float(0xC0)],
        [0.0, 0.0, 0.0, 0.0, float(0x30)],
        [0.0, 0.0, 0.0, 0.0, float(0x06)],
        [0.0, 0.0, 900.0, 0.0, 43.0],
        [0.0, 0.0, -20.0, 0.0, 43.0],
        [9.0, 9.0, 38.4, 0.0, 43.0],
        [0.0, 0.0, 38.4, 99.0, 43.0],
        [*HOVER, 7.0],
    ],
    "ENUposition_yaw": [[1.0], [NAN] * 4, [3e38, -3e38, 500.0, 1e30]],
    "ENUvelocity_yawrate": [[1.0, 2.0, 3.0], [0.0, INF, 0.0, 0.0], [3e38, 3e38, 3e38, 3e38]],
    "rollpitch_yawrate_zposition": [[0.0, 0.0, NAN, 0.0], [0.0, 0.0, -5.0, 0.0]],
}


class Rubbish:
    def __init__(self):
        self.velocity, self.position, self.received = None, None, 0
        rospy.Subscriber("dji_sdk/velocity", Vector3Stamped, self.on_velocity, queue_size=100)
        rospy.Subscriber("dji_sdk/local_position", PointStamped, self.on_position)
        self.publishers = {
            suffix: rospy.Publisher(
                f"dji_sdk/flight_control_setpoint_{suffix}", Joy, queue_size=100
            )
            for suffix in RUBBISH
        }

    def on_velocity(self, message):
        self.velocity = message.vector
        self.received += 1

    def on_position(self, message):
        self.position = message.point

    def wait(self, condition, timeout):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not condition() and rospy.Time.now() < end:
            rospy.sleep(0.02)
        return bool(condition())

    @property
    def speed(self):
        v = self.velocity
        return math.sqrt(v.x**2 + v.y**2 + v.z**2)

    def run(self):
        self.wait(lambda: self.velocity and self.position, 20.0)
        for publisher in self.publishers.values():
            self.wait(lambda p=publisher: p.get_num_connections() > 0, 20.0)
        rospy.wait_for_service("dji_sdk/sdk_control_authority", 20.0)
        authority = rospy.ServiceProxy("dji_sdk/sdk_control_authority", SDKControlAuthority)
        self.publishers["generic"].publish(Joy(axes=HOVER))
        rospy.sleep(0.2)
        seen = {"authority": authority(1).result}
        for suffix, messages in RUBBISH.items():
            for axes in messages:
                self.publishers[suffix].publish(Joy(axes=axes))
                rospy.sleep(0.05)
        seen["calm"] = self.wait(lambda: self.speed < 0.1, 20.0)
        for _ in range(1000):
            self.publishers["generic"].publish(Joy(axes=[1e38, -1e38, 1e38, 1e38, 43.0]))
            time.sleep(0.001)
        seen["flood_speed"] = self.speed
        seen["calm_after_flood"] = self.wait(lambda: self.speed < 0.1, 30.0)
        received, begin = self.received, rospy.Time.now()
        rospy.sleep(2.0)
        seen["rate"] = (self.received - received) / (rospy.Time.now() - begin).to_sec()
        seen["height"] = self.position.z
        return seen


if __name__ == "__main__":
    rospy.init_node("rubbish")
    sys.stdout.write(json.dumps(Rubbish().run()) + "\n")
