#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""An operator of a real launch in the namespace it is run in; prints what was seen as JSON.

Usage: m100_client.py asks | flies. ``asks``: what `start` says while nothing is there. ``flies``:
waits for the RC to be the only thing missing, moves its switch, flies a trajectory, and lands.
"""

import json
import sys

import rospy
from dynamic_reconfigure.client import Client as Tuner
from geometry_msgs.msg import Quaternion, Transform, Vector3
from sensor_msgs.msg import Joy
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from nmpc_msgs.msg import ControllerStatus

MODES = {
    value: name[5:] for name, value in vars(ControllerStatus).items() if name.startswith("MODE_")
}
SWITCH = "the RC switch was not seen going to F"


class Client:
    def __init__(self):
        rospy.init_node("m100_client")
        self.modes, self.reasons, self.answers, self.flags = [], [], [], set()
        self.status = None
        rospy.Subscriber("nmpc/status", ControllerStatus, self._on_status, queue_size=100)
        rospy.Subscriber("nmpc/answer", String, lambda m: self.answers.append(m.data))
        rospy.Subscriber(
            "dji_sdk/flight_control_setpoint_generic", Joy, lambda m: self.flags.add(m.axes[4])
        )
        self.rc = rospy.Publisher("dji_sdk/rc", Joy, queue_size=1)
        self.trajectory = rospy.Publisher(
            "command/trajectory", MultiDOFJointTrajectory, queue_size=1
        )

    def _on_status(self, status):
        self.status, mode = status, MODES[status.mode]
        if not self.modes or self.modes[-1] != mode:
            self.modes.append(mode)
        if not self.reasons or self.reasons[-1] != status.reason:
            self.reasons.append(status.reason)

    def until(self, condition, what, timeout=60.0):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not (self.status and condition()):
            if rospy.is_shutdown() or rospy.Time.now() > end:
                sys.exit(f"no {what}: {self.status}\n{self.reasons}\n{self.answers}")
            rospy.sleep(0.02)

    def mode(self, name, timeout=60.0):
        self.until(lambda: MODES[self.status.mode] == name, name, timeout)

    def ask(self, service):
        rospy.wait_for_service(service, 60.0)
        answer = rospy.ServiceProxy(service, Trigger)()
        return [answer.success, answer.message]

    def fly(self, *points):
        message = MultiDOFJointTrajectory(header=Header(frame_id="world"))
        for t, x, y, z in points:
            place = Transform(Vector3(x, y, z), Quaternion(0.0, 0.0, 0.0, 1.0))
            message.points.append(
                MultiDOFJointTrajectoryPoint([place], [], [], rospy.Duration.from_sec(t))
            )

        def answers():
            return [text for text in self.answers if text.startswith("command/trajectory")]

        count = len(answers())
        self.trajectory.publish(message)
        self.until(lambda: len(answers()) > count, "answer")
        return answers()[-1]


def asks():
    client = Client()
    return {"start": client.ask("start")}


def flies():
    client = Client()
    client.until(lambda: client.status.reason.startswith(SWITCH), "wait for the switch", 90.0)
    seen = {"before": client.status.reason, "refused": client.ask("start")}
    while client.status.reason.startswith(SWITCH):  # against the simulator's own F
        axes = [0, 0, 0, 0, -8000.0, -10000.0]
        client.rc.publish(Joy(header=Header(stamp=rospy.Time.now()), axes=axes))
        rospy.sleep(0.005)
    client.mode("READY")
    seen["start"] = client.ask("start")
    client.mode("HOVERING")
    tuner = Tuner("nmpc_controller/tuning", timeout=30)
    seen["faster"] = tuner.update_configuration({"speed": 3.0})["answer"]
    seen["weights"] = tuner.update_configuration({"Q_x": 6.0})["answer"]
    seen["outside"] = client.fly((0, 0, 0, 1.5), (60, 40, 0, 1.5))
    seen["fast"] = client.fly((0, 0, 0, 1.5), (2, 8, 0, 1.5))
    seen["good"] = client.fly((0, 0, 0, 1.5), (4, 1, 0.5, 1.8), (8, 2, 0, 1.5))
    client.mode("FLYING")
    client.until(lambda: client.status.reference_time > 7.5, "end of the trajectory")
    client.mode("HOVERING")
    seen["land"] = client.ask("land")
    client.until(lambda: client.modes[-1] in ("WAITING", "READY"), "landing", 90.0)
    seen["modes"], seen["flags"] = client.modes, sorted(client.flags)
    return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps({"asks": asks, "flies": flies}[sys.argv[1]]()) + "\n")
