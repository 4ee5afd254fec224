# SPDX-License-Identifier: MIT
"""A scan, its frame and the aircraft's pose lead back to what was seen."""

import dataclasses
from io import BytesIO

import numpy as np
import pytest

pytest.importorskip("dji_sdk", reason="the workspace is not built or not sourced")

import rospy
from geometry_msgs.msg import TransformStamped
from scipy.spatial.transform import Rotation

from uav_sim.body import BodyState
from uav_sim.laser import Laser, load_laser, rotation
from uav_sim.obstacle import Obstacle
from uav_sim.ros import laser_port

BALL = Obstacle("ball", "sphere", (1.0,), (4.0, 1.0, 5.0))
POSITION, RPY = (0.0, 0.0, 5.0), (0.1, -0.15, 0.4)


class Wire:
    """Takes the place of ports and of the broadcaster; messages become bytes and back."""

    def __init__(self):
        self.messages = []

    def name(self, name):
        return f"dji1/{name}"

    def publisher(self, name, kind, queue_size, latch=False):
        assert name == "scan"
        return self

    def publish(self, message):
        buffer = BytesIO()
        message.serialize(buffer)
        self.messages.append(type(message)().deserialize(buffer.getvalue()))

    sendTransform = publish  # noqa: N815 tf2's name


@pytest.mark.parametrize("level", [False, True])
def test_echoes_lie_on_the_ball(monkeypatch, level):
    wire = Wire()
    monkeypatch.setattr(laser_port, "TransformBroadcaster", lambda: wire)
    laser = Laser(
        dataclasses.replace(
            load_laser("utm_30lx"),
            noise=0.0,
            level=level,
            sees_ground=False,
            mount_rpy=(0.0, 0.05, 0.3),
        )
    )
    port = laser_port.LaserPort(laser, wire)
    ranges = laser.scan(POSITION, RPY, [BodyState(BALL, BALL.position, (0.0, 0.0, 0.0))])
    port.publish(rospy.Time(3), ranges, RPY)
    mount, scan = wire.messages
    assert isinstance(mount, TransformStamped)
    assert (mount.header.frame_id, mount.child_frame_id) == ("dji1/base_link", "dji1/laser")
    assert scan.header.frame_id == "dji1/laser"
    assert scan.header.stamp == mount.header.stamp == rospy.Time(3)
    assert scan.range_min < scan.range_max and scan.scan_time == pytest.approx(0.025)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    assert angles[-1] == pytest.approx(scan.angle_max, abs=1e-4)

    hit = np.isfinite(scan.ranges)
    assert hit.sum() > 20
    flat = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    points = np.array(scan.ranges)[hit, None] * flat[hit]
    t, q = mount.transform.translation, mount.transform.rotation
    turned = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply(points) + (t.x, t.y, t.z)
    seen = turned @ rotation(RPY).T + POSITION
    assert np.linalg.norm(seen - BALL.position, axis=1) == pytest.approx(1.0, abs=1e-4)
