# SPDX-License-Identifier: MIT
"""The topics and services of dji_sdk's node on an M100, served by a simulated one."""

from threading import Lock
from typing import Sequence

import genpy.dynamic
import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import String

from dji_sdk.msg import GPSUTC, FCTimeInUTC, MobileData, PayloadData, VOPosition
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.conversions import TELEMETRY
from uav_sim.ros.payload_services import PayloadServices
from uav_sim.ros.ports import Ports
from uav_sim.ros.services import FlightServices
from uav_sim.ros.throttle import Throttle
from uav_sim.setpoint import FLAGS, TOPIC_PREFIX, Receipt
from uav_sim.telemetry import Packet

QUEUE = 10  # of every publisher and subscriber of dji_sdk (doc/dji_sdk.md 1)
LATCHED = "local_frame_ref"

# nmea_msgs is no package of every ROS distribution; made here, its type and sum are the same.
_NMEA = genpy.dynamic.generate_dynamic(
    "nmea_msgs/Sentence",
    "Header header\nstring sentence\n" + "=" * 80 + "\nMSG: std_msgs/Header\n"
    "uint32 seq\ntime stamp\nstring frame_id\n",
)["nmea_msgs/Sentence"]

# Advertised on an M100, but no message ever comes (doc/dji_sdk.md 2.2).
SILENT = {
    "vo_position": VOPosition,
    "time_sync_nmea_msg": _NMEA,
    "time_sync_gps_utc": GPSUTC,
    "time_sync_fc_time_utc": FCTimeInUTC,
    "time_sync_pps_source": String,
    "from_mobile_data": MobileData,
    "from_payload_data": PayloadData,
}


class DjiSdkServer:
    """Publishes packets; hands setpoints and requests to the simulator, under its lock."""

    def __init__(self, sim: SimulatedM100, lock: Lock, ports: Ports) -> None:
        self._sim = sim
        self._ports = ports
        self._lock = lock
        self._throttle = Throttle()
        self._publishers = {}
        ack = sim.preset.flight_controller.undocumented.activation_ack
        if ack:
            # Without activation dji_sdk's node stays up and offers nothing at all (1).
            rospy.logerr(
                f"{ports.prefix}activation refused (ack {ack}): no topic and no service of dji_sdk"
            )
            return
        self._services = (FlightServices(sim, lock, ports), PayloadServices(sim, ports))
        self._advertise()
        for suffix in FLAGS:
            name = f"dji_sdk/{TOPIC_PREFIX}{suffix}"
            ports.subscriber(name, Joy, self._on_setpoint, suffix, QUEUE)

    def publish(self, stamp: rospy.Time, packets: Sequence[Packet]) -> None:
        """Publish packets with the stamp of their receipt."""
        for topic, _, value in packets:
            if topic in self._publishers:
                self._publishers[topic].publish(TELEMETRY[topic].convert(stamp, value))
        for receipt in self._sim.late_receipts:
            self._judge("setpoint", receipt)
        for event in self._sim.autopilot.take_events():
            self._warn(event)
        for line in self._throttle.overdue():
            rospy.logwarn(line)

    def _advertise(self) -> None:
        for topic, kind in TELEMETRY.items():
            self._publishers[topic] = self._ports.publisher(
                f"dji_sdk/{topic}", kind.type, QUEUE, latch=topic == LATCHED
            )
        self._silent = [
            self._ports.publisher(f"dji_sdk/{topic}", message, QUEUE)
            for topic, message in SILENT.items()
        ]

    def _on_setpoint(self, message: Joy, suffix: str) -> None:
        with self._lock:
            receipt = self._sim.setpoint(suffix, message.axes)
        self._judge(f"setpoint {suffix}", receipt)

    def _judge(self, name: str, receipt: Receipt) -> None:
        if receipt.text:
            became = "clamped" if receipt.accepted else "ignored"
            self._warn(f"{name} {became}: {receipt.text}")

    def _warn(self, text: str) -> None:
        line = self._throttle.line(self._ports.prefix + text)
        if line:
            rospy.logwarn(line)
