# SPDX-License-Identifier: MIT
"""The markers of a flight: right place, right size, bounded number, gone when they should be."""

import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, List, Tuple

import numpy as np
import pytest

pytest.importorskip("nmpc_msgs.msg", reason="no ROS messages: build the workspace and source it")

import rospy
from geometry_msgs.msg import Point, Point32, PolygonStamped, Pose, Quaternion, Transform, Vector3
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from nmpc_control.flown_path import FlownPath
from nmpc_control.ros.scene import MOST_OBSTACLES, MOST_REFERENCE_POINTS, Scene
from nmpc_msgs.msg import ControllerStatus, Obstacle, ObstacleArray, Prediction

HERE = Path(__file__).resolve().parent
NOSE_LEFT = Quaternion(0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)


@pytest.fixture
def scene() -> Scene:
    return Scene("world", vehicle_radius=0.5, safety_distance=0.4, text_height=0.5)


def odometry(t: float, position: Tuple[float, float, float], q: Quaternion = LEVEL) -> Odometry:
    message = Odometry()
    message.header.stamp = rospy.Time.from_sec(t)
    message.pose.pose = Pose(Point(*position), q)
    return message


def trajectory(
    points: np.ndarray, stamp: float = 0.0, duration: float = 1e6
) -> MultiDOFJointTrajectory:
    message = MultiDOFJointTrajectory(joint_names=["test"])
    message.header.stamp = rospy.Time.from_sec(stamp)
    for t, point in zip(np.linspace(0.0, duration, len(points)), points):
        transform = Transform(Vector3(*point), LEVEL)
        message.points.append(MultiDOFJointTrajectoryPoint([transform], [], [], rospy.Duration(t)))
    return message


def sphere(name: str, x: float = 1.0, radius: float = 0.6) -> Obstacle:
    return Obstacle(id=name, shape=Obstacle.SPHERE, size=[radius], position=Point(x, 2.0, 3.0))


def named(array: MarkerArray, ns: str) -> List[Marker]:
    return [marker for marker in array.markers if marker.ns == ns]


def points_of(marker: Marker) -> np.ndarray:
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def color_of(marker: Marker) -> str:
    red, green, blue = marker.color.r > 0.5, marker.color.g > 0.5, marker.color.b > 0.7
    names = {(1, 0, 0): "red", (0, 1, 0): "green", (0, 1, 1): "blue", (1, 1, 0): "yellow"}
    return names[(red, green, blue)]


def test_lines_have_the_papers_colours_and_the_points_of_their_messages(scene: Scene) -> None:
    way = np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 2]])
    scene.set_trajectory(trajectory(way))
    plan = Prediction()
    plan.poses = [Pose(Point(*point), LEVEL) for point in way + 0.1]
    plan.references = [Point(*point) for point in way + 0.2]
    scene.set_prediction(plan)
    for i, point in enumerate(way + 0.3):
        scene.set_odometry(odometry(i, point))
    array = scene.changes()
    for ns, color, offset in (
        ("reference (green)", "green", 0.0),
        ("prediction (red)", "red", 0.1),
        ("horizon (yellow)", "yellow", 0.2),
        ("flown path (blue)", "blue", 0.3),
    ):
        (marker,) = named(array, ns)
        assert color_of(marker) == color
        assert marker.header.frame_id == "world"
        assert {tuple(p) for p in points_of(marker).round(6)} == {
            tuple(p) for p in (way + offset).round(6)
        }


def test_the_shell_is_the_safety_distance_off_the_surface(scene: Scene) -> None:
    scene.set_obstacles(
        ObstacleArray(
            obstacles=[
                sphere("ball"),
                Obstacle(id="tree", shape=Obstacle.CYLINDER, size=[0.5, 4.0]),
                Obstacle(id="wall", shape=Obstacle.BOX, size=[1.0, 2.0, 3.0]),
            ]
        )
    )
    array = scene.changes()
    bodies, shells = named(array, "obstacles"), named(array, "safety shells")
    sizes = [[1.2, 1.2, 1.2], [1.0, 1.0, 4.0], [1.0, 2.0, 3.0]]
    for body, shell, size in zip(bodies, shells, sizes):
        assert np.allclose([body.scale.x, body.scale.y, body.scale.z], size)
        assert np.allclose([shell.scale.x, shell.scale.y, shell.scale.z], np.add(size, 0.8))
        assert body.color.a == 1.0
        assert 0.0 < shell.color.a < 0.5
    assert [body.type for body in bodies] == [Marker.SPHERE, Marker.CYLINDER, Marker.CUBE]
    assert bodies[0].pose.position == shells[0].pose.position == Point(1.0, 2.0, 3.0)


def test_an_obstacle_that_is_gone_is_removed_and_the_others_stay(scene: Scene) -> None:
    scene.set_obstacles(ObstacleArray(obstacles=[sphere("a"), sphere("b")]))
    scene.changes()
    scene.set_obstacles(ObstacleArray(obstacles=[sphere("a")]))
    array = scene.changes()
    removed = {(m.ns, m.id) for m in array.markers if m.action == Marker.DELETE}
    assert removed == {("obstacles", 1), ("safety shells", 1)}
    assert {(m.ns, m.id) for m in array.markers if m.action == Marker.ADD} == {
        ("obstacles", 0),
        ("safety shells", 0),
    }


@pytest.mark.parametrize(
    "item",
    [
        Obstacle(shape=Obstacle.SPHERE, size=[]),
        Obstacle(shape=Obstacle.SPHERE, size=[-1.0]),
        Obstacle(shape=Obstacle.SPHERE, size=[float("nan")]),
        Obstacle(shape=Obstacle.BOX, size=[1.0]),
        Obstacle(shape=77, size=[1.0]),
        Obstacle(shape=Obstacle.SPHERE, size=[1.0], position=Point(float("inf"), 0, 0)),
    ],
)
def test_what_cannot_be_drawn_is_left_out(scene: Scene, item: Obstacle) -> None:
    scene.set_obstacles(ObstacleArray(obstacles=[item, sphere("b")]))
    assert len(named(scene.changes(), "obstacles")) == 1


def test_the_room_has_twelve_edges_between_its_corners(scene: Scene) -> None:
    message = PolygonStamped()
    message.polygon.points = [Point32(-1, -2, 0), Point32(1, 2, 3)]
    scene.set_room(message)
    (marker,) = named(scene.changes(), "room")
    edges = points_of(marker).reshape(12, 2, 3)
    assert sorted(np.abs(edges[:, 0] - edges[:, 1]).sum(axis=1)) == [2] * 4 + [3] * 4 + [4] * 4
    scene.set_room(PolygonStamped())
    (gone,) = scene.changes().markers
    assert gone.action == Marker.DELETE


def test_the_nose_of_the_vehicle_points_along_its_yaw(scene: Scene) -> None:
    scene.set_odometry(odometry(0.0, (5.0, 0.0, 2.0), NOSE_LEFT))
    vehicle = named(scene.changes(), "vehicle")
    hull = vehicle[0]
    assert (hull.scale.x, hull.scale.y) == (1.0, 1.0)
    rotors = [m for m in vehicle if m.type == Marker.CYLINDER and m is not hull]
    front = [m for m in rotors if color_of_rgb(m) == "red"]
    assert len(rotors) == 4
    assert len(front) == 2
    for rotor in front:
        assert rotor.pose.position.y > 0.2
        offset = [rotor.pose.position.x - 5.0, rotor.pose.position.y]
        assert np.linalg.norm(offset) == pytest.approx(0.325)


def color_of_rgb(marker: Marker) -> str:
    return "red" if marker.color.r > 2 * marker.color.g else "other"


def test_time_labels_count_from_the_start_of_the_clock(scene: Scene) -> None:
    way = np.array([[0.0, 0, 1], [10, 0, 1]])
    scene.set_trajectory(trajectory(way))
    for t in np.arange(0.0, 20.0, 0.1):
        scene.set_odometry(odometry(t, (-1.0, t / 10, 1.0)))
    assert not named(scene.changes(), "times")
    scene.set_trajectory(trajectory(way, stamp=20.0, duration=12.0))
    for t in np.arange(20.0, 43.0, 0.1):
        scene.set_odometry(odometry(t, (t - 20.0, 0.0, 1.0)))
    labels = named(scene.changes(), "times")
    assert [label.text for label in labels] == ["0s", "5s", "10s"]
    assert np.allclose([label.pose.position.x for label in labels], [0.0, 5.0, 10.0], atol=0.11)


def test_a_new_flight_clears_the_old_path_and_its_labels(scene: Scene) -> None:
    way = np.array([[0.0, 0, 1], [10, 0, 1]])
    scene.set_trajectory(trajectory(way, stamp=10.0))
    for t in np.arange(10.0, 20.0, 0.1):
        scene.set_odometry(odometry(t, (t, 0.0, 1.0)))
    scene.changes()
    scene.set_trajectory(trajectory(way))
    scene.set_odometry(odometry(20.0, (0.0, 0.0, 1.0)))
    scene.set_odometry(odometry(20.1, (1.0, 0.0, 1.0)))
    array = scene.changes()
    (path,) = named(array, "flown path (blue)")
    assert points_of(path)[:, 0].max() == 1.0
    assert {m.action for m in named(array, "times")} == {Marker.DELETE}


def test_a_clock_that_jumps_back_starts_a_new_path(scene: Scene) -> None:
    for t in (100.0, 101.0, 5.0, 6.0):
        scene.set_odometry(odometry(t, (t, 0.0, 1.0)))
    (path,) = named(scene.changes(), "flown path (blue)")
    assert points_of(path)[:, 0].tolist() == [5.0, 6.0, 6.0]


def test_the_mode_is_told_above_the_aircraft(scene: Scene) -> None:
    message = ControllerStatus(mode=ControllerStatus.MODE_FLYING, reference_time=12.34)
    scene.set_status(message)
    assert not scene.changes().markers
    scene.set_odometry(odometry(0.0, (1.0, 2.0, 3.0)))
    scene.set_status(message)
    (marker,) = named(scene.changes(), "mode")
    assert marker.text == "flying 12.3s"
    assert marker.pose.position.z > 3.5
    waiting = ControllerStatus(reason="no RC", reference_time=float("nan"))
    scene.set_status(waiting)
    (marker,) = named(scene.changes(), "mode")
    assert marker.text == "waiting: no RC"


def test_only_changes_are_sent_but_a_new_viewer_gets_everything(scene: Scene) -> None:
    scene.set_obstacles(ObstacleArray(obstacles=[sphere("a")]))
    scene.set_odometry(odometry(0.0, (1.0, 2.0, 3.0)))
    first = scene.changes()
    assert not scene.changes().markers
    assert Counter((m.ns, m.id) for m in scene.everything().markers) == Counter(
        (m.ns, m.id) for m in first.markers
    )


def test_a_long_flight_does_not_grow_the_markers(scene: Scene) -> None:
    scene.set_trajectory(trajectory(np.random.default_rng(0).normal(size=(20000, 3)), stamp=1.0))
    for i in range(20000):
        scene.set_odometry(odometry(1.0 + 0.2 * i, (0.3 * i, 0.0, 1.0)))
    scene.set_obstacles(ObstacleArray(obstacles=[sphere(str(i)) for i in range(500)]))
    array = scene.everything()
    assert len(array.markers) < 2 * MOST_OBSTACLES + 100
    assert len({(m.ns, m.id) for m in array.markers}) == len(array.markers)
    assert len(points_of(named(array, "flown path (blue)")[0])) <= 2001
    assert len(points_of(named(array, "reference (green)")[0])) <= MOST_REFERENCE_POINTS + 2


def test_positions_that_are_not_numbers_are_ignored(scene: Scene) -> None:
    scene.set_odometry(odometry(0.0, (float("nan"), 0.0, 0.0)))
    plan = Prediction(references=[Point(float("inf"), 0, 0), Point(1, 0, 0), Point(2, 0, 0)])
    scene.set_prediction(plan)
    scene.set_trajectory(MultiDOFJointTrajectory())
    array = scene.changes()
    assert {m.ns for m in array.markers} == {"horizon (yellow)"}
    assert len(points_of(array.markers[0])) == 2


def test_a_full_path_is_thinned_evenly_and_keeps_both_ends() -> None:
    path = FlownPath(spacing=1.0, capacity=100, period=5.0, labels=10)
    path.start_clock(0.0)
    for t in range(1000):
        path.add(float(t), np.array([float(t), 0.0, 0.0]))
    x = path.points[:, 0]
    assert x[0] == 0.0
    assert x[-1] == 999.0
    assert len(x) <= 101
    assert np.diff(x[:-1]).max() <= 2 * np.diff(x[:-1]).min()
    times = [t for t, _ in path.labels]
    assert len(times) <= 10
    assert len(set(np.diff(times))) == 1


def test_labels_of_a_path_that_is_joined_late_stand_where_they_belong() -> None:
    path = FlownPath(labels=4)
    path.start_clock(100.0)
    for t in np.arange(112.0, 147.0, 0.05):
        path.add(t, np.array([t - 100.0, 0.0, 0.0]))
    assert [t for t, _ in path.labels] == [20.0, 30.0, 40.0]
    for t, place in path.labels:
        assert place[0] == pytest.approx(t, abs=0.051)


@pytest.mark.ros
def test_the_node_draws_a_flight_for_a_viewer_that_comes_late(ros: Any) -> None:
    ros.launch("nmpc_control", "monitor.launch", rviz=False)
    ros.start(sys.executable, str(HERE / "fake_flight.py"), "multi_obstacle", "7")
    ros.wait_for_node("/nmpc_visualizer")
    time.sleep(2.0)  # the room and the reference have long been sent
    assert ros.run_json("marker_viewer.py") == {
        "reference (green)": 1,
        "reference ends": 2,
        "flown path (blue)": 1,
        "true path (grey)": 1,
        "prediction (red)": 1,
        "horizon (yellow)": 1,
        "obstacles": 3,
        "safety shells": 3,
        "room": 1,
        "times": 2,
        "time dots": 1,
        "vehicle": 9,
        "mode": 1,
    }
