# SPDX-License-Identifier: MIT
"""Small bags with known answers, written with the message definitions of this workspace."""

from pathlib import Path

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

REPOSITORY = Path(__file__).resolve().parents[2]
MAV_COMMAND = """Header header
float64 roll
float64 pitch
float64 yaw_rate
geometry_msgs/Vector3 thrust
"""
TF = "tf2_msgs/msg/TFMessage"
TAKING_OFF, FLYING, HOVERING, LANDING, READY = 2, 3, 4, 6, 1


def workspace_types():
    store = get_typestore(Stores.ROS1_NOETIC)
    types = get_types_from_msg(MAV_COMMAND, "mav_msgs/msg/RollPitchYawrateThrust")
    for path in sorted((REPOSITORY / "src/nmpc_msgs/msg").glob("*.msg")):
        types.update(get_types_from_msg(path.read_text(), f"nmpc_msgs/msg/{path.stem}"))
    types.update(action_types(REPOSITORY / "src/nmpc_msgs/action/FlyTrajectory.action"))
    types.update(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    store.register(types)
    return store


def action_types(path):
    """Return goal and result of an action, as its generator makes messages of them."""
    goal, result, _ = path.read_text().split("\n---\n")
    name = f"nmpc_msgs/msg/{path.stem}"
    types = get_types_from_msg(goal, f"{name}Goal")
    types.update(get_types_from_msg(result, f"{name}Result"))
    around = "Header header\nactionlib_msgs/GoalID goal_id\nnmpc_msgs/{0}Goal goal\n"
    types.update(get_types_from_msg(around.format(path.stem), f"{name}ActionGoal"))
    around = "Header header\nactionlib_msgs/GoalStatus status\nnmpc_msgs/{0}Result result\n"
    types.update(get_types_from_msg(around.format(path.stem), f"{name}ActionResult"))
    return types


STORE = workspace_types()
FIELDS = getattr(STORE, "fielddefs", None) or STORE.FIELDDEFS


def build(msgtype, values):
    """Return a message from nested dicts; what they leave out is zero or empty."""
    fields = {}
    for name, (kind, detail) in FIELDS[msgtype][1]:
        value = values.get(name)
        if kind == Nodetype.NAME:
            fields[name] = build(detail, value or {})
        elif kind == Nodetype.BASE:
            fields[name] = value if value is not None else ("" if detail[0] == "string" else 0)
        elif detail[0][0] == Nodetype.NAME:
            fields[name] = [build(detail[0][1], item) for item in value or []]
        elif detail[0][1][0] == "string":
            fields[name] = list(value or [])
        else:
            length = detail[1] if kind == Nodetype.ARRAY else 0
            numbers = np.zeros(length) if value is None else value
            fields[name] = np.asarray(numbers, dtype=detail[0][1][0])
    return STORE.types[msgtype](**fields)


def header(t, frame="world"):
    nanoseconds = round(t * 1e9)
    stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
    return {"stamp": stamp, "frame_id": frame}


def xyz(vector):
    return dict(zip("xyz", (float(component) for component in vector)))


class BagBuilder:
    """Collects (topic, type, time of recording, raw message), writes them in the order of time."""

    def __init__(self, prefix="", delay=0.003):
        self.prefix = prefix
        self.delay = delay  # [s] from stamp to recording
        self.messages = []
        self.empty = []  # topics and types without messages

    def add(self, topic, msgtype, t, values, recorded=None):
        recorded = t + self.delay if recorded is None else recorded
        raw = bytes(STORE.serialize_ros1(build(msgtype, values), msgtype))
        self.messages.append((f"{self.prefix}/{topic}", msgtype, recorded, raw))

    def odometry(self, topic, t, position, velocity, yaw=0.0):
        pose = {
            "position": xyz(position),
            "orientation": {"z": np.sin(yaw / 2), "w": np.cos(yaw / 2), "x": 0.0, "y": 0.0},
        }
        c, s = np.cos(yaw), np.sin(yaw)
        body = (c * velocity[0] + s * velocity[1], c * velocity[1] - s * velocity[0], velocity[2])
        values = {"header": header(t), "pose": {"pose": pose}}
        values["twist"] = {"twist": {"linear": xyz(body)}}
        self.add(topic, "nav_msgs/msg/Odometry", t, values)

    def trajectory(self, t, start, name, times, positions):
        points = [
            {
                "transforms": [{"translation": xyz(p)}],
                "time_from_start": {"sec": int(s), "nanosec": round((s - int(s)) * 1e9)},
            }
            for s, p in zip(times, positions)
        ]
        values = {"header": header(start), "joint_names": [name], "points": points}
        self.add("nmpc/trajectory", "trajectory_msgs/msg/MultiDOFJointTrajectory", t, values)

    def status(self, t, mode, **values):
        values.update(header=header(t), mode=mode, setpoint_sent=mode in (FLYING, HOVERING))
        self.add("nmpc/status", "nmpc_msgs/msg/ControllerStatus", t, values)

    def setpoint(self, t, roll, pitch, vertical, yaw_rate, flag=0x2B):
        axes = [roll, pitch, vertical, yaw_rate, flag]
        values = {"header": header(t), "axes": axes}
        self.add("dji_sdk/flight_control_setpoint_generic", "sensor_msgs/msg/Joy", t, values)

    def plan(self, t, iterations, solve_time, found=True):
        values = {"header": header(t), "iterations": iterations, "solve_time": solve_time}
        values.update(found=found, goal=2, dt=0.1, horizon=60, states=np.zeros(610))
        self.add("nmpc/plan", "nmpc_msgs/msg/Plan", t, values)

    def obstacles(self, t, spheres, topic="nmpc/obstacles"):
        """Add spheres as (id, centre, radius)."""
        obstacles = [{"id": i, "position": xyz(c), "size": [r]} for i, c, r in spheres]
        values = {"header": header(t), "obstacles": obstacles}
        self.add(topic, "nmpc_msgs/msg/ObstacleArray", t, values)

    def without(self, *suffixes):
        """Return a builder with the same messages but those of topics that end like this."""
        other = BagBuilder(self.prefix, self.delay)
        other.messages = [m for m in self.messages if not m[0].endswith(suffixes)]
        return other

    def write(self, path, compression=None):
        """Write the bag; return its path."""
        writer = Writer(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            connections = {}
            for topic, msgtype in self.empty:
                writer.add_connection(topic, msgtype, typestore=STORE)
            for topic, msgtype, t, raw in sorted(self.messages, key=lambda m: m[2]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, msgtype, typestore=STORE)
                writer.write(connections[topic], round(t * 1e9), raw)
        return path


class Flight:
    """Along x: reference 1 m/s for 10 s, estimate 0.25 m beside it, truth 0.05 m more."""

    start, duration, speed, height = 110.0, 10.0, 1.0, 2.0
    offset = np.array([0.0, 0.25, 0.0])
    drift = np.array([0.0, 0.05, 0.0])
    take_off, land, end = 104.0, 124.0, 128.0
    spheres = (("ball", (5.0, 2.0, 2.0), 0.5), ("far", (5.0, -4.0, 2.0), 1.0))

    def reference(self, t):
        along = self.speed * np.clip(t - self.start, 0.0, self.duration)
        return np.array([along, 0.0, self.height])

    def velocity(self, t):
        moving = self.start <= t <= self.start + self.duration
        return np.array([self.speed if moving else 0.0, 0.0, 0.0])

    def mode(self, t):
        if t < self.take_off or t >= self.end:
            return READY
        if t < self.take_off + 4.0:
            return TAKING_OFF
        if t >= self.land:
            return LANDING
        return FLYING if t < self.start + self.duration else HOVERING

    def build(self, prefix="", name="line"):
        """Return all topics of the flight: state and commands at 50 Hz, plans at 10 Hz."""
        bag = BagBuilder(prefix)
        times = np.arange(0.0, self.duration + 0.025, 0.05)
        path = [self.reference(self.start + t) for t in times]
        bag.obstacles(self.take_off - 2.0, self.spheres)
        bag.trajectory(self.take_off + 4.0, 0.0, name, times, path)
        bag.trajectory(self.start, self.start, name, times, path)
        for k in range(round(50 * self.take_off) - 100, round(50 * self.end) + 50):
            t = k / 50.0
            position = self.reference(t) + self.offset
            bag.odometry("nmpc/odometry", t, position, self.velocity(t), yaw=1.0)
            bag.odometry("uav_sim/ground_truth", t, position + self.drift, self.velocity(t))
            mode = self.mode(t)
            bag.status(t, mode, plans_rejected=k // 500, deadline_misses=k // 50)
            if mode in (FLYING, HOVERING):
                bag.setpoint(t, 0.1, -0.1, 38.0 + 0.1 * (k % 7), 0.2)
            if k % 50 == 0:
                battery = {"header": header(t), "percentage": round(200.0 - t)}
                bag.add("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState", t, battery)
            if k % 5 == 0:
                reference = {"header": header(t), "pose": {"position": xyz(self.reference(t))}}
                bag.add("nmpc/reference", "geometry_msgs/msg/PoseStamped", t, reference)
                bag.add("dji_sdk/flight_status", "std_msgs/msg/UInt8", t, {"data": self.phase(t)})
                bag.plan(t, k // 5 % 3, 0.001 * (1 + k // 5 % 5))
        return bag

    def phase(self, t):
        return 3 if self.take_off + 1.0 <= t < self.end - 1.0 else 1
