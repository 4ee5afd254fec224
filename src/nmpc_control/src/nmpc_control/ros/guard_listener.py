# SPDX-License-Identifier: MIT
"""What flight_guard hears; callbacks store, ``take`` hands it to a tick.

ROS Subscribers:
    dji_sdk/{attitude, imu, velocity, local_position, gps_health, rc, flight_status, battery_state,
    height_above_takeoff}, or ``world_position`` instead of local_position: telemetry.
    nmpc/plan (nmpc_msgs/Plan): from nmpc_controller. Obstacles: see ``obstacle_port``.
"""

import math
import threading
from typing import Any, Callable, Optional, Tuple

import rospy
from geometry_msgs.msg import PointStamped, QuaternionStamped, Vector3Stamped
from sensor_msgs.msg import BatteryState, Imu, Joy
from std_msgs.msg import Float32, Header, UInt8

from nmpc_control.guard_data import GuardInputs
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.guard_params import GuardParameters
from nmpc_control.mode_inputs import Request
from nmpc_control.ros.conversions import MessageError, plan_from_msg
from nmpc_control.ros.obstacle_port import ObstaclePort
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_msgs.msg import Plan

_POSITION_TOPICS = {"gps": "dji_sdk/local_position", "external": "world_position"}


class GuardListener:
    """Subscribes to everything that the guard needs."""

    def __init__(self, params: GuardParameters, avoidance: bool) -> None:
        self.params = params
        self.avoidance = avoidance  # false leaves obstacles out of the plan check
        self.last_plan = Plan(reference_time=math.nan)  # as received; empty without
        self.obstacles = ObstaclePort(params.world_frame)
        self._inbox = GuardInbox(params)
        self._lock = threading.Lock()
        subscriptions = Subscriptions()
        for topic, kind, callback in (
            ("dji_sdk/attitude", QuaternionStamped, self._on_attitude),
            ("dji_sdk/imu", Imu, self._on_imu),
            ("dji_sdk/velocity", Vector3Stamped, self._on_velocity),
            (_POSITION_TOPICS[params.position_source], PointStamped, self._on_position),
            ("dji_sdk/rc", Joy, self._on_rc),
            ("dji_sdk/gps_health", UInt8, self._on_gps_health),
            ("dji_sdk/flight_status", UInt8, self._on_flight_status),
            ("dji_sdk/height_above_takeoff", Float32, self._on_height),
            ("dji_sdk/battery_state", BatteryState, self._on_battery),
            ("nmpc/plan", Plan, self._on_plan),
        ):
            subscriptions.add(topic, kind, self._locked(callback))
        self.obstacles.subscribe(subscriptions, known=True)

    def take(self, t: float, request: Optional[Request]) -> GuardInputs:
        """Return what a tick at ``t`` [s] sees, with the operator's request."""
        with self._lock:
            if self.avoidance:
                self._inbox.obstacles, self._inbox.obstacles_stale = self.obstacles.look(t)
            self._inbox.request = request
            return self._inbox.inputs(t)

    @property
    def authority(self) -> bool:
        """Whether control authority is held, as far as the last answer of dji_sdk tells."""
        return self._inbox.authority

    def set_authority(self, is_held: bool) -> None:
        """Note that authority was obtained or given back."""
        self._inbox.authority = is_held

    def report_failure(self, sentence: str) -> None:
        """Tell the next tick how a service call failed."""
        rospy.logwarn(sentence)
        with self._lock:
            self._inbox.failure = sentence

    def start_anew(self) -> None:
        """Forget what was received before the clock jumped; authority and what stands stay."""
        self.obstacles.start_anew()
        with self._lock:
            old, self._inbox = self._inbox, GuardInbox(self.params)
            self._inbox.authority = old.authority

    def rejected_samples(self) -> str:
        """Return how many samples of which source were refused."""
        counts = self._inbox.estimator.rejected
        return ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"

    def _locked(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def store(message: Any) -> None:
            with self._lock:
                callback(message)

        return store

    def _on_attitude(self, message: QuaternionStamped) -> None:
        q = message.quaternion
        self._inbox.estimator.add_attitude(_time(message.header), (q.x, q.y, q.z, q.w))

    def _on_imu(self, message: Imu) -> None:
        self._inbox.estimator.add_imu(_time(message.header), _xyz(message.angular_velocity))

    def _on_velocity(self, message: Vector3Stamped) -> None:
        self._inbox.estimator.add_velocity(_time(message.header), _xyz(message.vector))

    def _on_position(self, message: PointStamped) -> None:
        self._inbox.estimator.add_position(_time(message.header), _xyz(message.point))

    def _on_rc(self, message: Joy) -> None:
        self._inbox.add_rc(_time(message.header), message.axes)

    def _on_gps_health(self, message: UInt8) -> None:
        self._inbox.add_gps_health(_now(), message.data)

    def _on_flight_status(self, message: UInt8) -> None:
        self._inbox.add_flight_status(_now(), message.data)

    def _on_height(self, message: Float32) -> None:
        self._inbox.add_height(message.data)

    def _on_battery(self, message: BatteryState) -> None:
        self._inbox.add_battery(_time(message.header), message.percentage)

    def _on_plan(self, message: Plan) -> None:
        self.last_plan = message
        try:
            self._inbox.add_plan(*plan_from_msg(message, self.params.world_frame))
        except MessageError as error:
            self._inbox.add_plan_error(str(error))


def _now() -> float:
    return rospy.Time.now().to_sec()


def _time(header: Header) -> float:
    """Return the message's time [s]; one from the future counts as now."""
    return min(header.stamp.to_sec(), _now())


def _xyz(vector: Any) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z
