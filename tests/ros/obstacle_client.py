#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Tells flight_guard and nmpc_controller of obstacles; prints what they made of it as JSON.

Usage: obstacle_client.py SITUATION..., some of the functions below the class, in this order.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header, String

from nmpc_msgs.msg import ControllerStatus, Obstacle, ObstacleArray
from nmpc_msgs.srv import AddObstacle, RemoveObstacle

QUARTER = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # a left turn


class Client:
    """Keeps the controller's list, and the entries of /diagnostics by node."""

    def __init__(self):
        rospy.init_node("obstacle_client")
        self.diagnostics, self.list, self.stamps, self.others = {}, {}, [], []
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)
        rospy.Subscriber("nmpc/obstacles", ObstacleArray, self._on_list)
        rospy.Subscriber("nmpc/status", ControllerStatus, self._on_status, queue_size=1000)
        self.obstacles = rospy.Publisher("obstacles", ObstacleArray, queue_size=10)
        self.wait(lambda: self.obstacles.get_num_connections() == 2, "two listeners")

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name.endswith(": obstacles"):
                values = {pair.key: pair.value for pair in status.values}
                self.diagnostics[status.name.split(":")[0]] = status.message, values

    def _on_list(self, message):
        self.list = {o.id: o for o in message.obstacles}

    def _on_status(self, message):
        self.stamps.append(message.header.stamp.to_sec())

    def wait(self, condition, what, timeout=15.0):
        end = rospy.Time.now() + rospy.Duration(timeout)
        while not condition():
            if rospy.Time.now() > end:
                sys.exit(f"no {what} within {timeout} s: {self.list} {self.diagnostics}")
            rospy.sleep(0.02)

    def wait_for(self, **values):
        """Return when both nodes' diagnostics say so."""
        wanted = {key.replace("__", ": "): value for key, value in values.items()}

        def said():
            entries = [
                self.diagnostics.get(n, ("", {})) for n in ("flight_guard", "nmpc_controller")
            ]
            return all(e[1].get(k) == v for e in entries for k, v in wanted.items())

        self.wait(said, wanted)

    def run(self, *command):
        """Start another sender."""
        self.others.append(subprocess.Popen(command, stdout=subprocess.DEVNULL))

    def end_others(self):
        while self.others:
            self.others[-1].terminate()
            self.others.pop().wait(20)

    def say(self, *obstacles, ago=0.0, frame="world"):
        stamp = rospy.Time.now() - rospy.Duration(ago)
        self.obstacles.publish(ObstacleArray(Header(stamp=stamp, frame_id=frame), obstacles))


def sphere(name, x=20.0, speed=0.0, radius=0.5):
    velocity = Vector3(speed, 0.0, 0.0)
    return Obstacle(id=name, size=[radius], position=Point(x, 1.0, 2.0), velocity=velocity)


def bad_lists(client):
    """Say every kind of nonsense beside something good, until both nodes have counted all of it."""
    client.run("rostopic", "pub", "-r", "2", "obstacles", "std_msgs/String", "hi")
    mistaken = rospy.Publisher("obstacles", String, queue_size=1)  # by a node that said otherwise
    bird = sphere("bird", speed=1.0)
    for _ in range(3):
        client.say(sphere("tree"), bird, sphere("tree", 9.0), sphere("nan", math.nan))
        rospy.sleep(0.1)
    client.say(sphere("tree"), bird, sphere("negative", radius=-1.0), sphere("fast", speed=99.0))
    rospy.sleep(0.1)
    client.say(sphere("tree"), bird, sphere("", 3.0), sphere("far", 1e6))
    rospy.sleep(0.1)
    client.say(sphere("other"), frame="nowhere")
    rospy.sleep(1.2)  # in which transforms might still come
    client.say(sphere("other"), frame="nowhere")
    rospy.sleep(0.1)
    client.say(sphere("tree"), sphere("bird", 50.0, speed=1.0), ago=100.0)
    rospy.sleep(0.1)
    client.say(sphere("tree"), sphere("bird", 30.0, speed=1.0), ago=-100.0)
    rospy.sleep(0.1)
    mistaken.publish("hello")
    counts = {"rejected__unreadable": "1", "rejected__frame": "2", "rejected__from the future": "1"}
    client.wait_for(known="2", moving="1", **counts)
    seen = {node: entry[1] for node, entry in client.diagnostics.items()}
    client.wait(lambda: "silent" in client.diagnostics["flight_guard"][0], "silence noticed")
    seen["stale"] = client.diagnostics["flight_guard"][0]
    has = [lambda n=n: "rejected: type" in client.diagnostics[n][1] for n in client.diagnostics]
    client.wait(lambda: all(h() for h in has), "refusal of the stranger")
    client.end_others()
    seen["bird"] = client.list["bird"].position.x
    client.say()
    client.wait_for(known="0")
    seen["afterwards"] = client.diagnostics["flight_guard"][0]
    return seen


def other_frames(client):
    """Say what a sensor sees that is mounted and moves."""
    static, moving = tf2_ros.StaticTransformBroadcaster(), tf2_ros.TransformBroadcaster()
    header = Header(stamp=rospy.Time.now(), frame_id="world")
    static.sendTransform(TransformStamped(header, "map", Transform(Vector3(10, 0, 1), QUARTER)))
    wall = Obstacle(id="wall", shape=Obstacle.BOX, size=[1, 2, 3], position=Point(5, 0, 0))
    bird = sphere("bird", speed=1.0)
    bird.predicted_path, bird.predicted_dt = [Point(21.0, 1.0, 2.0)], 1.0
    client.say(wall, frame="map")
    client.wait(lambda: "wall" in client.list, "wall")
    wall = client.list["wall"]
    end = rospy.Time.now() + rospy.Duration(15.0)
    while "bird" not in client.list and rospy.Time.now() < end:
        header = Header(stamp=rospy.Time.now(), frame_id="world")
        moving.sendTransform(
            TransformStamped(header, "sensor", Transform(Vector3(-1, 0, 0), QUARTER))
        )
        client.say(bird, frame="sensor")
        rospy.sleep(0.05)
    bird = client.list["bird"]
    client.say()
    client.wait_for(known="0")
    return {
        "wall": [list(wall.size), [wall.position.x, wall.position.y, wall.position.z]],
        "bird": [bird.position.x, bird.position.z, bird.velocity.x, bird.velocity.y],
        "path": [bird.predicted_path[0].x, bird.predicted_path[0].z],
    }


def services(client):
    """Add, change and remove obstacles; forget a sender."""
    add = rospy.ServiceProxy("add_obstacle", AddObstacle)
    remove = rospy.ServiceProxy("remove_obstacle", RemoveObstacle)
    said = [add("", sphere("mast")), add("", sphere("mast", 8.0)), add("world", sphere("crane"))]
    said += [add("", sphere("bird", speed=1.0)), add("", sphere("thin", radius=0.0))]
    client.say(sphere("tree"), sphere("mast", 3.0))
    client.wait_for(known="4")
    seen = {"known": sorted(client.list), "mast": client.list["mast"].position.x}
    said += [remove("", "tree"), remove("", "mast"), remove("obstacle_client", "")]
    client.wait_for(known="1")
    seen["left"] = sorted(client.list)
    said += [remove("", ""), remove("", ""), remove("/nobody", "")]
    client.wait_for(known="0")
    seen["answers"] = [[answer.success, answer.message] for answer in said]
    return seen


def senders(client):
    """Say something once and for good, and something else without going on."""
    once = "{header: {frame_id: world}, obstacles: [{id: mast, size: [1], position: {x: 9}}]}"
    kind = "nmpc_msgs/ObstacleArray"
    client.run("rostopic", "pub", "-1", "obstacles", kind, once, "__name:=map")
    client.wait_for(known="1", senders="/map (latched)")
    said = lambda: client.diagnostics["flight_guard"][0]  # noqa: E731
    rospy.sleep(4.0)
    seen = {"latched": said()}
    client.say(sphere("tree"))
    client.wait(lambda: "silent" in said(), "silence noticed")
    seen["silent"] = said()
    client.say()
    client.wait_for(known="1")
    seen["empty"] = said()
    client.wait(lambda: "silent" in said(), "silence noticed")
    remove = rospy.ServiceProxy("remove_obstacle", RemoveObstacle)
    seen["removed"] = remove("obstacle_client", "").message
    client.wait(lambda: "silent" not in said(), "silence forgiven")
    client.end_others()
    remove("map", "")
    client.wait_for(known="0")
    return seen


def flood(client):
    """Measure the pace of the guard without, and with 10,000 obstacles at 50 Hz."""
    seconds = 4.0
    rospy.sleep(seconds)
    before, client.stamps = client.stamps, []
    client.run(sys.executable, str(Path(__file__).parent / "obstacle_flood.py"), "10000", "50")
    counted = lambda: "rejected: too many" in client.diagnostics["flight_guard"][1]  # noqa: E731
    client.wait(counted, "refusal")
    client.stamps = []
    rospy.sleep(seconds)
    during = client.stamps
    rejected = int(client.diagnostics["flight_guard"][1]["rejected: too many"])
    client.say(sphere("tree"))
    client.wait_for(known="1")  # others are heard meanwhile
    client.end_others()
    return {"before": pace(before), "during": pace(during), "rejected": rejected}


def pace(stamps):
    gaps = sorted(b - a for a, b in zip(stamps, stamps[1:]))
    rate = len(gaps) / (stamps[-1] - stamps[0])
    return {"rate": rate, "p99": gaps[int(0.99 * len(gaps))], "longest": gaps[-1]}


SITUATIONS = {f.__name__: f for f in (bad_lists, other_frames, services, senders, flood)}

if __name__ == "__main__":
    one = Client()
    try:
        sys.stdout.write(json.dumps({name: SITUATIONS[name](one) for name in sys.argv[1:]}) + "\n")
    finally:
        one.end_others()
