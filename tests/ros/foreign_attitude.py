# SPDX-License-Identifier: MIT
"""An attitude controller in the manner of the drivers that universities wrote for the M100.

Sends roll, pitch, vertical velocity and yaw rate at 100 Hz while the pilot's switch allows it, from
imu, velocity, local_position and rc alone; then holds by the roll-pitch-height topic for a while.
"""

import json
import math
import sys

import rospy
from geometry_msgs.msg import PointStamped, Vector3Stamped
from sensor_msgs.msg import Imu, Joy
from std_msgs.msg import UInt8

from dji_sdk.srv import DroneTaskControl, SDKControlAuthority, SetLocalPosRef

ANGLE, UP_VELOCITY, YAW_RATE, BODY = 0x00, 0x00, 0x08, 0x02
MODE_F, GEAR_OFF = 8000, 0
GRAVITY = 9.81  # [m/s^2]
TARGET = (-2.0, 3.0, 4.0)  # [m] from the reference


class AttitudeController:
    def __init__(self):
        self.imu, self.velocity, self.position, self.rc, self.status = (None,) * 5
        self.largest_rate = 0.0
        rospy.Subscriber("dji_sdk/imu", Imu, self.on_imu, tcp_nodelay=True)
        rospy.Subscriber("dji_sdk/velocity", Vector3Stamped, self.on_velocity)
        rospy.Subscriber("dji_sdk/local_position", PointStamped, self.on_position)
        rospy.Subscriber("dji_sdk/rc", Joy, self.on_rc)
        rospy.Subscriber("dji_sdk/flight_status", UInt8, self.on_status)
        self.generic = rospy.Publisher("dji_sdk/flight_control_setpoint_generic", Joy, queue_size=1)
        self.with_height = rospy.Publisher(
            "dji_sdk/flight_control_setpoint_rollpitch_yawrate_zposition", Joy, queue_size=1
        )
        rospy.wait_for_service("dji_sdk/sdk_control_authority", 20.0)

    def on_imu(self, message):
        self.imu = message
        rates = message.angular_velocity
        self.largest_rate = max(self.largest_rate, abs(rates.x), abs(rates.y))

    def on_velocity(self, message):
        self.velocity = message.vector

    def on_position(self, message):
        self.position = message.point

    def on_rc(self, message):
        self.rc = message.axes

    def on_status(self, message):
        self.status = message.data

    @property
    def allowed(self):
        return self.rc is not None and self.rc[4] == MODE_F and self.rc[5] != GEAR_OFF

    @property
    def errors(self):
        here = self.position
        return [TARGET[0] - here.x, TARGET[1] - here.y, TARGET[2] - here.z]

    def tilt(self):
        """Roll and pitch [rad], FLU, and yaw rate [rad/s] that faces north."""
        q = self.imu.orientation
        yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
        east, north, _ = self.errors
        ax = 0.9 * max(-1.5, min(1.5, east)) - 1.4 * self.velocity.x
        ay = 0.9 * max(-1.5, min(1.5, north)) - 1.4 * self.velocity.y
        ahead = math.cos(yaw) * ax + math.sin(yaw) * ay
        left = math.cos(yaw) * ay - math.sin(yaw) * ax
        turn = max(-0.7, min(0.7, math.remainder(math.pi / 2 - yaw, 2 * math.pi)))
        return [-math.atan2(left, GRAVITY), math.atan2(ahead, GRAVITY)], turn

    def fly(self, send, until, timeout):
        rate, end = rospy.Rate(100), rospy.Time.now() + rospy.Duration(timeout)
        while not until() and rospy.Time.now() < end:
            if self.allowed:
                send()
            rate.sleep()
        return bool(until())

    def by_vertical_velocity(self):
        tilt, turn = self.tilt()
        climb = max(-1.0, min(1.0, self.errors[2]))
        flag = ANGLE | UP_VELOCITY | YAW_RATE | BODY
        self.generic.publish(Joy(axes=[*tilt, climb, turn, flag]))

    def by_height(self):
        tilt, turn = self.tilt()
        self.with_height.publish(Joy(axes=[*tilt, TARGET[2] + 1.0, turn]))

    def run(self):
        wanted = ("imu", "velocity", "rc", "status")
        self.fly(lambda: None, lambda: all(getattr(self, n) is not None for n in wanted), 20.0)
        rospy.ServiceProxy("dji_sdk/set_local_pos_ref", SetLocalPosRef)()
        task = rospy.ServiceProxy("dji_sdk/drone_task_control", DroneTaskControl)
        authority = rospy.ServiceProxy("dji_sdk/sdk_control_authority", SDKControlAuthority)
        seen = {"authority": authority(1).result, "take_off": task(4).result}
        self.fly(lambda: None, lambda: self.status == 3 and self.position.z > 1.1, 15.0)
        rospy.sleep(1.0)
        self.fly(self.by_vertical_velocity, lambda: False, 10.0)
        seen["errors"] = self.errors
        self.fly(self.by_height, lambda: False, 4.0)
        seen["errors_later"], seen["largest_rate"] = self.errors, self.largest_rate
        seen["land"] = task(6).result
        seen["landed"] = self.fly(lambda: None, lambda: self.status == 1, 30.0)
        authority(0)
        return seen


if __name__ == "__main__":
    rospy.init_node("attitude_controller")
    sys.stdout.write(json.dumps(AttitudeController().run()) + "\n")
