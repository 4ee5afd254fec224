# SPDX-License-Identifier: MIT
"""Flies a scenario again and again for some minutes, and notes how evenly commands come.

ROS Subscribers: dji_sdk/flight_control_setpoint_generic, bare_stream, nmpc/status, nmpc/plan,
nmpc/markers. ROS Services called: start, land. ROS Action: fly_trajectory.
ROS Parameters: ~minutes, ~scenario, ~nodes (names whose memory is looked at), ~file (what is
written, numpy's npz), ~seconds_per_sample of the memory.

What is written: time (2,) [s] of begin and end on a steady clock; commands, bare [s] receipts;
age [s] of the newest telemetry when a step of the controller begins, solved [s] its duration,
carried [s] until its plan is received, guarded [s] what the guard spent on it up to the command,
whole [s] all four; flown [s] the same with the wait for the guard's tick; bare_age [s] of the bare
process; memory_t [s], memory_<node> [MB]; markers_t [s], markers [1], marker_points [1]; modes
(statuses of each); flights, aborted: goals that ended, and how many of them without arrival;
scheduling: policy of the guard's process.
"""

import os
import sys
import threading
import time
from pathlib import Path
from typing import Dict, List, Optional, Set, Tuple
from xmlrpc.client import ServerProxy

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import Joy
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from nmpc_msgs.msg import ControllerStatus, FlyTrajectoryAction, FlyTrajectoryGoal, Plan

PATIENCE = 60.0  # [s] for start, take-off, each answer
MEGABYTE = 1024.0  # [kB]


class Observer:
    """Callbacks append; nothing is evaluated here."""

    def __init__(self) -> None:
        self.series: Dict[str, List[float]] = {}
        self.modes: Dict[int, int] = {}
        self.status: Optional[ControllerStatus] = None
        self._measures = False
        self._plan: Optional[Tuple[float, float]] = None  # telemetry to receipt, telemetry [s]
        self._marked: Dict[Tuple[str, int], int] = {}
        listen = (
            ("dji_sdk/flight_control_setpoint_generic", Joy, self._on_command),
            ("bare_stream", Joy, self._on_bare),
            ("nmpc/status", ControllerStatus, self._on_status),
            ("nmpc/plan", Plan, self._on_plan),
            ("nmpc/markers", MarkerArray, self._on_markers),
        )
        for topic, kind, callback in listen:
            rospy.Subscriber(topic, kind, callback, queue_size=100, tcp_nodelay=True)

    def begin(self) -> None:
        """Measure from now on."""
        self._measures = True

    def end(self) -> None:
        """Measure no longer."""
        self._measures = False

    def note(self, name: str, value: float) -> None:
        """Append to a series, where it is measured."""
        if self._measures:
            self.series.setdefault(name, []).append(value)

    def _on_command(self, _: Joy) -> None:
        self.note("commands", time.monotonic())

    def _on_bare(self, message: Joy) -> None:
        self.note("bare", time.monotonic())
        self.note("bare_age", message.axes[0])

    def _on_plan(self, message: Plan) -> None:
        telemetry, begun = message.state_stamp.to_sec(), message.header.stamp.to_sec()
        received = rospy.Time.now().to_sec()
        self._plan = (received - telemetry, telemetry)
        self.note("age", begun - telemetry)
        self.note("solved", message.tick_time)
        self.note("carried", received - begun - message.tick_time)

    def _on_status(self, message: ControllerStatus) -> None:
        self.status = message
        if self._measures:
            self.modes[message.mode] = self.modes.get(message.mode, 0) + 1
        if message.rung == ControllerStatus.RUNG_NEW_PLAN and self._plan is not None:
            to_plan, telemetry = self._plan
            self.note("guarded", message.tick_time)
            self.note("whole", to_plan + message.tick_time)
            self.note("flown", message.header.stamp.to_sec() + message.tick_time - telemetry)

    def _on_markers(self, message: MarkerArray) -> None:
        for marker in message.markers:
            key = (marker.ns, marker.id)
            if marker.action == Marker.DELETEALL:
                self._marked.clear()
            elif marker.action == Marker.DELETE:
                self._marked.pop(key, None)
            else:
                self._marked[key] = len(marker.points)
        self.note("markers_t", time.monotonic())
        self.note("markers", len(self._marked))
        self.note("marker_points", sum(self._marked.values()))


def main() -> None:
    """Entry point of the node; exit status 1 where the flight could not be flown."""
    rospy.init_node("soak_observer")
    minutes = float(rospy.get_param("~minutes"))
    scenario = str(rospy.get_param("~scenario"))
    observer = Observer()
    client = actionlib.SimpleActionClient("fly_trajectory", FlyTrajectoryAction)
    _until(lambda: _call("start"), "start")
    _until(lambda: observer.status.mode == ControllerStatus.MODE_HOVERING, "take-off")
    if not client.wait_for_server(rospy.Duration(PATIENCE)):
        sys.exit("soak: no action fly_trajectory")
    observer.begin()
    begin = time.monotonic()
    end = begin + 60.0 * minutes
    names = str(rospy.get_param("~nodes")).split()
    period = float(rospy.get_param("~seconds_per_sample"))
    processes = _processes(names)
    scheduling = os.sched_getscheduler(processes["flight_guard"])
    arguments = (observer, processes, period, end)
    threading.Thread(target=_watch_memory, args=arguments, daemon=True).start()
    flights = aborted = 0
    while time.monotonic() < end and not rospy.is_shutdown():
        client.send_goal(FlyTrajectoryGoal(scenario=scenario))
        while time.monotonic() < end and not client.wait_for_result(rospy.Duration(0.5)):
            pass
        if time.monotonic() < end:
            flights += 1
            aborted += client.get_state() != GoalStatus.SUCCEEDED
    observer.end()
    series = {name: np.array(values) for name, values in observer.series.items()}
    np.savez(
        Path(str(rospy.get_param("~file"))),
        time=np.array([begin, time.monotonic()]),
        flights=flights,
        scheduling=scheduling,
        aborted=aborted,
        modes=np.array(sorted(observer.modes.items())),
        **series,
    )
    _call("land")


def _until(condition, what: str) -> None:  # noqa: ANN001 (any callable)
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline or rospy.is_shutdown():
            sys.exit(f"soak: no {what} within {PATIENCE:g} s")
        time.sleep(0.2)


def _call(service: str) -> bool:
    try:
        rospy.wait_for_service(service, PATIENCE)
        return rospy.ServiceProxy(service, Trigger)().success
    except (rospy.ROSException, rospy.ServiceException):
        return False


def _processes(nodes: List[str]) -> Dict[str, int]:
    found: Dict[str, int] = {}
    for node in nodes:
        _, _, uri = rospy.get_master().lookupNode(f"/{node}")
        found[node] = ServerProxy(uri).getPid(rospy.get_name())[2]
    return found


def _watch_memory(observer: Observer, processes: Dict[str, int], period: float, end: float) -> None:
    gone: Set[str] = set()
    while time.monotonic() < end:
        observer.note("memory_t", time.monotonic())
        for node, process in processes.items():
            try:
                status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
                line = next(row for row in status.splitlines() if row.startswith("VmRSS"))
                observer.note(f"memory_{node}", int(line.split()[1]) / MEGABYTE)
            except (OSError, StopIteration):
                if node not in gone:
                    rospy.logerr(f"soak: {node} is gone")
                gone.add(node)
                observer.note(f"memory_{node}", float("nan"))
        time.sleep(period)
