# SPDX-License-Identifier: MIT
"""The state as ROS brings it, in controller and guard alike: telemetry of dji_sdk and positions.

ROS Subscribers:
    dji_sdk/{attitude, imu, velocity}: always.
    dji_sdk/local_position, world_position (geometry_msgs/PointStamped): the sources gps and
    world_position. /tf: the source vicon, from the world frame to ``vicon_frame``.
    Only sources flown on or on standby are listened to.
ROS Parameters: ~position_source, ~standby, ~vicon_frame (str): instead of those in
    ``config/sources.yaml``.

/tf is read itself, not through a tf2 buffer: each capture comes once, when it arrives, with its own
stamp; a buffer would have to be asked again and again and would interpolate what it has.
"""

import math
import threading
import time
from typing import Any, Callable, Dict, Optional, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper
from geometry_msgs.msg import PointStamped, QuaternionStamped, TransformStamped, Vector3Stamped
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from nmpc_control.estimator import Estimator
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.ros.wake_up import WakeUp
from nmpc_control.source_params import (
    GPS,
    VICON,
    WORLD_POSITION,
    SourcesParameters,
    load_source_parameters,
)
from nmpc_control.state_sources import StateSources

TRANSFORMS = 100  # messages of /tf kept: many send there, and the newest is not always Vicon's
SILENCE = 0.5  # [s] of wall time without an attitude: no telemetry comes
POINTS = {GPS: "dji_sdk/local_position", WORLD_POSITION: "world_position"}


class StatePort:
    """Subscribes; ``sources`` is to be used under ``lock`` only."""

    def __init__(
        self,
        estimator: Estimator,
        world_frame: str,
        lock: Optional[threading.Lock] = None,
        add_attitude: Optional[Callable[[float, Tuple[float, ...]], bool]] = None,
    ) -> None:
        """Read the parameters; raises ConfigError.

        ``add_attitude`` is called with attitudes in place of the estimator's own method.
        """
        parameters = node_sources()
        self.lock = lock or threading.Lock()
        self.sources = StateSources(parameters, estimator)
        self._add_attitude = add_attitude
        self._world_frame = world_frame.strip("/")
        self._vicon_frame = parameters.vicon_frame.strip("/")
        self.newest = math.nan  # [s] stamp of the newest attitude, as it came
        self._heard = -math.inf  # [s] steady clock, when that was
        self._came = WakeUp()  # by velocities
        self._jumps: Dict[str, int] = {}  # of each source, as far as they were told

    def subscribe(self, subscriptions: Subscriptions) -> None:
        """Listen to the telemetry and to every source."""
        add = subscriptions.add
        add("dji_sdk/attitude", QuaternionStamped, self._locked(self._on_attitude))
        add("dji_sdk/imu", Imu, self._locked(self._on_imu))
        add("dji_sdk/velocity", Vector3Stamped, self._locked(self._on_velocity))
        for name in self.sources.tracks:
            if name in POINTS:
                add(POINTS[name], PointStamped, self._locked(self._point_taker(name)))
        if VICON in self.sources.tracks:
            add("/tf", TFMessage, self._on_transforms, TRANSFORMS, self._hears_vicon)

    @property
    def hears(self) -> bool:
        """Whether telemetry comes, whatever its stamps say."""
        return time.monotonic() - self._heard < SILENCE

    def wait_for_velocity(self, limit: float) -> bool:
        """Wait for the next velocity, at most ``limit`` [s] of wall time; False where none came.

        Of what comes in one packet attitude and rates are there before it.
        """
        self._came.clear()
        return self._came.wait(limit)

    def start_anew(self, estimator: Estimator) -> None:
        """Forget all samples, as after a jump of the clock, and go on with another estimator."""
        with self.lock:
            self.sources.forget(estimator)

    def diagnose(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        """Fill in the entry ``position`` of /diagnostics."""
        t = now()
        with self.lock:
            sources = self.sources
            alive = {name: sources.is_alive(name, t) for name in sources.tracks}
            ages = {name: track.age(t) for name, track in sources.tracks.items()}
            refused, yaw = sources.refused(), sources.yaw_disagreement(t)
            active = sources.active
        if alive[active]:
            status.summary(DiagnosticStatus.OK, f"from {active}")
        else:
            status.summary(DiagnosticStatus.WARN, f"{active} is not alive")
        for name, age in ages.items():
            status.add(f"{name} age [s]", f"{age:.3f}")
        for kind, count in refused.items():
            status.add(kind, str(count))
        if yaw is not None:
            status.add("yaw of Vicon less dji_sdk's [deg]", f"{math.degrees(yaw):.1f}")
        return status

    def _hears_vicon(self) -> bool:
        return self.sources.tracks[VICON].age(now()) <= self.sources.parameters.alive_time

    def _locked(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def store(message: Any) -> None:
            with self.lock:
                callback(message)
                self._tell_jumps()

        return store

    def _on_attitude(self, message: QuaternionStamped) -> None:
        add = self._add_attitude or self.sources.estimator.add_attitude
        add(stamp_of(message.header), _xyzw(message.quaternion))
        self.newest, self._heard = message.header.stamp.to_sec(), time.monotonic()

    def _on_imu(self, message: Imu) -> None:
        rates = _xyz(message.angular_velocity)
        self.sources.estimator.add_imu(stamp_of(message.header), rates)

    def _on_velocity(self, message: Vector3Stamped) -> None:
        self.sources.add_velocity(stamp_of(message.header), _xyz(message.vector))
        self._came.set()

    def _point_taker(self, name: str) -> Callable[[PointStamped], None]:
        def take(message: PointStamped) -> None:
            self.sources.add_position(name, stamp_of(message.header), _xyz(message.point))

        return take

    def _on_transforms(self, message: TFMessage) -> None:
        for transform in message.transforms:
            if transform.child_frame_id.strip("/") == self._vicon_frame:
                self._take_pose(transform)

    def _take_pose(self, message: TransformStamped) -> None:
        parent = message.header.frame_id.strip("/")
        if parent != self._world_frame:
            words = f"{self._vicon_frame} is given in {parent!r}, not in {self._world_frame!r}"
            rospy.logwarn_throttle(5.0, f"Vicon refused: {words}")
            return
        pose = message.transform
        with self.lock:
            stamp = stamp_of(message.header)
            self.sources.add_pose(stamp, _xyz(pose.translation), _xyzw(pose.rotation))
            self._tell_jumps()

    def _tell_jumps(self) -> None:
        for name, track in self.sources.tracks.items():
            count = track.counts["jumps"]
            if count > self._jumps.get(name, 0):
                self._jumps[name] = count
                rospy.logwarn(f"the position of {name} has jumped: the new place is taken for true")


def node_sources() -> SourcesParameters:
    """Return the sources that ROS parameters and ``sources.yaml`` tell; raises ConfigError."""
    names = ("position_source", "standby", "vicon_frame")
    return load_source_parameters(**{name: str(rospy.get_param(f"~{name}", "")) for name in names})


def now() -> float:
    """Return the time [s]."""
    return rospy.Time.now().to_sec()


def stamp_of(header: Header) -> float:
    """Return the message's time [s]; one from the future counts as now."""
    return min(header.stamp.to_sec(), now())


def _xyz(vector: Any) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _xyzw(quaternion: Any) -> Tuple[float, float, float, float]:
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w
