# SPDX-License-Identifier: MIT
"""What is known of a flight, as layers of markers; messages in, marker arrays out."""

import math
from functools import partial
from typing import Callable, Dict, List, Optional, Tuple

import numpy as np
from geometry_msgs.msg import Point, PolygonStamped, Pose
from nav_msgs.msg import Odometry
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from nmpc_control.flown_path import FlownPath
from nmpc_control.mode_inputs import PLANNED
from nmpc_control.ros import markers
from nmpc_msgs.msg import ControllerStatus, ObstacleArray, Prediction

MOST_OBSTACLES = 200
MOST_REFERENCE_POINTS = 1000
_CLOCK_JUMP = 1.0  # [s] back in time that means another flight (simulation restarted, bag looped)
_MODES = {
    value: name[len("MODE_") :].replace("_", " ").lower()
    for name, value in vars(ControllerStatus).items()
    if name.startswith("MODE_")
}


class Scene:
    """Keeps the newest of everything; markers are made when they are asked for."""

    def __init__(
        self, frame: str, vehicle_radius: float, safety_distance: float, text_height: float
    ) -> None:
        self._frame = frame
        self._vehicle_radius, self._safety_distance = vehicle_radius, safety_distance  # [m]
        self._text_height = text_height  # [m]
        self._layers: Dict[str, Callable[[], List[Marker]]] = {}
        self._changed: List[str] = []
        self._drawn: Dict[str, List[Tuple[str, int]]] = {}  # what the viewers have, by layer
        self._path, self._true_path = FlownPath(), FlownPath()
        self._stamps: Dict[FlownPath, float] = {}  # [s] of the newest odometry
        self._pose: Optional[Pose] = None

    def set_trajectory(self, message: MultiDOFJointTrajectory) -> None:
        """Show the whole reference; a stamp of 0 announces a flight, any other starts its clock."""
        if message.header.stamp.to_sec() > 0.0 and message.points:
            duration = message.points[-1].time_from_start.to_sec()
            self._path.start_clock(message.header.stamp.to_sec(), duration)
        else:
            self._path.clear()
            self._true_path.clear()
        points = _rows([p.transforms[0].translation for p in message.points if p.transforms])
        stride = 1 + len(points) // MOST_REFERENCE_POINTS
        shown = np.vstack([points[::stride], points[-1:]])
        self._set("reference", self._line, "reference (green)", shown, markers.GREEN, 0.05)
        self._set("reference ends", self._reference_ends, points)

    def set_odometry(self, message: Odometry) -> None:
        """Show the aircraft and extend the flown path."""
        if self._extend(self._path, message):
            self._pose = message.pose.pose
            self._set(
                "flown path", self._path_line, "flown path (blue)", self._path, markers.BLUE, 0.07
            )
            self._set("times", self._times)
            self._set("vehicle", self._vehicle)

    def set_truth(self, message: Odometry) -> None:
        """Extend the true path, which only a simulation knows."""
        if self._extend(self._true_path, message):
            self._set(
                "true path",
                self._path_line,
                "true path (grey)",
                self._true_path,
                markers.GREY,
                0.02,
            )

    def set_prediction(self, message: Prediction) -> None:
        """Show the predicted path and the reference over the same time."""
        predicted = _rows([pose.position for pose in message.poses])
        self._set("prediction", self._line, "prediction (red)", predicted, markers.RED, 0.08)
        wanted = _rows(message.references)
        self._set("horizon", self._line, "horizon (yellow)", wanted, markers.YELLOW, 0.08)

    def set_obstacles(self, message: ObstacleArray) -> None:
        """Show these obstacles and no others."""
        self._set("obstacles", self._obstacles, message)

    def set_room(self, message: PolygonStamped) -> None:
        """Show the box between two corners, or none."""
        self._set("room", self._room, _rows(message.polygon.points))

    def set_status(self, message: ControllerStatus) -> None:
        """Show the mode above the aircraft, with the trajectory's clock or the reason.

        Where no plan is flown, none is predicted: the last one does not stay in the picture.
        """
        self._set("mode", self._mode, message)
        if message.mode not in PLANNED:
            self._set("prediction", list)
            self._set("horizon", list)

    def changes(self) -> MarkerArray:
        """Return what changed since the last call, with removals of what is gone."""
        changed, self._changed = self._changed, []
        array = MarkerArray()
        for layer in changed:
            shown = self._layers[layer]()
            keys = [(marker.ns, marker.id) for marker in shown]
            gone = [key for key in self._drawn.get(layer, []) if key not in keys]
            array.markers += [markers.deletion(self._frame, ns, id) for ns, id in gone]
            array.markers += shown
            self._drawn[layer] = keys
        return array

    def everything(self) -> MarkerArray:
        """Return all markers, for a viewer that has just come, and removals of what is gone."""
        self._changed = list(self._layers)
        return self.changes()

    def _set(self, layer: str, build: Callable[..., List[Marker]], *arguments: object) -> None:
        self._layers[layer] = partial(build, *arguments)
        if layer not in self._changed:
            self._changed.append(layer)

    def _extend(self, path: FlownPath, message: Odometry) -> bool:
        position = _row(message.pose.pose.position)
        if not np.isfinite(position).all():
            return False
        t = message.header.stamp.to_sec()
        if t < self._stamps.get(path, t) - _CLOCK_JUMP:
            path.clear()
        self._stamps[path] = t
        path.add(t, position)
        return True

    def _line(
        self, ns: str, points: np.ndarray, color: markers.Color, width: float
    ) -> List[Marker]:
        finite = points[np.isfinite(points).all(axis=1)]
        return [markers.line(self._frame, ns, finite, color, width)] if len(finite) > 1 else []

    def _path_line(
        self, ns: str, path: FlownPath, color: markers.Color, width: float
    ) -> List[Marker]:
        return self._line(ns, path.points, color, width)

    def _times(self) -> List[Marker]:
        if not self._path.labels:
            return []
        places = np.array([place for _, place in self._path.labels])
        return [markers.dots(self._frame, "time dots", places, markers.WHITE, 0.18)] + [
            self._text("times", f"{clock:g}s", place, 0.35, markers.WHITE, i)
            for i, (clock, place) in enumerate(self._path.labels)
        ]

    def _reference_ends(self, points: np.ndarray) -> List[Marker]:
        if not len(points):
            return []
        ns, (first, last) = "reference ends", points[[0, -1]]
        if np.linalg.norm(first - last) < 0.5:
            return [self._text(ns, "start = end", first, -0.5, markers.GREEN)]
        return [
            self._text(ns, "start", first, -0.5, markers.GREEN, 0),
            self._text(ns, "end", last, -0.5, markers.GREEN, 1),
        ]

    def _vehicle(self) -> List[Marker]:
        return markers.vehicle(self._frame, self._pose, self._vehicle_radius)

    def _obstacles(self, message: ObstacleArray) -> List[Marker]:
        shown: List[Marker] = []
        for i, item in enumerate(message.obstacles[:MOST_OBSTACLES]):
            shown += markers.obstacle(self._frame, item, i, self._safety_distance)
        return shown

    def _room(self, corners: np.ndarray) -> List[Marker]:
        if len(corners) != 2 or not np.isfinite(corners).all():
            return []
        return [markers.box_edges(self._frame, "room", *corners)]

    def _mode(self, message: ControllerStatus) -> List[Marker]:
        if self._pose is None:
            return []
        words = _MODES.get(message.mode, f"mode {message.mode}")
        if math.isfinite(message.reference_time):
            words += f" {message.reference_time:.1f}s"
        elif message.mode in (ControllerStatus.MODE_WAITING, ControllerStatus.MODE_FAULT):
            words += f": {message.reason}"
        return [self._text("mode", words, _row(self._pose.position), 1.3)]

    def _text(
        self,
        ns: str,
        words: str,
        position: np.ndarray,
        above: float,
        color: markers.Color = markers.WHITE,
        id: int = 0,
    ) -> Marker:
        place = position + [0.0, 0.0, above]
        return markers.text(self._frame, ns, words, place, color, self._text_height, id)


def _row(point: Point) -> np.ndarray:
    return np.array([point.x, point.y, point.z])


def _rows(points: List[Point]) -> np.ndarray:
    return np.array([(point.x, point.y, point.z) for point in points]).reshape(-1, 3)
