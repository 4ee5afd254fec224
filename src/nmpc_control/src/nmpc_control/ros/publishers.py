# SPDX-License-Identifier: MIT
"""What nmpc_controller publishes.

ROS Publishers: nmpc/plan, nmpc/prediction (every other plan, while the guard flies plans and
one is found: other vehicles count on it), nmpc/reference, nmpc/odometry, and latched
nmpc/trajectory, nmpc/obstacles, nmpc/known_obstacles, nmpc/room; tf world -> base_link;
/diagnostics.
"""

from typing import Callable, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import (
    Point,
    Point32,
    PolygonStamped,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
)
from nav_msgs.msg import Odometry
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from nmpc_control.controller import Step
from nmpc_control.obstacle import Obstacle
from nmpc_control.ros.conversions import (
    obstacles_to_msg,
    odometry_to_msg,
    plan_to_msg,
    prediction_to_msg,
    refusal_to_msg,
)
from nmpc_control.ros.diagnostics import Diagnostics, Wrapper
from nmpc_control.rotations import quaternion_from_rpy
from nmpc_control.scenario import Scenario
from nmpc_control.state import POSITION, YAW
from nmpc_msgs.msg import ObstacleArray, Plan, Prediction

_SAMPLE_PERIOD = 0.05  # [s] of the published trajectory
_MOST_SAMPLES = 5000
_OBSTACLE_PERIOD = 0.1  # [s] least between two lists of obstacles


class Publishers:
    """All outputs of the controller node."""

    def __init__(self, frame_id: str, base_frame: str) -> None:
        self.frame_id, self.base_frame = frame_id, base_frame
        self._plan = rospy.Publisher("nmpc/plan", Plan, queue_size=1, tcp_nodelay=True)
        self._prediction = rospy.Publisher("nmpc/prediction", Prediction, queue_size=1)
        self._reference = rospy.Publisher("nmpc/reference", PoseStamped, queue_size=10)
        self._odometry = rospy.Publisher("nmpc/odometry", Odometry, queue_size=10)
        self._trajectory = rospy.Publisher(
            "nmpc/trajectory", MultiDOFJointTrajectory, queue_size=1, latch=True
        )
        self._obstacles = rospy.Publisher("nmpc/obstacles", ObstacleArray, queue_size=1, latch=True)
        self._known = rospy.Publisher(
            "nmpc/known_obstacles", ObstacleArray, queue_size=1, latch=True
        )
        self._room = rospy.Publisher("nmpc/room", PolygonStamped, queue_size=1, latch=True)
        self._transforms = tf2_ros.TransformBroadcaster()
        self._shown: Optional[Sequence[Obstacle]] = None
        self._shown_at = 0.0  # [s]
        self._steps = 0
        self._last: Tuple[Optional[Step], int] = (None, 0)
        self._diagnostics = Diagnostics("M100")
        self._diagnostics.add("solver", self._diagnose_solver)

    def step(
        self, now: rospy.Time, step: Step, misses: int, state_stamp: float, tick_time: float
    ) -> None:
        """Publish everything that one control step produced; arguments as of ``plan_to_msg``."""
        header = Header(stamp=now, frame_id=self.frame_id)
        self._plan.publish(plan_to_msg(step, header, misses, state_stamp, tick_time))
        self._steps += 1
        if self._steps % 2 == 0 and step.is_promise:
            self._prediction.publish(prediction_to_msg(step, header))
        odometry = odometry_to_msg(step.estimate.vector, header, self.base_frame)
        self._odometry.publish(odometry)
        reference = PoseStamped(header=header)
        reference.pose.position = Point(*step.reference[POSITION])
        reference.pose.orientation = Quaternion(*quaternion_from_rpy(0.0, 0.0, step.reference[YAW]))
        self._reference.publish(reference)
        pose = odometry.pose.pose
        translation = Vector3(pose.position.x, pose.position.y, pose.position.z)
        self._transforms.sendTransform(
            TransformStamped(header, self.base_frame, Transform(translation, pose.orientation))
        )

    def no_plan(self, now: rospy.Time, sentence: str, state_stamp: float) -> None:
        """Tell the guard why there is no plan."""
        header = Header(stamp=now, frame_id=self.frame_id)
        self._plan.publish(refusal_to_msg(sentence, header, state_stamp))

    def add_diagnostics(self, name: str, diagnose: Callable[[Wrapper], Wrapper]) -> None:
        """Have another entry in /diagnostics."""
        self._diagnostics.add(name, diagnose)

    def diagnose(self, step: Optional[Step], misses: int) -> None:
        """Refresh /diagnostics, at most once a second."""
        self._last = (step, misses)
        self._diagnostics.update()

    def trajectory(self, scenario: Scenario, clock_start: Optional[float]) -> None:
        """Publish the whole reference.

        Its stamp is the start of its clock, 0 while that has not begun.
        """
        trajectory = scenario.trajectory
        count = int(np.clip(np.ceil(trajectory.duration / _SAMPLE_PERIOD) + 1, 2, _MOST_SAMPLES))
        times = np.linspace(0.0, trajectory.duration, count)
        sample = trajectory.sample(times)
        message = MultiDOFJointTrajectory(joint_names=[scenario.name])
        message.header.frame_id = self.frame_id
        message.header.stamp = (
            rospy.Time(0) if clock_start is None else rospy.Time.from_sec(clock_start)
        )
        for i, t in enumerate(times):
            pose = Transform(
                Vector3(*sample.position[i]), Quaternion(*quaternion_from_rpy(0, 0, sample.yaw[i]))
            )
            velocity = Twist(Vector3(*sample.velocity[i]), Vector3(0, 0, sample.yaw_rate[i]))
            acceleration = Twist(linear=Vector3(*sample.acceleration[i]))
            message.points.append(
                MultiDOFJointTrajectoryPoint(
                    [pose], [velocity], [acceleration], rospy.Duration.from_sec(t)
                )
            )
        self._trajectory.publish(message)

    def obstacles(self, t: float, obstacles: Sequence[Obstacle]) -> None:
        """Publish the obstacles that the controller knows at ``t`` [s], where they have changed."""
        if obstacles is self._shown or 0.0 <= t - self._shown_at < _OBSTACLE_PERIOD:
            return
        self._shown, self._shown_at = obstacles, t
        self._obstacles.publish(obstacles_to_msg(obstacles, self._header()))

    def known_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Publish the obstacles of the scenarios, for the guard."""
        self._known.publish(obstacles_to_msg(obstacles, self._header()))

    def _header(self) -> Header:
        return Header(stamp=rospy.Time.now(), frame_id=self.frame_id)

    def room(self, room: Optional[Tuple[np.ndarray, np.ndarray]]) -> None:
        """Publish the least and the greatest corner of the room."""
        corners = [Point32(*corner) for corner in room] if room is not None else []
        message = PolygonStamped(header=Header(frame_id=self.frame_id))
        message.polygon.points = corners
        self._room.publish(message)

    def _diagnose_solver(self, status: Wrapper) -> Wrapper:
        step, misses = self._last
        if step is None:
            status.summary(DiagnosticStatus.WARN, "no fresh state: not solving")
        elif not step.plan.found:
            status.summary(DiagnosticStatus.ERROR, f"no solution: {step.plan.status}")
        else:
            status.summary(DiagnosticStatus.OK, step.plan.status)
            status.add("solve time [ms]", f"{1e3 * step.plan.solve_time:.2f}")
            status.add("iterations", str(step.plan.iterations))
        status.add("deadline misses", str(misses))
        return status
