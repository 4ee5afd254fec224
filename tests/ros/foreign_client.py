# SPDX-License-Identifier: MIT
"""A client that knows only dji_sdk: observes topics, asks services, and prints JSON."""

import json
import math
import sys
import time
from collections import defaultdict

import rosgraph
import roslib.message
import rospy
import rosservice
from geometry_msgs.msg import PointStamped, QuaternionStamped, Vector3Stamped
from sensor_msgs.msg import BatteryState, Imu, Joy, NavSatFix
from std_msgs.msg import Float32, UInt8

from dji_sdk.msg import Gimbal
from dji_sdk.srv import (
    CameraAction,
    DroneArmControl,
    DroneTaskControl,
    QueryDroneVersion,
    SDKControlAuthority,
    SetLocalPosRef,
)

TOPICS = {
    "attitude": QuaternionStamped,
    "imu": Imu,
    "velocity": Vector3Stamped,
    "gps_position": NavSatFix,
    "gps_health": UInt8,
    "height_above_takeoff": Float32,
    "local_position": PointStamped,
    "rc": Joy,
    "flight_status": UInt8,
    "battery_state": BatteryState,
    "gimbal_angle": Vector3Stamped,
}
SERVICES = {
    "sdk_control_authority": SDKControlAuthority,
    "drone_arm_control": DroneArmControl,
    "drone_task_control": DroneTaskControl,
    "set_local_pos_ref": SetLocalPosRef,
    "query_drone_version": QueryDroneVersion,
}


class Client:
    """Newest message and number of messages of every topic, and all services."""

    def __init__(self):
        self.newest, self.count = {}, dict.fromkeys(TOPICS, 0)
        self.by_stamp = defaultdict(set)
        self._subscribers = {name: self._subscribe(name) for name in TOPICS}
        for name in SERVICES:
            rospy.wait_for_service(f"dji_sdk/{name}", 20.0)
        self.call = {n: rospy.ServiceProxy(f"dji_sdk/{n}", kind) for n, kind in SERVICES.items()}
        always = set(TOPICS) - {"local_position"}  # that one needs a reference
        for _ in range(5):
            if self.wait(lambda: always <= set(self.newest), 2.0):
                break
            for name in always - set(self.newest):  # rospy may miss a publisher that is just new
                self._subscribers[name].unregister()
                self._subscribers[name] = self._subscribe(name)

    def _subscribe(self, name):
        return rospy.Subscriber(
            f"dji_sdk/{name}", TOPICS[name], self._on_message, name, queue_size=100
        )

    def _on_message(self, message, name):
        self.newest[name] = message
        self.count[name] += 1
        if hasattr(message, "header"):
            self.by_stamp[message.header.stamp.to_nsec()].add(name)

    def wait(self, condition, timeout):
        """Return whether the condition came true within a simulated time [s]."""
        end = rospy.Time.now() + rospy.Duration(timeout)
        while rospy.Time.now() < end and not rospy.is_shutdown():
            if condition():
                return True
            rospy.sleep(0.02)
        return condition()

    def value(self, name):
        message = self.newest[name]
        vector = getattr(message, "vector", None) or getattr(message, "point", None)
        return [vector.x, vector.y, vector.z] if vector else message.data


def observe(client):
    """Rates in simulated time, frames and fields while the aircraft stands."""
    version = client.call["query_drone_version"]()
    reference = client.call["set_local_pos_ref"]().result
    client.wait(lambda: client.count["local_position"] > 0, 5.0)
    latched = rospy.wait_for_message("dji_sdk/local_frame_ref", NavSatFix, 5.0)
    client.by_stamp.clear()
    begin, counted = rospy.Time.now(), dict(client.count)
    wall = time.monotonic()
    rospy.sleep(5.0)
    elapsed, wall_elapsed = (rospy.Time.now() - begin).to_sec(), time.monotonic() - wall
    packets = sorted({tuple(sorted(names)) for names in list(client.by_stamp.values())[2:-2]})
    imu, battery = client.newest["imu"], client.newest["battery_state"]
    position, attitude = client.newest["gps_position"], client.newest["attitude"].quaternion
    return {
        "speed": elapsed / wall_elapsed,
        "rates": {name: (client.count[name] - counted[name]) / elapsed for name in TOPICS},
        "frames": {n: m.header.frame_id for n, m in client.newest.items() if hasattr(m, "header")},
        "packets": packets,
        "stamp_age": (rospy.Time.now() - imu.header.stamp).to_sec(),
        "published": types("publishedTopics"),
        "subscribed": types("subscribedTopics"),
        "services": services(),
        "version": [version.version, version.hardware],
        "reference": reference,
        "latched": [latched.header.frame_id, latched.header.stamp.to_sec(), latched.latitude],
        "gps": [position.latitude, position.status.status, sum(position.position_covariance)],
        "gps_health": client.value("gps_health"),
        "imu": [imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z],
        "same_attitude": imu.orientation == attitude,
        "covariances": [
            *imu.orientation_covariance,
            *imu.angular_velocity_covariance,
            *imu.linear_acceleration_covariance,
        ],
        "battery": [
            battery.percentage,
            battery.voltage,
            battery.current,
            battery.capacity,
            math.isnan(battery.charge) and math.isnan(battery.design_capacity),
            battery.present,
        ],
        "rc": [list(client.newest["rc"].axes), list(client.newest["rc"].buttons)],
        "flight_status": client.value("flight_status"),
    }


def types(which):
    """Types by name below dji_sdk of what the simulator publishes or subscribes to."""
    master = rosgraph.Master("/client")
    publishers, subscribers, _ = master.getSystemState()
    nodes = dict(publishers if which == "publishedTopics" else subscribers)
    return {
        name.split("/dji_sdk/")[1]: kind
        for name, kind in master.getTopicTypes()
        if name.startswith("/dji_sdk/") and "/uav_sim" in nodes.get(name, [])
    }


def services():
    """Types by name of all services below dji_sdk."""
    _, _, names = rosgraph.Master("/client").getSystemState()
    found = [name for name, _ in names if name.startswith("/dji_sdk/")]
    return {name.split("/dji_sdk/")[1]: rosservice.get_service_type(name) for name in found}


def ask(client):
    """Answers of all that an M100's node offers beside flying."""
    answers = {}
    for name, kind in services().items():
        cls = roslib.message.get_service_class(kind)
        try:
            response = rospy.ServiceProxy(f"dji_sdk/{name}", cls)(cls._request_class())
        except rospy.ServiceException as error:
            answers[name] = str(error)
        else:
            answers[name] = [getattr(response, slot) for slot in response.__slots__]
            answers[name] = [
                v if isinstance(v, (bool, int, float, str)) else "" for v in answers[name]
            ]
    gimbal = rospy.Publisher("dji_sdk/gimbal_angle_cmd", Gimbal, queue_size=10)
    client.wait(lambda: gimbal.get_num_connections() > 0, 10.0)
    gimbal.publish(Gimbal(yaw=30.0))
    camera = rospy.ServiceProxy("dji_sdk/camera_action", CameraAction)
    answers["camera"] = [camera(action).result for action in (0, 1, 2, 3)]
    return answers


def main():
    rospy.init_node("foreign_client")
    result = {"observe": observe, "ask": ask}[sys.argv[1]](Client())
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
