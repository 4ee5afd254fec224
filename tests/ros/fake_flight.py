#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Publishes what a flight in progress looks like, for nmpc_visualizer and a look at RViz.

Usage: fake_flight.py SCENARIO SECONDS. Flies quickly from the origin to SECONDS after the start of
the trajectory's clock, round obstacles as a controller would, then stays there.
"""

import sys

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import (
    Point,
    Point32,
    PolygonStamped,
    Pose,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from nav_msgs.msg import Odometry
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from nmpc_control.rotations import quaternion_from_rpy
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.trajectory import approach
from nmpc_msgs.msg import ControllerStatus, Obstacle, ObstacleArray, Plan, Prediction

CLOCK_START = 1000.0  # [s]
SHAPES = {"sphere": Obstacle.SPHERE, "cylinder": Obstacle.CYLINDER, "box": Obstacle.BOX}


def flown(scenario: Scenario, t: np.ndarray) -> np.ndarray:
    """Return plausible positions (M, 3) [m]: the reference, a little off and round obstacles."""
    points = scenario.trajectory.sample(t).position
    wobble = np.stack([np.sin(1.3 * t), np.cos(1.1 * t) - 1.0, 0.5 * np.sin(0.7 * t)], axis=1)
    points = points + 0.08 * wobble
    for obstacle in scenario.obstacles:
        arm = points - obstacle.position
        distance = np.linalg.norm(arm, axis=1, keepdims=True)
        way_out = arm + [0.6, 0.0, 1.2]  # one side for all, so that the path does not tear
        way_out /= np.linalg.norm(way_out, axis=1, keepdims=True)
        lift = (obstacle.size[0] + 1.1) * np.exp(-((distance / (obstacle.size[0] + 1.1)) ** 4))
        points = points + lift * way_out
    return points


def main() -> None:
    """Publish until shutdown."""
    scenario, seconds = load_scenario(sys.argv[1]), float(sys.argv[2])
    rospy.init_node("fake_flight")
    header = Header(frame_id="world")

    def publisher(topic: str, kind: type, latch: bool = False) -> rospy.Publisher:
        return rospy.Publisher(topic, kind, queue_size=1000, latch=latch)

    odometry = publisher("nmpc/odometry", Odometry)
    truth = publisher("uav_sim/ground_truth", Odometry)
    prediction = publisher("nmpc/prediction", Prediction)
    status = publisher("nmpc/status", ControllerStatus)
    trajectory = publisher("nmpc/trajectory", MultiDOFJointTrajectory, latch=True)
    obstacles = publisher("nmpc/obstacles", ObstacleArray, latch=True)
    room = publisher("nmpc/room", PolygonStamped, latch=True)
    transforms = tf2_ros.TransformBroadcaster()
    while odometry.get_num_connections() == 0 and not rospy.is_shutdown():
        rospy.sleep(0.05)

    message = PolygonStamped(header=header)
    message.polygon.points = [Point32(*corner) for corner in scenario.room]
    room.publish(message)
    obstacles.publish(
        header,
        [
            Obstacle(id=o.id, shape=SHAPES[o.shape], size=list(o.size), position=Point(*o.position))
            for o in scenario.obstacles
        ],
    )
    times = np.linspace(0.0, scenario.trajectory.duration, 600)
    whole = MultiDOFJointTrajectory(header=header, joint_names=[scenario.name])
    for t, point in zip(times, scenario.trajectory.sample(times).position):
        transform = Transform(Vector3(*point), Quaternion(0, 0, 0, 1))
        whole.points.append(MultiDOFJointTrajectoryPoint([transform], [], [], rospy.Duration(t)))
    trajectory.publish(whole)
    rospy.sleep(0.3)

    def publish_pose(t: float, position: np.ndarray) -> None:
        roll = 0.15 * np.sin(t)
        q = Quaternion(*quaternion_from_rpy(roll, 0.1 * np.cos(t), 0.0))
        sent = Odometry(header=Header(frame_id="world", stamp=rospy.Time.from_sec(CLOCK_START + t)))
        sent.pose.pose = Pose(Point(*position), q)
        odometry.publish(sent)
        truth.publish(sent)
        now = Header(frame_id="world", stamp=rospy.Time.now())
        transforms.sendTransform(
            TransformStamped(now, "base_link", Transform(Vector3(*position), q))
        )

    start = flown(scenario, np.zeros(1))[0]
    for way in (
        approach([0, 0, 0], [0, 0, 1.2], 1.0, 1.0),
        approach([0, 0, 1.2], start, 2.0, 1.0),
    ):
        for t in np.arange(0.0, way.duration, 0.05):
            publish_pose(t - 100.0, way.sample(t).position[0])
            rospy.sleep(0.002)
    whole.header.stamp = rospy.Time.from_sec(CLOCK_START)
    trajectory.publish(whole)
    rospy.sleep(0.3)
    for t in np.arange(0.0, seconds, 0.05):
        publish_pose(t, flown(scenario, np.array([t]))[0])
        rospy.sleep(0.002)
    while not rospy.is_shutdown():
        ahead = seconds + 0.1 * np.arange(61)
        publish_pose(seconds, flown(scenario, ahead[:1])[0])
        plan = Prediction(header=header)
        plan.poses = [Pose(Point(*p), Quaternion(0, 0, 0, 1)) for p in flown(scenario, ahead)]
        plan.references = [Point(*p) for p in scenario.trajectory.sample(ahead).position]
        prediction.publish(plan)
        mode = ControllerStatus(header=header, mode=ControllerStatus.MODE_FLYING)
        mode.goal, mode.reference_time = Plan.GOAL_TRAJECTORY, seconds
        status.publish(mode)
        rospy.sleep(0.1)


if __name__ == "__main__":
    main()
