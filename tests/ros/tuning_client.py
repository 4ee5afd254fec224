#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Changes parameters of a controller that stands on the ground; prints what it saw as JSON."""

import json
import sys

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header, String
from trajectory_msgs.msg import MultiDOFJointTrajectory

rospy.init_node("tuning_client")
answers, diagnostics = [], []
rospy.Subscriber("nmpc/answer", String, lambda m: answers.append(m.data))
rospy.Subscriber("/diagnostics", DiagnosticArray, diagnostics.append)
target = rospy.Publisher("command/pose", PoseStamped, queue_size=1)
trajectory = rospy.Publisher("command/trajectory", MultiDOFJointTrajectory, queue_size=1)
client = Client("nmpc_controller/tuning", timeout=30)


def change(**values):
    """Return what is in force after a change, of the values named, and the answer."""
    now = client.update_configuration(values)
    return {**{name: now[name] for name in values}, "answer": now["answer"]}


def until(condition):
    while not condition() and not rospy.is_shutdown():
        rospy.rostime.wallsleep(0.02)


def in_diagnostics():
    names = ["nmpc_controller: tuning"]
    found = [s.message for m in diagnostics for s in m.status if s.name in names]
    return found[-1] if found else ""


first = client.get_configuration()
seen = {"first": {name: first[name] for name in ("Q_x", "speed", "safety_distance", "answer")}}
seen["names"] = sorted(set(first) - {"groups", "as_in_files", "answer"})
seen["good"] = change(Q_x=7.5, speed=3.0)
seen["bad"] = change(Q_y=9.0, speed=-1.0)
until(lambda: "refused" in in_diagnostics())
seen["diagnostics"] = in_diagnostics()
seen["near"] = change(safety_distance=0.1)
seen["kept"] = {name: client.get_configuration()[name] for name in ("Q_x", "Q_y", "speed")}
seen["files"] = change(as_in_files=True, Q_x=1.0)
seen["latched"] = rospy.get_param("nmpc_controller/tuning/speed")

until(lambda: target.get_num_connections() and trajectory.get_num_connections())
target.publish(PoseStamped(header=Header(frame_id="map")))
until(lambda: answers and answers[-1].startswith("command/pose"))
trajectory.publish(MultiDOFJointTrajectory(header=Header(frame_id="world")))
until(lambda: answers[-1].startswith("command/trajectory"))
seen["answers"] = answers
sys.stdout.write(json.dumps(seen) + "\n")
