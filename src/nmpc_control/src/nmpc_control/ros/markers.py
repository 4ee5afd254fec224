# SPDX-License-Identifier: MIT
"""RViz markers of one thing each; every marker has a lasting namespace and id.

Colours as in the paper's figures: green the whole reference, yellow the reference over the horizon,
red the prediction, blue the flown path.
"""

import math
from typing import List, Sequence, Tuple

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from nmpc_msgs.msg import Obstacle

Color = Tuple[float, float, float, float]

GREEN: Color = (0.20, 0.85, 0.30, 1.0)
BLUE: Color = (0.25, 0.55, 1.0, 1.0)
RED: Color = (1.0, 0.20, 0.15, 1.0)
YELLOW: Color = (1.0, 0.85, 0.10, 1.0)
WHITE: Color = (0.95, 0.95, 0.95, 1.0)
GREY: Color = (0.60, 0.62, 0.65, 1.0)
OBSTACLE: Color = (0.75, 0.12, 0.08, 1.0)
SHELL: Color = (1.0, 0.85, 0.10, 0.30)
ROOM: Color = (1.0, 0.85, 0.10, 0.55)
HULL: Color = (0.25, 0.55, 1.0, 0.35)

ROTOR_DISTANCE = 0.325  # [m] centre to rotor axis, half of the M100's diagonal
ROTOR_RADIUS = 0.165  # [m] 13 inch propellers
_SIZES = {Obstacle.SPHERE: 1, Obstacle.CYLINDER: 2, Obstacle.BOX: 3}


def line(
    frame: str,
    ns: str,
    points: np.ndarray,
    color: Color,
    width: float,
    kind: int = Marker.LINE_STRIP,
    id: int = 0,
) -> Marker:
    """Return a line through points (n, 3) [m], or one per pair of them with LINE_LIST."""
    marker = _marker(frame, ns, kind, color, id)
    marker.scale.x = width
    marker.points = [Point(*point) for point in points]
    return marker


def dots(frame: str, ns: str, points: np.ndarray, color: Color, diameter: float) -> Marker:
    """Return a small ball at every point (n, 3) [m]."""
    marker = line(frame, ns, points, color, diameter, Marker.SPHERE_LIST)
    marker.scale = Vector3(diameter, diameter, diameter)
    return marker


def text(
    frame: str, ns: str, words: str, position: np.ndarray, color: Color, height: float, id: int = 0
) -> Marker:
    """Return words that face the viewer, with a letter height [m]."""
    marker = _marker(frame, ns, Marker.TEXT_VIEW_FACING, color, id)
    marker.text = words
    marker.scale.z = height
    marker.pose.position = Point(*position)
    return marker


def box_edges(frame: str, ns: str, low: np.ndarray, high: np.ndarray) -> Marker:
    """Return the twelve edges of the box between two corners (3,) [m]."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    pairs = [
        (a, b) for i, a in enumerate(corners) for b in corners[i + 1 :] if np.abs(a - b).sum() == 1
    ]
    ends = np.array(pairs).reshape(-1, 3)
    return line(frame, ns, low + ends * (high - low), ROOM, 0.03, Marker.LINE_LIST)


def obstacle(frame: str, item: Obstacle, id: int, safety_distance: float) -> List[Marker]:
    """Return the opaque obstacle, its path, and its shell, ``safety_distance`` [m] off its surface.

    The shell is what the aircraft's hull, not its centre, has to stay out of. An obstacle with
    numbers that cannot be drawn gives no marker.
    """
    size = [float(value) for value in item.size]
    numbers = size + [item.position.x, item.position.y, item.position.z]
    drawable = len(size) == _SIZES.get(item.shape) and np.isfinite(numbers).all()
    if not drawable or min(size) <= 0.0:
        return []
    if item.shape == Obstacle.BOX:
        kind, edges = Marker.CUBE, size
    elif item.shape == Obstacle.CYLINDER:
        kind, edges = Marker.CYLINDER, [2 * size[0], 2 * size[0], size[1]]
    else:
        kind, edges = Marker.SPHERE, [2 * size[0]] * 3
    markers = []
    for ns, color, margin in (
        ("obstacles", OBSTACLE, 0.0),
        ("safety shells", SHELL, 2 * safety_distance),
    ):
        marker = _marker(frame, ns, kind, color, id)
        marker.pose.position = item.position
        marker.scale = Vector3(*[edge + margin for edge in edges])
        markers.append(marker)
    path = np.array([(p.x, p.y, p.z) for p in (item.position, *item.predicted_path)])
    if len(path) > 1 and np.isfinite(path).all():
        markers.append(line(frame, "obstacle paths", path, OBSTACLE, 0.03, id=id))
    return markers


def vehicle(frame: str, pose: Pose, radius: float) -> List[Marker]:
    """Return an X-frame, nose arms red, with rotors and the disc of its hull of a radius [m]."""
    hull = _marker(frame, "vehicle", Marker.CYLINDER, HULL, 0)
    hull.pose = pose
    hull.scale = Vector3(2 * radius, 2 * radius, 0.02)
    markers = [hull]
    for i, angle in enumerate(np.radians([45.0, -45.0, 135.0, -135.0])):
        tip = ROTOR_DISTANCE * np.array([math.cos(angle), math.sin(angle), 0.0])
        color = RED if i < 2 else WHITE
        arm = line(frame, "vehicle", [(0, 0, 0), tip], color, 0.06, Marker.LINE_LIST, id=1 + i)
        arm.pose = pose
        rotor = _marker(frame, "vehicle", Marker.CYLINDER, color[:3] + (0.6,), 5 + i)
        rotor.pose = Pose(Point(*_moved(pose, tip + [0.0, 0.0, 0.05])), pose.orientation)
        rotor.scale = Vector3(2 * ROTOR_RADIUS, 2 * ROTOR_RADIUS, 0.02)
        markers += [arm, rotor]
    return markers


def deletion(frame: str, ns: str, id: int) -> Marker:
    """Return the message that removes a marker."""
    return Marker(header=Header(frame_id=frame), ns=ns, id=id, action=Marker.DELETE)


def _marker(frame: str, ns: str, kind: int, color: Color, id: int) -> Marker:
    marker = Marker(header=Header(frame_id=frame), ns=ns, id=id, type=kind, action=Marker.ADD)
    marker.pose.orientation = Quaternion(0.0, 0.0, 0.0, 1.0)
    marker.color = ColorRGBA(*color)
    return marker


def _moved(pose: Pose, offset: Sequence[float]) -> np.ndarray:
    """Return the position (3,) [m] of an offset given in the pose's own axes."""
    q = pose.orientation
    axis = np.array([q.x, q.y, q.z])
    turned = offset + 2 * np.cross(axis, np.cross(axis, offset) + q.w * np.asarray(offset))
    return np.array([pose.position.x, pose.position.y, pose.position.z]) + turned
