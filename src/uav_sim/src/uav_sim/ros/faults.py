# SPDX-License-Identifier: MIT
"""Services that begin and end faults of one vehicle, and the topic that shows them."""

import math
from collections import deque
from threading import Lock
from typing import Deque

import rospy

from nmpc_msgs.msg import Fault, FaultArray
from nmpc_msgs.srv import (
    ClearFault,
    ClearFaultRequest,
    ClearFaultResponse,
    InjectFault,
    InjectFaultRequest,
    InjectFaultResponse,
)
from uav_sim.config import number, parse_yaml
from uav_sim.errors import ConfigError
from uav_sim.faults.engine import Faults
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.conversions import to_time
from uav_sim.ros.ports import Ports


class FaultServices:
    """``uav_sim/inject_fault``, ``uav_sim/clear_fault`` and the latched ``uav_sim/faults``."""

    def __init__(self, sim: SimulatedM100, lock: Lock, ports: Ports) -> None:
        self._sim = sim
        self._faults: Faults = sim.faults
        self._lock = lock
        self._prefix = ports.prefix
        self._changes: Deque[str] = deque()
        self._reporting = Lock()  # services and the simulating thread report
        self._faults.on_change = self._changes.append
        self._publisher = ports.publisher("uav_sim/faults", FaultArray, 10, latch=True)
        self._publish()
        ports.service("uav_sim/inject_fault", InjectFault, self._on_inject)
        ports.service("uav_sim/clear_fault", ClearFault, self._on_clear)

    def report(self) -> None:
        """Log what has changed since the last call, and publish what is active."""
        if not self._changes:
            return
        with self._reporting:
            while self._changes:
                rospy.logwarn(self._prefix + self._changes.popleft())
            self._publish()

    def _publish(self) -> None:
        with self._lock:
            t, active = self._sim.t, self._faults.active
        message = FaultArray()
        message.header.stamp = to_time(t)
        message.faults = [Fault(e.id, e.kind, e.parameters, e.since, e.until) for e in active]
        self._publisher.publish(message)

    def _on_inject(self, request: InjectFaultRequest) -> InjectFaultResponse:
        source = "inject_fault"
        try:
            parameters = parse_yaml(request.parameters.strip() or "{}", f"{source}: parameters")
            delay = number(request.delay, source, "delay", 0.0)
            duration = number(request.duration, source, "duration", 0.0) or math.inf
            with self._lock:
                start = self._sim.t + delay
                id = self._faults.inject(request.fault, parameters, start, duration, source=source)
        except ConfigError as error:
            rospy.logwarn(f"{self._prefix}no fault: {error}")
            return InjectFaultResponse(False, "", str(error))
        self.report()
        word = f"begins in {delay:g} s" if delay else "begins"
        return InjectFaultResponse(True, id, f"{id} {word}")

    def _on_clear(self, request: ClearFaultRequest) -> ClearFaultResponse:
        with self._lock:
            gone = self._faults.clear(request.id)
        self.report()
        if gone:
            return ClearFaultResponse(True, f"ended: {', '.join(gone)}")
        return ClearFaultResponse(False, f"no fault {request.id}" if request.id else "no fault")
