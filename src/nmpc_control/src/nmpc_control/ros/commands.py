# SPDX-License-Identifier: MIT
"""Targets and trajectories that come as plain messages, beside the action fly_trajectory.

ROS Subscribers:
    command/pose (geometry_msgs/PoseStamped): go straight to this point, rest to rest.
    command/trajectory (trajectory_msgs/MultiDOFJointTrajectory): fly to its first point, then it.
ROS Publishers: nmpc/answer (std_msgs/String): what became of each, in words, and of tuning.
"""

from typing import Callable, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Quaternion
from std_msgs.msg import Header, String
from trajectory_msgs.msg import MultiDOFJointTrajectory

from nmpc_control.commanded_trajectory import MOST_POINTS, CommandError, commanded_trajectory
from nmpc_control.controller import Controller
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.ros.trajectory_action import TrajectoryAction
from nmpc_control.rotations import rpy_from_quaternion
from nmpc_control.scenario import Scenario
from nmpc_control.state import POSITION, YAW
from nmpc_control.trajectory import Trajectory

OLDEST = 5.0  # [s] a stamped trajectory older than this is not begun
_AHEAD = 1.0  # [s] a stamp this far ahead is a start time, which is not served
_UNIT = 0.05  # [1] by which the square of a quaternion's norm may be off
NAME = "command"


class Commands:
    """Checks commands and hands them to the itinerary; called in the control loop's thread."""

    def __init__(
        self,
        frame_id: str,
        controller: Callable[[], Controller],
        action: TrajectoryAction,
        show: Callable[[Scenario], None],
    ) -> None:
        """Begin.

        Args:
            frame_id: world frame.
            controller: returns the one in use.
            action: whose goal a command ends.
            show: has a trajectory published.
        """
        self._frame, self._controller, self._action, self._show = frame_id, controller, action, show
        self._answer = rospy.Publisher("nmpc/answer", String, queue_size=10)

    def tell(self, sentence: str) -> None:
        """Publish what became of a request."""
        self._answer.publish(sentence)

    def subscribe(
        self, subscriptions: Subscriptions, ask: Callable[[Callable[[float], None]], None]
    ) -> None:
        """Listen; ``ask`` has something called in the control loop with the time [s]."""
        for topic, kind, follow in (
            ("command/pose", PoseStamped, self.go_to),
            ("command/trajectory", MultiDOFJointTrajectory, self.fly),
        ):
            subscriptions.add(topic, kind, self._handler(topic, follow, ask))

    def go_to(self, t: float, message: PoseStamped) -> str:
        """Follow a pose at ``t`` [s]; returns what is done.

        Raises CommandError.
        """
        p, q = message.pose.position, message.pose.orientation
        target = np.array([p.x, p.y, p.z])
        self._require_frame(message.header)
        limits = self._controller().parameters.limits
        if not limits.encloses(target):
            raise CommandError("the position is not finite or outside the fence")
        position, present_yaw = self._pose(t)
        yaw = _yaw(q)
        itinerary = self._controller().itinerary
        if itinerary.is_going_to(target):
            return "under way"  # sent again: starting anew each time would never arrive
        self._action.finish(t, False, "replaced by command/pose")
        itinerary.go_to(t, position, present_yaw, target, present_yaw if yaw is None else yaw)
        return "flying there"

    def fly(self, t: float, message: MultiDOFJointTrajectory) -> str:
        """Follow a trajectory at ``t`` [s]; returns what is done.

        Raises CommandError.
        """
        self._require_frame(message.header)
        stamp = message.header.stamp.to_sec()
        if stamp and t - stamp > OLDEST:
            raise CommandError(f"it is {t - stamp:.1f} s old, at most {OLDEST:g} are taken")
        if stamp - t > _AHEAD:
            raise CommandError("its stamp is in the future: a start time is not served")
        position, yaw = self._pose(t)
        limits = self._controller().parameters.limits
        trajectory = commanded_trajectory(*_points(message), yaw, limits)
        self._action.finish(t, False, "replaced by command/trajectory")
        self._show(_scenario(trajectory))
        self._controller().itinerary.fly(t, position, yaw, trajectory)
        return f"flying to its start, then {trajectory.duration:.1f} s along it"

    def _handler(
        self,
        topic: str,
        follow: Callable[[float, object], str],
        ask: Callable[[Callable[[float], None]], None],
    ) -> Callable[[object], None]:
        def serve(t: float, message: object) -> None:
            try:
                sentence = f"{topic}: {follow(t, message)}"
                rospy.logdebug(sentence)
            except CommandError as error:
                sentence = f"{topic} refused: {error}"
                rospy.logwarn(sentence)
            self.tell(sentence)

        return lambda message: ask(lambda t: serve(t, message))

    def _require_frame(self, header: Header) -> None:
        if header.frame_id not in ("", self._frame):
            raise CommandError(f"frame {header.frame_id!r}, expected {self._frame!r}")

    def _pose(self, t: float) -> Tuple[np.ndarray, float]:
        """Return position (3,) [m] and yaw [rad]; raises CommandError where it is not flown."""
        controller = self._controller()
        estimate = controller.estimator.estimate(t)
        if estimate is None or not controller.engaged:
            raise CommandError("automatic flight is off, call `start` first")
        return estimate.vector[POSITION], float(estimate.vector[YAW])


def _points(
    message: MultiDOFJointTrajectory,
) -> Tuple[np.ndarray, np.ndarray, Optional[np.ndarray], Optional[np.ndarray]]:
    """Return times (n,), positions (n, 3), yaws and velocities or None; raises CommandError."""
    points = message.points
    if not 2 <= len(points) <= MOST_POINTS:
        raise CommandError(f"got {len(points)} points, expected 2 to {MOST_POINTS}")
    times, positions, yaws, velocities = [], [], [], []
    for number, point in enumerate(points, 1):
        if len(point.transforms) != 1 or len(point.velocities) > 1:
            raise CommandError(
                f"point {number}: got {len(point.transforms)} transforms and "
                f"{len(point.velocities)} velocities, expected one and at most one"
            )
        place, q = point.transforms[0].translation, point.transforms[0].rotation
        if any((q.x, q.y, q.z, q.w)) and _yaw(q) is None:
            raise CommandError(f"point {number}: its rotation is no unit quaternion")
        times.append(point.time_from_start.to_sec())
        positions.append([place.x, place.y, place.z])
        yaws.append(_yaw(q))
        if point.velocities:
            v = point.velocities[0].linear
            velocities.append([v.x, v.y, v.z])
    for name, given in (("rotation", [y for y in yaws if y is not None]), ("velocity", velocities)):
        if 0 < len(given) < len(points):
            raise CommandError(f"{len(given)} of {len(points)} points have a {name}: all or none")
    has_yaw = yaws[0] is not None
    return (
        np.array(times),
        np.array(positions),
        np.array(yaws) if has_yaw else None,
        np.array(velocities) if velocities else None,
    )


def _yaw(q: Quaternion) -> Optional[float]:
    """Return the yaw [rad] of a unit quaternion; None of one that is none."""
    if not abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1.0) < _UNIT:
        return None
    return rpy_from_quaternion((q.x, q.y, q.z, q.w))[2]


def _scenario(trajectory: Trajectory) -> Scenario:
    words = "points given by the operator"
    return Scenario(NAME, words, trajectory, (), None, "outdoor", trajectory.start, np.zeros(3))
