# SPDX-License-Identifier: MIT
"""Obstacles that an operator adds and removes while flying.

Served by flight_guard, which lives as long as the flight: what was added is published as any other
sender's list, latched, so that controller and guard read the same and neither waits for the other.

ROS Services: add_obstacle (nmpc_msgs/AddObstacle), remove_obstacle (nmpc_msgs/RemoveObstacle).
ROS Publishers: nmpc/added_obstacles (nmpc_msgs/ObstacleArray), latched: what was added. Not on
    ``obstacles``, where a connection to the own node would hide that there is none to a sensor.
    nmpc/forget_obstacles (std_msgs/String): name of a sender whose obstacles are to be forgotten.
"""

import threading
from io import BytesIO
from typing import Dict, Tuple

import rospy
from std_msgs.msg import Header, String

from nmpc_control.errors import NmpcError
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, to_obstacle
from nmpc_control.ros.conversions import obstacles_to_msg
from nmpc_control.ros.obstacle_port import ADDED_TOPIC, ObstaclePort
from nmpc_control.ros.obstacle_wire import read_head, read_obstacles
from nmpc_msgs.msg import ObstacleArray
from nmpc_msgs.srv import (
    AddObstacle,
    AddObstacleRequest,
    AddObstacleResponse,
    RemoveObstacle,
    RemoveObstacleRequest,
    RemoveObstacleResponse,
)

SIZES = "[radius] of a sphere, [radius, height] of a cylinder, [x, y, z] of a box, in m and > 0"
EXPECTED = {"id": "; 1 to 64 printable characters", "size": f"; {SIZES}"}


class ObstacleServices:
    """Keeps what was added; every service call has a thread of its own."""

    def __init__(self, port: ObstaclePort) -> None:
        self._port = port
        self._added: Dict[str, Obstacle] = {}
        self._lock = threading.Lock()
        self._list = rospy.Publisher(ADDED_TOPIC, ObstacleArray, queue_size=1, latch=True)
        self._forgotten = rospy.Publisher("nmpc/forget_obstacles", String, queue_size=10)
        self._publish()
        rospy.Service("add_obstacle", AddObstacle, self._add)
        rospy.Service("remove_obstacle", RemoveObstacle, self._remove)

    def _add(self, request: AddObstacleRequest) -> AddObstacleResponse:
        frame = request.frame_id or self._port.frames.world
        data = BytesIO()
        ObstacleArray(Header(frame_id=frame), [request.obstacle]).serialize(data)
        head = read_head(data.getvalue())
        try:
            ((sighting, found),) = self._port.judge(head, read_obstacles(data.getvalue(), head))
        except NmpcError as error:
            again = "; call again in a second" if self._port.frames.is_new else ""
            return AddObstacleResponse(False, f"{error}{again}")
        if found:
            words = f"{sighting.id!r} cannot be used: {found}{EXPECTED.get(found, '')}"
            return AddObstacleResponse(False, words)
        if sighting.moves:
            words = "it moves: only a node that goes on publishing `obstacles` can say where it is"
            return AddObstacleResponse(False, f"{sighting.id!r} is not added, {words}")
        with self._lock:
            if len({*self._added, sighting.id}) > MAX_OBSTACLES:
                return AddObstacleResponse(False, f"{MAX_OBSTACLES} are added, no more can be")
            verb = "changed" if sighting.id in self._added else "added"
            self._added[sighting.id] = to_obstacle(sighting, sighting.id)
            self._publish()
        place = ", ".join(f"{x:.2f}" for x in sighting.position)
        words = (
            f"{verb}: {sighting.shape} {sighting.id!r} at ({place}) m in {self._port.frames.world}"
        )
        rospy.loginfo(f"add_obstacle: {words}")
        return AddObstacleResponse(True, words)

    def _remove(self, request: RemoveObstacleRequest) -> RemoveObstacleResponse:
        done, words = self._forget(request) if request.source else self._take_back(request.id)
        rospy.loginfo(f"remove_obstacle: {words}")
        return RemoveObstacleResponse(done, words)

    def _take_back(self, name: str) -> Tuple[bool, str]:
        with self._lock:
            gone = [n for n in self._added if name in ("", n)]
            for n in gone:
                del self._added[n]
            self._publish()
        if gone:
            return True, f"removed: {', '.join(map(repr, gone))}"
        if not name:
            return False, "none was added"
        return False, f"{name!r} was not added here: who told of it, as the scenario, keeps it"

    def _forget(self, request: RemoveObstacleRequest) -> Tuple[bool, str]:
        if request.id:
            return False, "give `id` or `source`, not both"
        sender = request.source if request.source[0] == "/" else f"/{request.source}"
        if sender == rospy.get_name():
            return self._take_back("")
        self._forgotten.publish(sender)
        is_known = self._port.knows(sender)
        count = self._port.forget(sender)
        if not is_known:
            return False, f"nothing is known from {sender}"
        return True, f"forgotten: {count} from {sender}; its next message makes its own known again"

    def _publish(self) -> None:
        header = Header(stamp=rospy.Time.now(), frame_id=self._port.frames.world)
        self._list.publish(obstacles_to_msg(list(self._added.values()), header))
