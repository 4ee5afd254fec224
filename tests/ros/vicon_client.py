#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""An operator of a flight indoors; prints what was seen as JSON in the last line.

Vicon is silent before the start, comes, is replaced by another source 0.3 m beside it and back,
goes silent in flight, and comes again for the landing.
"""

import json
import math
import sys

import actionlib
import rospy
from geometry_msgs.msg import Point, PointStamped
from guard_client import Client
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from nmpc_msgs.msg import FlyTrajectoryAction, FlyTrajectoryGoal, PositionSource
from nmpc_msgs.srv import ClearFault, InjectFault, SelectSource

BESIDE = 0.3  # [m] east of the truth
TARGET = (2.0, 1.0, 2.0)


class ViconClient(Client):
    """Also an external source of positions."""

    def __init__(self):
        super().__init__()
        self.collisions, self.source = [], None
        self.beside = rospy.Publisher("world_position", PointStamped, queue_size=1)
        rospy.Subscriber("uav_sim/ground_truth", Odometry, self._on_pose, queue_size=1)
        rospy.Subscriber("uav_sim/collision", String, self.collisions.append)
        rospy.Subscriber("nmpc/position_source", PositionSource, self._on_source)
        for name in ("uav_sim/inject_fault", "uav_sim/clear_fault", "select_source"):
            rospy.wait_for_service(name, 20.0)
        self._inject = rospy.ServiceProxy("uav_sim/inject_fault", InjectFault)
        self.clear = rospy.ServiceProxy("uav_sim/clear_fault", ClearFault)
        self._select = rospy.ServiceProxy("select_source", SelectSource)

    def silence(self):
        self._inject("topic_dropped", "{topic: vicon}", 0.0, 0.0)

    def start(self):
        """Ask until it is granted: on a slow machine READY may end before the question comes."""
        end = rospy.Time.now() + rospy.Duration(30.0)
        answer = self.ask("start")
        while not answer[0] and rospy.Time.now() < end:
            rospy.sleep(0.2)
            answer = self.ask("start")
        return answer

    def fly(self, waypoints):
        """Fly a trajectory; return whether it was flown to its end, and a sentence."""
        action = actionlib.SimpleActionClient("fly_trajectory", FlyTrajectoryAction)
        action.wait_for_server(rospy.Duration(10.0))
        action.send_goal(FlyTrajectoryGoal(waypoints=waypoints, speed=0.8))
        action.wait_for_result(rospy.Duration(40.0))
        result = action.get_result()
        return [result.arrived, result.message]

    def select(self, name, patience=0.0):
        """Ask for a source until it is granted: on a slow machine one may be late at times."""
        end, answer = rospy.Time.now() + rospy.Duration(patience), self._select(name)
        while not answer.success and rospy.Time.now() < end:
            rospy.sleep(0.1)
            answer = self._select(name)
        return [answer.success, answer.message]

    def off(self):
        """Return the true distance [m] from the target."""
        return math.dist(self.position, TARGET)

    def _on_pose(self, message):
        point = PointStamped(header=message.header, point=message.pose.pose.position)
        point.point.x += BESIDE
        self.beside.publish(point)

    def _on_source(self, message):
        self.source = message.source


def main():
    """Run the flight."""
    client = ViconClient()
    seen = {"source": client.source}
    client.silence()
    rospy.sleep(0.5)
    seen["start_silent"] = client.ask("start")
    client.clear("")
    seen["start"] = client.start()
    client.wait("HOVERING")
    rospy.sleep(1.0)
    seen["flown"] = client.fly([Point(0.0, 0.0, 1.5), Point(*TARGET)])
    rospy.sleep(1.0)
    seen["off"] = client.off()
    begun = len(client.statuses)
    seen["select_unheard"] = client.select("gps")
    seen["select"] = client.select("world_position", 10.0)
    rospy.sleep(3.0)
    seen["off_beside"] = client.off()
    seen["source_beside"] = client.source
    seen["back"] = client.select("vicon", 10.0)
    rospy.sleep(3.0)
    seen["off_back"] = client.off()
    seen["modes_switching"] = sorted({status.mode for status in client.statuses[begun:]})
    client.silence()
    silent = rospy.Time.now().to_sec()
    seen["brake_after"] = client.wait("RELEASED", 3.0).header.stamp.to_sec() - silent
    seen["reason"] = client.statuses[-1].reason
    seen["modes"] = client.modes()
    client.clear("")
    seen["start_again"] = client.start()
    client.wait("HOVERING", 10.0)
    seen["land"] = client.ask("land")
    client.wait("READY", 30.0)  # at once after WAITING, which says that it has landed
    seen["height"] = client.position[2]
    seen["collisions"] = len(client.collisions)
    return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main()) + "\n")
