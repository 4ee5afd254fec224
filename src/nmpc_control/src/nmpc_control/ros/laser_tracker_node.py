# SPDX-License-Identifier: MIT
"""ROS node laser_tracker: scans of a 2D laser on the aircraft become obstacles with velocity.

Needs neither controller nor guard: its pose comes from the telemetry.

ROS Subscribers:
    scan (sensor_msgs/LaserScan): the newest one is taken, older ones that wait are skipped.
    the pose: see ``state_port``; nmpc/position_source: its source, as flight_guard has it.
ROS Publishers:
    obstacles (nmpc_msgs/ObstacleArray): with each scan, stamped as the scan, all confirmed tracks.
    /diagnostics: scans taken, refused and skipped, tracks.
ROS Parameters: those of ``state_port``; the others are in ``config/laser_tracker.yaml``.
"""

import math
import sys
import threading
import time
import traceback
from typing import Optional

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from nmpc_control.errors import NmpcError
from nmpc_control.laser_tracking.parameters import LaserTrackerParameters, load_laser_parameters
from nmpc_control.laser_tracking.poses import PoseHistory
from nmpc_control.laser_tracking.scan import Scan, ScanError
from nmpc_control.laser_tracking.tracker import RESTART, LaserTracker
from nmpc_control.ros.conversions import obstacles_to_msg
from nmpc_control.ros.diagnostics import Diagnostics, Wrapper
from nmpc_control.ros.source_switch import TOPIC, follow
from nmpc_control.ros.state_port import StatePort
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_msgs.msg import ObstacleArray, PositionSource

_WAIT = 0.2  # [s] of wall time for a scan, before diagnostics get their turn


class LaserTrackerNode:
    """Callbacks store; scans are worked on in ``run``, in one thread."""

    def __init__(self, parameters: LaserTrackerParameters) -> None:
        self.parameters = parameters
        self.tracker = LaserTracker(parameters)
        self._poses = PoseHistory(parameters.pose)
        self._lock = threading.Lock()  # of the poses
        self._state = StatePort(
            self._poses.estimator, parameters.world_frame, self._lock, self._poses.add_attitude
        )
        self._scan: Optional[LaserScan] = None
        self._arrived = threading.Event()
        self._now = 0.0  # [s]
        self._heard = -math.inf  # [s] when the last scan was taken
        self._refusal = ""  # why the newest scan was not taken
        self._duration = 0.0  # [s] of wall time for the last scan
        self._obstacles = rospy.Publisher(
            "obstacles", ObstacleArray, queue_size=1, tcp_nodelay=True
        )
        self._diagnostics = Diagnostics("laser")
        self._diagnostics.add("scans", self._diagnose)
        self._subscribe()

    def run(self) -> None:
        """Work on scans until shutdown; one that fails is reported and the next one tried."""
        while not rospy.is_shutdown():
            self._arrived.wait(_WAIT)
            self._arrived.clear()
            message, self._scan = self._scan, None
            try:
                self._follow_clock()
                if message is not None:
                    self._take(message)
            except Exception:  # noqa: BLE001 (one bad scan must not end the sight of an aircraft)
                self.tracker.counts["failed"] += 1
                rospy.logerr_throttle(1.0, f"scan failed: {traceback.format_exc(limit=-3)}")
            self._diagnostics.update()

    def _take(self, message: LaserScan) -> None:
        begin = time.perf_counter()
        scan = scan_from_msg(message)
        try:
            with self._lock:
                self.tracker.update(scan, self._poses, self._now)
        except ScanError as error:
            self._refusal = str(error)
            rospy.logwarn_throttle(1.0, f"{error} ({self.tracker.counts[error.kind]} so far)")
            return
        self._refusal, self._heard = "", self._now
        header = Header(stamp=message.header.stamp, frame_id=self.parameters.world_frame)
        obstacles = self.tracker.obstacles()
        array = obstacles_to_msg(obstacles, header)
        for entry, obstacle in zip(array.obstacles, obstacles):
            entry.uncertainty_growth = obstacle.growth
        self._obstacles.publish(array)
        self._duration = time.perf_counter() - begin

    def _follow_clock(self) -> None:
        now = rospy.Time.now().to_sec()
        if now < self._now - RESTART:
            rospy.logwarn("the clock jumped backwards")
            with self._lock:
                self._poses.forget()
                self._state.sources.forget()
            self.tracker.forget()
            self._heard = -math.inf
        self._now = now

    def _subscribe(self) -> None:
        subscriptions = Subscriptions()
        self._state.subscribe(subscriptions)
        subscriptions.add(TOPIC, PositionSource, lambda m: follow(self._state, m), queue_size=10)
        subscriptions.add("scan", LaserScan, self._on_scan)

    def _on_scan(self, message: LaserScan) -> None:
        if self._scan is not None:
            self.tracker.counts["skipped"] += 1
        self._scan = message
        self._arrived.set()

    def _diagnose(self, status: Wrapper) -> Wrapper:
        age = self._now - self._heard
        if self._refusal:
            status.summary(DiagnosticStatus.WARN, self._refusal)
        elif age > self.parameters.scan_timeout:
            words = "never" if math.isinf(age) else f"{age:.1f} s ago"
            status.summary(DiagnosticStatus.WARN, f"last scan: {words}")
        else:
            status.summary(DiagnosticStatus.OK, f"{len(self.tracker.confirmed)} tracks")
        status.add("tracks", str(len(self.tracker.confirmed)))
        status.add("time of the last scan [ms]", f"{1e3 * self._duration:.1f}")
        for name, count in sorted(dict(self.tracker.counts).items()):
            status.add(name if name == "scans" else f"scans not taken: {name}", str(count))
        return status


def scan_from_msg(message: LaserScan) -> Scan:
    """Return a message as a scan; whether it makes sense is judged by the tracker."""
    return Scan(
        t=message.header.stamp.to_sec(),
        angle_min=message.angle_min,
        angle_max=message.angle_max,
        angle_increment=message.angle_increment,
        time_increment=message.time_increment,
        range_min=message.range_min,
        range_max=message.range_max,
        ranges=np.array(message.ranges, dtype=float),
    )


def main() -> None:
    """Entry point of the node; exit status 2 on a wrong parameter."""
    rospy.init_node("laser_tracker")
    try:
        node = LaserTrackerNode(load_laser_parameters())
    except NmpcError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    node.run()
