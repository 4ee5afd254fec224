# SPDX-License-Identifier: MIT
"""Flies one of two vehicles into the other and kills the other's driver; prints JSON."""

import json
import sys

import rosgraph
import rospy
from geometry_msgs.msg import Vector3Stamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Joy
from std_msgs.msg import String

from dji_sdk.srv import SDKControlAuthority
from nmpc_msgs.msg import ObstacleArray
from nmpc_msgs.srv import ClearFault, InjectFault

NAMES = ("dji1", "dji2")
TOPICS = {
    "dji_sdk/velocity": Vector3Stamped,
    "obstacles": ObstacleArray,
    "uav_sim/ground_truth": Odometry,
    "uav_sim/collision": String,
}


class Vehicle:
    """Newest messages of one vehicle, and its setpoints."""

    def __init__(self, name):
        self.newest, self.count = {}, dict.fromkeys(TOPICS, 0)
        for topic, kind in TOPICS.items():
            rospy.Subscriber(f"{name}/{topic}", kind, self.on_message, topic, queue_size=100)
        topic = f"{name}/dji_sdk/flight_control_setpoint_ENUvelocity_yawrate"
        self.setpoint = rospy.Publisher(topic, Joy, queue_size=10)
        rospy.wait_for_service(f"{name}/dji_sdk/sdk_control_authority", 20.0)
        self.authority = rospy.ServiceProxy(
            f"{name}/dji_sdk/sdk_control_authority", SDKControlAuthority
        )

    def on_message(self, message, topic):
        self.newest[topic] = message
        self.count[topic] += 1


def wait(condition, timeout):
    end = rospy.Time.now() + rospy.Duration(timeout)
    while rospy.Time.now() < end and not condition():
        rospy.sleep(0.02)
    return condition()


def main():
    rospy.init_node("fleet_client")
    first, second = (Vehicle(name) for name in NAMES)
    for vehicle in (first, second):
        wait(lambda v=vehicle: "obstacles" in v.newest and v.setpoint.get_num_connections(), 20.0)
    result = {"authority": [first.authority(1).result, second.authority(0).result]}
    seen = first.newest["obstacles"].obstacles
    result["around"] = [[o.id, list(o.size), [o.position.x, o.position.y]] for o in seen]
    fastest = 0.0
    while "uav_sim/collision" not in first.newest and rospy.Time.now().to_sec() < 20.0:
        first.setpoint.publish(Joy(axes=[2.0, 0.0, 0.0, 0.0]))
        fastest = max(fastest, second.newest["obstacles"].obstacles[-1].velocity.x)
        rospy.sleep(0.02)
    wait(lambda: "uav_sim/collision" in second.newest, 2.0)
    result["seen_speed"] = fastest
    result["collisions"] = [v.newest["uav_sim/collision"].data for v in (first, second)]
    result["still"] = abs(second.newest["dji_sdk/velocity"].vector.x)

    inject = rospy.ServiceProxy("dji2/uav_sim/inject_fault", InjectFault)
    result["killed"] = inject("node_killed", "{what: driver}", 0.0, 0.0).success
    rospy.sleep(0.2)
    before = dict(first.count), dict(second.count)
    rospy.sleep(0.5)
    result["after"] = {
        topic: [first.count[topic] - before[0][topic], second.count[topic] - before[1][topic]]
        for topic in ("dji_sdk/velocity", "uav_sim/ground_truth")
    }
    state = rosgraph.Master("/fleet_client").getSystemState()
    result["services"] = [name for name, _ in state[2] if name.startswith("/dji2/dji_sdk")]
    clear = rospy.ServiceProxy("dji2/uav_sim/clear_fault", ClearFault)
    before = second.count["dji_sdk/velocity"]
    result["cleared"] = clear("").success
    result["lives"] = wait(lambda: second.count["dji_sdk/velocity"] > before + 10, 5.0)
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
