# SPDX-License-Identifier: MIT
"""The operator's change of the position source: flight_guard decides, nmpc_controller follows.

ROS Services: select_source (nmpc_msgs/SelectSource), of flight_guard.
ROS Publishers: nmpc/position_source (nmpc_msgs/PositionSource), latched, from there.
"""

from typing import Callable

import numpy as np
import rospy
from geometry_msgs.msg import Vector3

from nmpc_control.ros.state_port import StatePort, now
from nmpc_control.state_sources import Switch
from nmpc_msgs.msg import PositionSource
from nmpc_msgs.srv import SelectSource, SelectSourceRequest, SelectSourceResponse

TOPIC = "nmpc/position_source"


class SourceSwitch:
    """Answers the service; every call has a thread of its own."""

    def __init__(self, port: StatePort, in_flight: Callable[[], bool]) -> None:
        """Tell the source at the start; ``in_flight`` says whether automatic flight is on."""
        self._port = port
        self._in_flight = in_flight
        self._source = rospy.Publisher(TOPIC, PositionSource, queue_size=1, latch=True)
        self._source.publish(to_msg(port.sources.last_switch))
        rospy.Service("select_source", SelectSource, self._select)

    def _select(self, request: SelectSourceRequest) -> SelectSourceResponse:
        with self._port.lock:
            sources = self._port.sources
            done, sentence = sources.select(request.source, now(), self._in_flight())
            message = to_msg(sources.last_switch)
        if done:
            self._source.publish(message)
        rospy.loginfo(f"select_source: {sentence}")
        return SelectSourceResponse(done, sentence)


def follow(port: StatePort, message: PositionSource) -> None:
    """Take the guard's choice over into another node's sources."""
    switch = from_msg(message)
    with port.lock:
        if switch.source not in port.sources.tracks:
            rospy.logerr(f"flight_guard flies on {switch.source}, which is not listened to here")
        elif switch.source != port.sources.active or switch.duration > 0.0:
            port.sources.follow(switch)


def to_msg(switch: Switch) -> PositionSource:
    """Return a change of source as a message."""
    message = PositionSource(
        source=switch.source,
        position_offset=Vector3(*switch.offset),
        velocity_offset=Vector3(*switch.speed_offset),
        duration=switch.duration,
    )
    message.header.stamp = rospy.Time.from_sec(max(0.0, switch.t))
    return message


def from_msg(message: PositionSource) -> Switch:
    """Return a message as a change of source."""
    p, v = message.position_offset, message.velocity_offset
    offsets = np.array([p.x, p.y, p.z]), np.array([v.x, v.y, v.z])
    return Switch(message.source, message.header.stamp.to_sec(), *offsets, message.duration)
