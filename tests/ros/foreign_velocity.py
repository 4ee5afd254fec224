# SPDX-License-Identifier: MIT
"""A velocity controller that starts the motors itself and lifts off and lands by setpoints.

No task is used: motors by service, ascent by the generic topic, flight and descent by
ENUvelocity_yawrate, against local_position and height_above_takeoff.
"""

import json
import math
import sys

import rospy
from geometry_msgs.msg import PointStamped, QuaternionStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Float32, UInt8

from dji_sdk.srv import DroneArmControl, SDKControlAuthority, SetLocalPosRef

VELOCITY, UP_VELOCITY, YAW_RATE, GROUND, STABLE = 0x40, 0x00, 0x08, 0x00, 0x01
TARGET, YAW = (3.0, -2.0, 2.5), 1.0  # [m] from the reference, [rad]


def clamp(value, bound):
    return max(-bound, min(bound, value))


class VelocityController:
    def __init__(self):
        self.status, self.height, self.position, self.yaw = None, None, None, None
        self.statuses = []
        rospy.Subscriber("dji_sdk/flight_status", UInt8, self.on_status)
        rospy.Subscriber("dji_sdk/height_above_takeoff", Float32, self.on_height)
        rospy.Subscriber("dji_sdk/local_position", PointStamped, self.on_position)
        rospy.Subscriber("dji_sdk/attitude", QuaternionStamped, self.on_attitude)
        self.generic = rospy.Publisher(
            "dji_sdk/flight_control_setpoint_generic", Joy, queue_size=10
        )
        self.velocity = rospy.Publisher(
            "dji_sdk/flight_control_setpoint_ENUvelocity_yawrate", Joy, queue_size=10
        )
        rospy.wait_for_service("dji_sdk/drone_arm_control", 20.0)
        self.arm = rospy.ServiceProxy("dji_sdk/drone_arm_control", DroneArmControl)

    def on_status(self, message):
        self.status = message.data
        if message.data not in self.statuses[-1:]:
            self.statuses.append(message.data)

    def on_height(self, message):
        self.height = message.data

    def on_position(self, message):
        self.position = message.point

    def on_attitude(self, message):
        q = message.quaternion
        self.yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))

    def repeat(self, step, until, timeout):
        """Call ``step`` at 50 Hz until a condition holds or a time [s] has gone."""
        rate, end = rospy.Rate(50), rospy.Time.now() + rospy.Duration(timeout)
        while not until() and rospy.Time.now() < end:
            step()
            rate.sleep()
        return bool(until())

    def climb(self):
        flag = VELOCITY | UP_VELOCITY | YAW_RATE | GROUND | STABLE
        self.generic.publish(Joy(axes=[0.0, 0.0, 0.8, 0.0, flag]))

    def errors(self):
        here = self.position
        return [TARGET[0] - here.x, TARGET[1] - here.y, TARGET[2] - here.z]

    def approach(self):
        east, north, up = (clamp(0.8 * error, 1.5) for error in self.errors())
        turn = clamp(1.5 * math.remainder(YAW - self.yaw, 2 * math.pi), 0.8)
        self.velocity.publish(Joy(axes=[east, north, up, turn]))

    def sink(self):
        self.velocity.publish(Joy(axes=[0.0, 0.0, -0.6, 0.0]))

    def is_there(self):
        there = max(map(abs, self.errors())) < 0.1
        return there and abs(math.remainder(YAW - self.yaw, 2 * math.pi)) < 0.05

    def run(self):
        self.repeat(lambda: None, lambda: None not in (self.status, self.height, self.yaw), 20.0)
        rospy.ServiceProxy("dji_sdk/set_local_pos_ref", SetLocalPosRef)()
        authority = rospy.ServiceProxy("dji_sdk/sdk_control_authority", SDKControlAuthority)
        seen = {"arm_first": self.arm(1).ack_data, "authority": authority(1).ack_data}
        seen["arm"] = self.arm(1).ack_data
        seen["arm_again"] = self.arm(1).ack_data
        seen["up"] = self.repeat(self.climb, lambda: self.height > 1.5, 15.0)
        seen["disarm_in_air"] = self.arm(0).ack_data
        seen["arrived"] = self.repeat(self.approach, self.is_there, 30.0)
        seen["errors"], seen["yaw"] = self.errors(), self.yaw
        seen["down"] = self.repeat(self.sink, lambda: self.status in (1, 5), 20.0)
        self.repeat(lambda: None, lambda: self.status == 1, 5.0)
        seen["disarm"] = self.arm(0).ack_data
        seen["release"] = authority(0).ack_data
        seen["statuses"] = self.statuses
        return seen


if __name__ == "__main__":
    rospy.init_node("velocity_controller")
    sys.stdout.write(json.dumps(VelocityController().run()) + "\n")
