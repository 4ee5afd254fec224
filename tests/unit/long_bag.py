# SPDX-License-Identifier: MIT
"""A synthetic flight of any length, written fast: python long_bag.py FILE [SECONDS].

An hour is 2 million messages. The aircraft circles 0.2 m outside of its reference.
"""

import struct
import sys
from pathlib import Path

import numpy as np
from analysis_bags import FLYING, LANDING, READY, STORE, BagBuilder, header, xyz
from rosbags.rosbag1 import Writer

RADIUS, SPEED, HEIGHT, OFFSET = 5.0, 1.0, 3.0, 0.2
BEFORE, AFTER = 5.0, 5.0  # [s] on the ground
EPOCH = 1000.0  # [s]
RATES = {  # [Hz], 555 in all
    "dji_sdk/attitude": 100,
    "dji_sdk/imu": 100,
    "dji_sdk/velocity": 50,
    "dji_sdk/local_position": 50,
    "dji_sdk/rc": 50,
    "dji_sdk/flight_status": 50,
    "uav_sim/ground_truth": 50,
    "nmpc/odometry": 20,
    "nmpc/reference": 20,
    "nmpc/status": 20,
    "dji_sdk/flight_control_setpoint_generic": 20,
    "nmpc/plan": 10,
    "nmpc/obstacles": 10,
    "dji_sdk/battery_state": 5,
}


def position(t, radius):
    angle = SPEED * np.clip(t, 0.0, None) / RADIUS
    return np.array([radius * np.cos(angle), radius * np.sin(angle), HEIGHT])


def templates():
    """Return topic, type and one serialised message for each topic."""
    builder = BagBuilder()
    identity = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
    builder.add(
        "dji_sdk/attitude", "geometry_msgs/msg/QuaternionStamped", 0, {"quaternion": identity}
    )
    imu = {"orientation": identity, "linear_acceleration": xyz((0, 0, 9.8))}
    builder.add("dji_sdk/imu", "sensor_msgs/msg/Imu", 0, imu)
    builder.add("dji_sdk/velocity", "geometry_msgs/msg/Vector3Stamped", 0, {})
    builder.add("dji_sdk/local_position", "geometry_msgs/msg/PointStamped", 0, {})
    builder.add("dji_sdk/rc", "sensor_msgs/msg/Joy", 0, {"axes": [0, 0, 0, 0, 8000, -10000]})
    builder.add("dji_sdk/flight_status", "std_msgs/msg/UInt8", 0, {"data": 3})
    builder.odometry("uav_sim/ground_truth", 0, (0, 0, 0), (0, 0, 0))
    builder.odometry("nmpc/odometry", 0, (0, 0, 0), (0, 0, 0))
    builder.add("nmpc/reference", "geometry_msgs/msg/PoseStamped", 0, {"header": header(0)})
    builder.status(0, FLYING)
    builder.setpoint(0, 0.01, 0.02, 38.0, 0.0)
    builder.plan(0, 2, 0.001)
    builder.obstacles(0, [("post", (0.0, 0.0, HEIGHT), 1.0), ("far", (30.0, 0.0, 0.0), 1.0)])
    builder.add("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState", 0, {"percentage": 80.0})
    return {topic.lstrip("/"): (kind, bytearray(raw)) for topic, kind, _, raw in builder.messages}


def write(path, seconds):
    """Write a flight of that many seconds between five on the ground before and after it."""
    total = BEFORE + seconds + AFTER
    messages = templates()
    with Writer(path) as writer:
        connections = {
            name: writer.add_connection(f"/{name}", kind, typestore=STORE)
            for name, (kind, _) in messages.items()
        }
        _trajectory(writer, seconds)
        for k in range(round(total * 100)):
            t = k / 100.0
            nanoseconds = round((EPOCH + t) * 1e9)
            stamp = divmod(nanoseconds, 10**9)
            for name, rate in RATES.items():
                if k % (100 // rate):
                    continue
                raw = messages[name][1]
                _fill(name, raw, t - BEFORE, seconds, stamp)
                writer.write(connections[name], nanoseconds, bytes(raw))
    return path


def _trajectory(writer, seconds):
    builder = BagBuilder()
    times = np.arange(0.0, seconds + 0.025, 0.05)
    path = [position(t, RADIUS) for t in times]
    start = EPOCH + BEFORE
    builder.trajectory(start, start, "circles", times, path)
    topic, kind, _, raw = builder.messages[0]
    connection = writer.add_connection(topic, kind, typestore=STORE)
    writer.write(connection, round(start * 1e9), raw)


def _fill(name, raw, t, seconds, stamp):
    if name == "dji_sdk/flight_status":
        raw[0] = 3 if 0.0 <= t <= seconds else 1
        return
    struct.pack_into("<II", raw, 4, *stamp)
    t = min(t, seconds)
    body = 16 + struct.unpack_from("<I", raw, 12)[0]
    if name in ("nmpc/odometry", "uav_sim/ground_truth"):
        body += 4 + struct.unpack_from("<I", raw, body)[0]
        struct.pack_into("<3d", raw, body, *position(t, RADIUS + OFFSET))
    elif name == "dji_sdk/local_position":
        struct.pack_into("<3d", raw, body, *position(t, RADIUS + OFFSET))
    elif name == "nmpc/reference":
        struct.pack_into("<3d", raw, body, *position(t, RADIUS))
    elif name == "nmpc/status":
        raw[body] = FLYING if 0.0 <= t < seconds else (LANDING if t >= seconds else READY)


if __name__ == "__main__":
    write(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 3600.0)
