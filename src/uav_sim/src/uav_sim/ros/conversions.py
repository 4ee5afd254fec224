# SPDX-License-Identifier: MIT
"""Packets, truth and obstacles as ROS messages, filled as dji_sdk does (doc/dji_sdk.md 2.2)."""

import math
from typing import Any, Callable, Dict, NamedTuple, Sequence, Tuple

import rospy
from geometry_msgs.msg import (
    Point,
    PointStamped,
    Quaternion,
    QuaternionStamped,
    Transform,
    TransformStamped,
    Vector3,
    Vector3Stamped,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu, Joy, NavSatFix
from std_msgs.msg import Float32, Header, String, UInt8

from nmpc_msgs.msg import Obstacle as ObstacleMsg
from nmpc_msgs.msg import ObstacleArray
from uav_sim.body import BodyState
from uav_sim.m100 import Truth
from uav_sim.telemetry import quaternion, to_body
from uav_sim.vicon import ViconPose
from uav_sim.world import Collision

_SHAPES = {"sphere": ObstacleMsg.SPHERE, "cylinder": ObstacleMsg.CYLINDER, "box": ObstacleMsg.BOX}


class Kind(NamedTuple):
    """A telemetry topic: its message type, and how a value becomes one."""

    type: type
    convert: Callable[[rospy.Time, Any], Any]


def to_time(t: float) -> rospy.Time:
    """Return a ROS time of seconds, rounded to a nanosecond."""
    return rospy.Time(0, round(t * 1e9))


def _attitude(stamp: rospy.Time, value: Tuple[float, ...]) -> QuaternionStamped:
    return QuaternionStamped(Header(0, stamp, "body_FLU"), Quaternion(*value))


def _imu(stamp: rospy.Time, value: Any) -> Imu:
    message = Imu(header=Header(0, stamp, "body_FLU"))
    message.orientation = Quaternion(*value.orientation)
    message.angular_velocity = Vector3(*value.angular_velocity)
    message.linear_acceleration = Vector3(*value.linear_acceleration)
    return message


def _vector(stamp: rospy.Time, value: Tuple[float, ...]) -> Vector3Stamped:
    return Vector3Stamped(Header(0, stamp, "ground_ENU"), Vector3(*value))


def _local_position(stamp: rospy.Time, value: Tuple[float, ...]) -> PointStamped:
    return PointStamped(Header(0, stamp, "/local"), Point(*value))


def _place(header: Header, value: Any) -> NavSatFix:
    return NavSatFix(
        header=header,
        latitude=value.latitude,
        longitude=value.longitude,
        altitude=value.altitude,
    )


def _gps_position(stamp: rospy.Time, value: Any) -> NavSatFix:
    return _place(Header(0, stamp, "gps"), value)


def _local_frame_ref(stamp: rospy.Time, value: Any) -> NavSatFix:
    return _place(Header(), value)


def _rc(stamp: rospy.Time, value: Sequence[float]) -> Joy:
    return Joy(Header(0, stamp, "rc"), list(value), [])


def _battery(stamp: rospy.Time, value: float) -> BatteryState:
    return BatteryState(
        header=Header(0, stamp, ""), percentage=value, charge=math.nan, design_capacity=math.nan
    )


def _height(stamp: rospy.Time, value: float) -> Float32:
    return Float32(value)


def _byte(stamp: rospy.Time, value: int) -> UInt8:
    return UInt8(value)


TELEMETRY: Dict[str, Kind] = {
    "rc": Kind(Joy, _rc),
    "attitude": Kind(QuaternionStamped, _attitude),
    "imu": Kind(Imu, _imu),
    "gps_health": Kind(UInt8, _byte),
    "gps_position": Kind(NavSatFix, _gps_position),
    "local_position": Kind(PointStamped, _local_position),
    "local_frame_ref": Kind(NavSatFix, _local_frame_ref),
    "height_above_takeoff": Kind(Float32, _height),
    "velocity": Kind(Vector3Stamped, _vector),
    "battery_state": Kind(BatteryState, _battery),
    "flight_status": Kind(UInt8, _byte),
    "gimbal_angle": Kind(Vector3Stamped, _vector),
}


def truth_to_odometry(
    stamp: rospy.Time, truth: Truth, frame_id: str, child_frame_id: str = "base_link"
) -> Odometry:
    """Return the true pose in the world, and the true twist in axes of the body."""
    message = Odometry(header=Header(0, stamp, frame_id), child_frame_id=child_frame_id)
    message.pose.pose.position = Point(*truth.position)
    message.pose.pose.orientation = Quaternion(*quaternion(*truth.rpy))
    message.twist.twist.linear = Vector3(*to_body(truth.rpy, truth.velocity))
    message.twist.twist.angular = Vector3(*truth.rates)
    return message


def obstacles_to_msg(
    stamp: rospy.Time, states: Sequence[BodyState], frame_id: str
) -> ObstacleArray:
    """Return obstacles as they are at the time of the stamp."""
    message = ObstacleArray(header=Header(0, stamp, frame_id))
    for obstacle, position, velocity in states:
        message.obstacles.append(
            ObstacleMsg(
                id=obstacle.id,
                shape=_SHAPES[obstacle.shape],
                size=list(obstacle.size),
                position=Point(*position),
                velocity=Vector3(*velocity),
            )
        )
    return message


def pose_to_transform(
    stamp: rospy.Time, pose: ViconPose, frame_id: str, child_frame_id: str
) -> TransformStamped:
    """Return a captured pose; vicon_bridge stamps it with the time of capture."""
    message = TransformStamped(Header(0, stamp, frame_id), child_frame_id, Transform())
    message.transform.translation = Vector3(*pose.position)
    message.transform.rotation = Quaternion(*pose.orientation)
    return message


def collision_to_msg(collision: Collision) -> String:
    """Return a collision in words."""
    return String(f"id={collision.id} clearance={collision.clearance:.3f} t={collision.t:.3f}")
