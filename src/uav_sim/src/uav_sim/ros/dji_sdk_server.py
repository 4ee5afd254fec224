# SPDX-License-Identifier: MIT
"""The topics and services of dji_sdk's node on an M100, served by a simulated one."""

from threading import Lock
from typing import Any, Sequence

import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import String

from dji_sdk.msg import GPSUTC, FCTimeInUTC, MobileData, PayloadData, VOPosition
from dji_sdk.srv import (
    Activation,
    ActivationResponse,
    DroneArmControl,
    DroneArmControlResponse,
    DroneTaskControl,
    DroneTaskControlResponse,
    QueryDroneVersion,
    QueryDroneVersionResponse,
    SDKControlAuthority,
    SDKControlAuthorityResponse,
    SetLocalPosRef,
    SetLocalPosRefResponse,
)
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.conversions import TELEMETRY
from uav_sim.setpoint import FLAGS, TOPIC_PREFIX
from uav_sim.telemetry import Packet

QUEUE = 10  # of every publisher and subscriber of dji_sdk (doc/dji_sdk.md 1)
LATCHED = "local_frame_ref"
FIRMWARE = 0x03010A00  # 3.1.10.0, an M100's (doc/dji_sdk.md 4)

# Advertised on an M100, but no message ever comes (doc/dji_sdk.md 2.2). The NMEA sentence of time
# synchronisation is left out: its message package is no part of this workspace.
SILENT = {
    "vo_position": VOPosition,
    "time_sync_gps_utc": GPSUTC,
    "time_sync_fc_time_utc": FCTimeInUTC,
    "time_sync_pps_source": String,
    "from_mobile_data": MobileData,
    "from_payload_data": PayloadData,
}


class DjiSdkServer:
    """Publishes packets; hands setpoints and requests to the simulator, under its lock."""

    def __init__(self, sim: SimulatedM100, lock: Lock) -> None:
        self._sim = sim
        self._lock = lock
        self._publishers = {
            topic: rospy.Publisher(
                f"dji_sdk/{topic}", kind.type, queue_size=QUEUE, latch=topic == LATCHED
            )
            for topic, kind in TELEMETRY.items()
        }
        self._silent = [
            rospy.Publisher(f"dji_sdk/{topic}", message, queue_size=QUEUE)
            for topic, message in SILENT.items()
        ]
        for name, service, handler in (
            ("sdk_control_authority", SDKControlAuthority, self._on_authority),
            ("drone_arm_control", DroneArmControl, self._on_arm),
            ("drone_task_control", DroneTaskControl, self._on_task),
            ("set_local_pos_ref", SetLocalPosRef, self._on_reference),
            ("activation", Activation, self._on_activation),
            ("query_drone_version", QueryDroneVersion, self._on_version),
        ):
            rospy.Service(f"dji_sdk/{name}", service, handler)
        for suffix in FLAGS:
            rospy.Subscriber(
                f"dji_sdk/{TOPIC_PREFIX}{suffix}",
                Joy,
                self._on_setpoint,
                callback_args=suffix,
                queue_size=QUEUE,
                tcp_nodelay=True,
            )

    def publish(self, stamp: rospy.Time, packets: Sequence[Packet]) -> None:
        """Publish packets with the stamp of their receipt."""
        for topic, _, value in packets:
            self._publishers[topic].publish(TELEMETRY[topic].convert(stamp, value))

    def _on_setpoint(self, message: Joy, suffix: str) -> None:
        with self._lock:
            receipt = self._sim.setpoint(suffix, message.axes)
        if not receipt.accepted:
            rospy.logwarn_throttle(1.0, f"setpoint {suffix} ignored: {receipt.text}")
        elif receipt.text:
            rospy.logwarn_throttle(1.0, f"setpoint {suffix} clamped: {receipt.text}")

    def _on_authority(self, request: Any) -> SDKControlAuthorityResponse:
        with self._lock:
            ack = self._sim.control_authority(bool(request.control_enable))
        word = "obtain" if request.control_enable else "release"
        rospy.loginfo(f"{word} control authority: ack {ack.ack_data}")
        return SDKControlAuthorityResponse(*ack)

    def _on_arm(self, request: Any) -> DroneArmControlResponse:
        with self._lock:
            ack = self._sim.arm(bool(request.arm))
        rospy.loginfo(f"{'start' if request.arm else 'stop'} motors: ack {ack.ack_data}")
        return DroneArmControlResponse(*ack)

    def _on_task(self, request: Any) -> DroneTaskControlResponse:
        with self._lock:
            ack = self._sim.task(request.task)
        rospy.loginfo(f"task {request.task}: {'started' if ack.result else 'refused'}")
        return DroneTaskControlResponse(*ack)

    def _on_reference(self, request: Any) -> SetLocalPosRefResponse:
        with self._lock:
            result = self._sim.set_local_position_reference()
        rospy.loginfo(f"local position reference {'set' if result else 'refused and cleared'}")
        return SetLocalPosRefResponse(result)

    def _on_activation(self, request: Any) -> ActivationResponse:
        return ActivationResponse(True, 0, 1, 0)

    def _on_version(self, request: Any) -> QueryDroneVersionResponse:
        return QueryDroneVersionResponse(FIRMWARE, "M100")
