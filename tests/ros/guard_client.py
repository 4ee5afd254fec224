#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""An operator who watches what flight_guard does; prints what was seen as JSON in the last line.

Usage: guard_client.py SITUATION, one of the functions below the class.
"""

import json
import math
import os
import signal
import sys
from xmlrpc.client import ServerProxy

import rospy
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Joy
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from dji_sdk.srv import DroneTaskControl
from nmpc_msgs.msg import ControllerStatus

MODES = {
    value: name[5:] for name, value in vars(ControllerStatus).items() if name.startswith("MODE_")
}
LAND = 6


class Client:
    """Keeps every status and setpoint, with the simulated time at which each was made."""

    def __init__(self):
        rospy.init_node("guard_client")
        self.statuses, self.setpoints, self.position = [], [], None
        rospy.Subscriber("nmpc/status", ControllerStatus, self.statuses.append, queue_size=100)
        rospy.Subscriber(
            "dji_sdk/flight_control_setpoint_generic", Joy, self.setpoints.append, queue_size=100
        )
        rospy.Subscriber("uav_sim/ground_truth", Odometry, self._on_truth, queue_size=1)
        self.target = rospy.Publisher("command/pose", PoseStamped, queue_size=1)
        self.rc = rospy.Publisher("dji_sdk/rc", Joy, queue_size=1)

    def _on_truth(self, message):
        p = message.pose.pose.position
        self.position = [p.x, p.y, p.z]

    def ask(self, service):
        rospy.wait_for_service(service, 20.0)
        answer = rospy.ServiceProxy(service, Trigger)()
        return [answer.success, answer.message]

    def wait(self, mode, timeout=40.0):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not self.statuses or MODES[self.statuses[-1].mode] != mode:
            if rospy.Time.now() > end:
                last = self.statuses[-1] if self.statuses else None
                sys.exit(f"no {mode} within {timeout} s: {last}")
            rospy.sleep(0.02)
        return self.statuses[-1]

    def hover(self):
        self.wait("READY")
        answer = self.ask("start")
        self.wait("HOVERING")
        rospy.sleep(1.0)
        return answer

    def go_to(self, x, y, z):
        pose = PoseStamped(header=Header(frame_id="world"))
        pose.pose.position = Point(x, y, z)
        pose.pose.orientation.w = 1.0
        end = rospy.Time.now() + rospy.Duration(20.0)
        while not self.target.get_num_connections() and rospy.Time.now() < end:
            rospy.sleep(0.02)
        self.target.publish(pose)

    def modes(self):
        """Return the modes in the order in which they came."""
        names = [MODES[status.mode] for status in self.statuses]
        return [name for i, name in enumerate(names) if i == 0 or name != names[i - 1]]

    def longest_gap(self, since):
        stamps = [m.header.stamp.to_sec() for m in self.setpoints]
        return max(b - a for a, b in zip(stamps, stamps[1:]) if b > since)

    def land_task_ack(self):
        """Return DJI's answer to a landing task: 1, refused, without control authority."""
        return rospy.ServiceProxy("dji_sdk/drone_task_control", DroneTaskControl)(LAND).ack_data


def kill(node, number):
    """Send a signal to a node, which belongs to this test's own master."""
    node_api = rospy.get_master().lookupNode(node)[2]
    os.kill(ServerProxy(node_api).getPid("/guard_client")[2], number)


def controller_dies():
    """Take off, lose the controller, hold, land."""
    client = Client()
    seen = {"start": client.hover(), "second_start": client.ask("start")}
    client.go_to(10.0, 0.0, 3.0)
    client.wait("FLYING")
    rospy.sleep(1.5)
    seen["hover"] = client.ask("hover")
    client.wait("HOVERING", 1.0)
    rospy.sleep(3.0)
    seen["stopped_at"] = client.position[0]
    kill("/nmpc_controller", signal.SIGKILL)
    died, where = rospy.Time.now().to_sec(), list(client.position)
    braking = client.wait("BRAKING", 3.0)
    seen["takeover"] = braking.header.stamp.to_sec() - died
    rospy.sleep(3.0)
    seen["status"] = [client.statuses[-1].rung, client.statuses[-1].reason]
    seen["flag"] = client.setpoints[-1].axes[4]
    seen["drift"] = math.dist(client.position, where)
    seen["gap"] = client.longest_gap(died)
    seen["land"] = client.ask("land")
    client.wait("WAITING", 60.0)
    rospy.sleep(0.5)
    seen["height"] = client.position[2]
    seen["modes"] = client.modes()
    seen["authority"] = client.statuses[-1].authority
    seen["start_without_plans"] = client.ask("start")
    return seen


def pilot_takes_over():
    """Hover, see the switch leave F for a moment; the stream is silent until a new start."""
    client = Client()
    client.hover()
    client.go_to(5.0, 0.0, 3.0)
    client.wait("FLYING")
    while MODES[client.statuses[-1].mode] != "MANUAL":  # against the simulator's own F
        header = Header(stamp=rospy.Time.now())
        client.rc.publish(Joy(header=header, axes=[0, 0, 0, 0, -8000.0, -10000.0]))
        rospy.sleep(0.005)
    manual = client.statuses[-1].header.stamp.to_sec()
    rospy.sleep(1.0)
    seen = {"modes": client.modes(), "task": client.land_task_ack()}
    last = client.setpoints[-1].header.stamp.to_sec()
    seen["last_setpoint_after"] = last - manual
    client.wait("READY", 5.0)
    seen["start"] = client.ask("start")
    client.wait("HOVERING", 10.0)
    seen["modes"] = client.modes()
    seen["resume"] = client.ask("resume")
    client.wait("FLYING", 5.0)
    client.wait("HOVERING", 20.0)
    seen["arrived_at"] = client.position[0]
    seen["codes"] = [status.reason_code for status in client.statuses]
    seen["resume_again"] = client.ask("resume")
    return seen


SITUATIONS = {f.__name__: f for f in (controller_dies, pilot_takes_over)}

if __name__ == "__main__":
    sys.stdout.write(json.dumps(SITUATIONS[sys.argv[1]]()) + "\n")
