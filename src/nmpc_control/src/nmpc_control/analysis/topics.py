# SPDX-License-Identifier: MIT
"""Which topics of a bag say what, whatever namespace they were recorded under."""

from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple


class Role(NamedTuple):
    """A topic by the end of its name, and the type it must have."""

    suffix: str
    msgtype: str


ROLES = {
    "odometry": Role("nmpc/odometry", "nav_msgs/msg/Odometry"),
    "reference": Role("nmpc/reference", "geometry_msgs/msg/PoseStamped"),
    "trajectory": Role("nmpc/trajectory", "trajectory_msgs/msg/MultiDOFJointTrajectory"),
    "status": Role("nmpc/status", "nmpc_msgs/msg/ControllerStatus"),
    "plan": Role("nmpc/plan", "nmpc_msgs/msg/Plan"),
    "obstacles": Role("nmpc/obstacles", "nmpc_msgs/msg/ObstacleArray"),
    "sensed_obstacles": Role("obstacles", "nmpc_msgs/msg/ObstacleArray"),
    "setpoint": Role("dji_sdk/flight_control_setpoint_generic", "sensor_msgs/msg/Joy"),
    "height_setpoint": Role(
        "dji_sdk/flight_control_setpoint_rollpitch_yawrate_zposition", "sensor_msgs/msg/Joy"
    ),
    "velocity_setpoint": Role(
        "dji_sdk/flight_control_setpoint_ENUvelocity_yawrate", "sensor_msgs/msg/Joy"
    ),
    "position_setpoint": Role(
        "dji_sdk/flight_control_setpoint_ENUposition_yaw", "sensor_msgs/msg/Joy"
    ),
    "attitude": Role("dji_sdk/attitude", "geometry_msgs/msg/QuaternionStamped"),
    "imu": Role("dji_sdk/imu", "sensor_msgs/msg/Imu"),
    "velocity": Role("dji_sdk/velocity", "geometry_msgs/msg/Vector3Stamped"),
    "local_position": Role("dji_sdk/local_position", "geometry_msgs/msg/PointStamped"),
    "world_position": Role("world_position", "geometry_msgs/msg/PointStamped"),
    "paper_reference": Role("tune/ref_position", "geometry_msgs/msg/PointStamped"),
    "flight_status": Role("dji_sdk/flight_status", "std_msgs/msg/UInt8"),
    "rc": Role("dji_sdk/rc", "sensor_msgs/msg/Joy"),
    "battery": Role("dji_sdk/battery_state", "sensor_msgs/msg/BatteryState"),
    "truth": Role("uav_sim/ground_truth", "nav_msgs/msg/Odometry"),
    "collision": Role("uav_sim/collision", "std_msgs/msg/String"),
    "goal": Role("fly_trajectory/goal", "nmpc_msgs/msg/FlyTrajectoryActionGoal"),
    "result": Role("fly_trajectory/result", "nmpc_msgs/msg/FlyTrajectoryActionResult"),
    "parameters": Role("nmpc/parameters", "std_msgs/msg/String"),
    "tf": Role("tf", "tf2_msgs/msg/TFMessage"),
    "log": Role("rosout", "rosgraph_msgs/msg/Log"),
}
_COMMON = ("tf", "log")  # of all vehicles, outside of their namespaces
MAV_COMMAND = "mav_msgs/msg/RollPitchYawrateThrust"  # its topic has no usual name

Connections = Dict[str, List[Any]]  # role to the bag's connections


class Selection(NamedTuple):
    """The topics of one vehicle."""

    namespace: str
    connections: Connections
    is_simulation: bool
    remarks: Tuple[str, ...]  # what was found but not used


def select(connections: Sequence[Any], namespace: Optional[str] = None) -> Selection:
    """Return one vehicle's connections by role; without a namespace, the best recorded one's."""
    vehicles: Dict[str, Connections] = {}
    commands: Dict[str, List[Any]] = {}
    common: Connections = {}
    remarks = []
    for connection in connections:
        role, prefix = _role(connection.topic)
        if role in _COMMON:
            if connection.msgtype == ROLES[role].msgtype:
                common.setdefault(role, []).append(connection)
        elif prefix.endswith("/uav_sim"):
            continue  # the simulator's own truth, not another vehicle's
        elif role is not None and connection.msgtype == ROLES[role].msgtype:
            vehicles.setdefault(prefix, {}).setdefault(role, []).append(connection)
        elif connection.msgtype == MAV_COMMAND:
            commands.setdefault(connection.topic, []).append(connection)
        elif role not in (None, "sensed_obstacles"):
            remarks.append(f"{connection.topic} has type {connection.msgtype}: not read")
    if namespace is None:
        chosen = max(vehicles, key=lambda prefix: _weight(vehicles[prefix]), default="")
    else:
        chosen = namespace.rstrip("/")
    if len(vehicles) > 1:
        names = ", ".join(sorted(prefix or "/" for prefix in vehicles))
        remarks.append(f"topics of several vehicles ({names}): evaluated {chosen or '/'}")
    found = vehicles.get(chosen, {})
    own = [group for topic, group in commands.items() if topic.startswith(chosen + "/")]
    if "setpoint" not in found and own:
        found["mav_command"] = max(own, key=lambda group: sum(c.msgcount for c in group))
    if found:
        found.update(common)
    if "odometry" in found:
        found.pop("tf", None)  # says nothing more, and there is much of it
    if any(connection.msgcount for connection in found.get("obstacles", ())):
        found.pop("sensed_obstacles", None)  # the controller's own list is the one that counts
    is_simulation = any("uav_sim" in connection.topic.split("/") for connection in connections)
    return Selection(chosen, found, is_simulation, tuple(remarks))


def _role(topic: str) -> Tuple[Optional[str], str]:
    """Return the role with the longest matching suffix, and what stands before it."""
    path = "/" + topic.lstrip("/")
    fitting = [role for role in ROLES if path.endswith("/" + ROLES[role].suffix)]
    if not fitting:
        return None, ""
    role = max(fitting, key=lambda name: len(ROLES[name].suffix))
    return role, path[: -len(ROLES[role].suffix) - 1]


def _weight(connections: Connections) -> Tuple[int, int]:
    return len(connections), sum(c.msgcount for group in connections.values() for c in group)
