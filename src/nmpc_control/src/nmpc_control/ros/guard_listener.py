# SPDX-License-Identifier: MIT
"""What flight_guard hears; callbacks store, ``take`` hands it to a tick.

ROS Subscribers:
    dji_sdk/{gps_health, rc, flight_status, battery_state, height_above_takeoff}: telemetry. The
    state: see ``state_port``.
    nmpc/plan (nmpc_msgs/Plan): from nmpc_controller. Obstacles: see ``obstacle_port``.
"""

import math
import threading
from typing import Any, Callable, Optional

import rospy
from sensor_msgs.msg import BatteryState, Joy
from std_msgs.msg import Float32, UInt8

from nmpc_control.guard_data import GuardInputs
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.guard_params import GuardParameters
from nmpc_control.mode_inputs import Request
from nmpc_control.ros.conversions import MessageError, plan_from_msg
from nmpc_control.ros.obstacle_port import ObstaclePort
from nmpc_control.ros.state_port import StatePort, now, stamp_of
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.ros.wake_up import WakeUp
from nmpc_control.source_params import GPS
from nmpc_msgs.msg import Plan


class GuardListener:
    """Subscribes to everything that the guard needs."""

    def __init__(self, params: GuardParameters, avoidance: bool) -> None:
        self.params = params
        self.avoidance = avoidance  # false leaves obstacles out of the plan check
        self.last_plan = Plan(reference_time=math.nan)  # as received; empty without
        self.obstacles = ObstaclePort(params.world_frame)
        self._inbox = GuardInbox(params)
        self._lock = threading.Lock()
        self._plan_came = WakeUp()
        self.state = StatePort(self._inbox.estimator, params.world_frame, self._lock)
        subscriptions = Subscriptions()
        self.state.subscribe(subscriptions)
        for topic, kind, callback in (
            ("dji_sdk/rc", Joy, self._on_rc),
            ("dji_sdk/gps_health", UInt8, self._on_gps_health),
            ("dji_sdk/flight_status", UInt8, self._on_flight_status),
            ("dji_sdk/height_above_takeoff", Float32, self._on_height),
            ("dji_sdk/battery_state", BatteryState, self._on_battery),
            ("nmpc/plan", Plan, self._on_plan),
        ):
            subscriptions.add(topic, kind, self._locked(callback))
        self.obstacles.subscribe(subscriptions, known=True)

    def take(
        self,
        t: float,
        steady: Optional[float],
        request: Optional[Request],
        leaving: bool = False,
    ) -> GuardInputs:
        """Return what a tick at ``t`` [s] sees, with the operator's request.

        ``steady`` [s] is a clock that nobody sets; None: ``t`` is one. ``leaving``: the guard ends.
        """
        with self._lock:
            if self.avoidance:
                seen = self.obstacles.look(t, self._inbox.estimator)
                self._inbox.obstacles, self._inbox.obstacles_stale = seen
            self._inbox.request, self._inbox.leaving = request, leaving
            sources = self.state.sources
            self._inbox.needs_gps = sources.active == GPS
            yaw = sources.yaw_disagreement(t)
            self._inbox.yaw_disagreement = math.nan if yaw is None else yaw
            self._plan_came.clear()
            return self._inbox.inputs(t, steady)

    def wait_for_plan(self, limit: float) -> bool:
        """Wait until there is a plan that no tick has seen, at most ``limit`` [s] of wall time."""
        return self._plan_came.wait(limit)

    def take_plan(self, t: float, steady: Optional[float]) -> GuardInputs:
        """Return what is needed to look at a plan before the next tick; arguments as of ``take``.

        Obstacles are those of the last tick; the next one looks at the plan with its own.
        """
        self._plan_came.clear()
        with self._lock:
            return self._inbox.plan_inputs(t, steady)

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

    def report_landing(self) -> None:
        """Tell the next tick that dji_sdk has granted a call to land."""
        with self._lock:
            self._inbox.landing_granted = True

    def start_anew(self) -> None:
        """Forget what was received before the clock jumped; authority and what stands stay."""
        self.obstacles.start_anew()
        with self._lock:
            old, self._inbox = self._inbox, GuardInbox(self.params)
            self._inbox.authority = old.authority
            self.state.sources.forget(self._inbox.estimator)

    def rejected_samples(self) -> str:
        """Return how many samples of which source were refused."""
        counts = self._inbox.refused
        return ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"

    def _locked(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def store(message: Any) -> None:
            with self._lock:
                callback(message)

        return store

    def _on_rc(self, message: Joy) -> None:
        self._inbox.add_rc(stamp_of(message.header), message.axes)

    def _on_gps_health(self, message: UInt8) -> None:
        self._inbox.add_gps_health(now(), message.data)

    def _on_flight_status(self, message: UInt8) -> None:
        self._inbox.add_flight_status(now(), message.data)

    def _on_height(self, message: Float32) -> None:
        self._inbox.add_height(message.data)

    def _on_battery(self, message: BatteryState) -> None:
        self._inbox.add_battery(stamp_of(message.header), message.percentage)

    def _on_plan(self, message: Plan) -> None:
        self.last_plan = message
        try:
            self._inbox.add_plan(*plan_from_msg(message, self.params.world_frame))
        except MessageError as error:
            self._inbox.add_plan_error(str(error))
        self._plan_came.set()
