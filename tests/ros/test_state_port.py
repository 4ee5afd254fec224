# SPDX-License-Identifier: MIT
"""What of /tf and of telemetry reaches the sources; needs messages, but no master."""

import dataclasses
import threading
import types

import numpy as np
import pytest

pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")

import rospy
from geometry_msgs.msg import PointStamped, TransformStamped, Vector3Stamped
from tf2_msgs.msg import TFMessage

from nmpc_control.errors import ConfigError
from nmpc_control.estimator import Estimator
from nmpc_control.ros import source_switch, state_port
from nmpc_control.ros.state_port import StatePort
from nmpc_control.state_sources import Switch

NOW = 100.0  # [s]


class Listener:
    """Stands in for subscriptions: keeps every callback by its topic."""

    def __init__(self):
        self.on = {}

    def add(self, topic, kind, callback, *_):
        self.on[topic] = callback


@pytest.fixture
def port(monkeypatch):
    given = {"~position_source": "vicon", "~standby": "gps", "~vicon_frame": "/m100"}
    monkeypatch.setattr(state_port.rospy, "get_param", lambda name, default: given.get(name, ""))
    monkeypatch.setattr(state_port, "now", lambda: NOW)
    said = []
    monkeypatch.setattr(state_port.rospy, "logwarn_throttle", lambda _, words: said.append(words))
    port, listener = StatePort(Estimator(), "world"), Listener()
    port.subscribe(listener)
    return types.SimpleNamespace(port=port, on=listener.on, said=said, given=given)


def transform(child="m100", parent="world", stamp=NOW - 0.01, x=1.0):
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, rospy.Time.from_sec(stamp)
    message.transform.translation.x, message.transform.rotation.w = x, 1.0
    return message


def age(port):
    return port.port.sources.tracks["vicon"].age(NOW)


def test_only_what_is_flown_on_or_on_standby_is_heard(port):
    telemetry = {"dji_sdk/attitude", "dji_sdk/imu", "dji_sdk/velocity"}
    assert set(port.on) == telemetry | {"dji_sdk/local_position", "/tf"}


def test_of_all_transforms_only_the_aircrafts_is_taken(port):
    port.on["/tf"](TFMessage([transform("base_link"), transform("laser"), transform("wand")]))
    assert age(port) == np.inf
    port.on["/tf"](TFMessage([transform("base_link"), transform("/m100")]))
    assert age(port) < 0.01
    assert not port.said


def test_a_transform_from_another_frame_is_refused_with_a_sentence(port):
    port.on["/tf"](TFMessage([transform(parent="odom")]))
    assert age(port) == np.inf
    assert port.said == ["Vicon refused: m100 is given in 'odom', not in 'world'"]


def test_a_stamp_from_the_future_counts_as_now(port):
    point = PointStamped()
    point.header.stamp = rospy.Time.from_sec(NOW + 60.0)
    port.on["dji_sdk/local_position"](point)
    assert port.port.sources.tracks["gps"].age(NOW + 1.0) == pytest.approx(1.0)


def test_who_waits_for_telemetry_gets_the_next_and_not_the_last(port):
    velocity = Vector3Stamped()
    velocity.header.stamp = rospy.Time.from_sec(NOW)
    port.on["dji_sdk/velocity"](velocity)
    assert not port.port.wait_for_velocity(0.01)
    later = threading.Timer(0.02, port.on["dji_sdk/velocity"], [velocity])
    later.start()
    assert port.port.wait_for_velocity(10.0)
    later.join()


def test_a_source_that_is_none_ends_the_node(port):
    port.given["~position_source"] = "external"
    with pytest.raises(ConfigError, match="position_source"):
        StatePort(Estimator(), "world")


def test_a_change_of_source_survives_the_wire(port):
    switch = Switch("gps", 12.5, np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.01, -0.02]), 2.0)
    got = source_switch.from_msg(source_switch.to_msg(switch))
    for field in dataclasses.fields(Switch):
        assert np.all(getattr(got, field.name) == getattr(switch, field.name))
    source_switch.follow(port.port, source_switch.to_msg(switch))
    assert port.port.sources.active == "gps"
