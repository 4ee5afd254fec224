# SPDX-License-Identifier: MIT
"""Queues, latching and the order within a packet, at the ports themselves and without a master."""

from threading import Lock
from types import SimpleNamespace

import pytest

pytest.importorskip("dji_sdk", reason="the workspace is not built or not sourced")

import rospy
from sensor_msgs.msg import Joy

from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset
from uav_sim.ros.dji_sdk_server import DjiSdkServer

ORDER = [
    *("rc", "attitude", "imu", "gps_health", "gps_position", "local_position"),
    *("height_above_takeoff", "velocity", "battery_state", "flight_status", "gimbal_angle"),
]


class Ports:
    """Keeps what was opened, and what was published in its order."""

    prefix = ""

    def __init__(self):
        self.queues, self.latched, self.callbacks, self.sent = {}, [], {}, []

    def publisher(self, name, kind, queue_size, latch=False):
        self.queues[name] = queue_size
        self.latched += [name] * latch
        return SimpleNamespace(publish=lambda message: self.sent.append((name, message)))

    def subscriber(self, name, kind, callback, argument=None, queue_size=10):
        self.queues[name] = queue_size
        self.callbacks[name] = lambda message: callback(message, argument)

    def service(self, name, kind, handler):
        self.queues[name] = 10


def server(**undocumented):
    settings = {"flight_controller": {"undocumented": undocumented}}
    sim, ports = SimulatedM100(load_preset("dji_hil", settings)), Ports()
    return sim, ports, DjiSdkServer(sim, Lock(), ports)


def test_every_queue_is_10_and_only_the_reference_is_latched():
    _, ports, _ = server()
    assert set(ports.queues.values()) == {10} and len(ports.queues) == 19 + 6 + 21
    assert ports.latched == ["dji_sdk/local_frame_ref"]


def test_without_activation_there_is_nothing_at_all():
    sim, ports, driver = server(activation_ack=3)
    driver.publish(rospy.Time(1), sim.run(0.1))
    assert ports.queues == {} and ports.sent == []


def test_a_packet_is_published_in_order_with_one_stamp():
    sim, ports, driver = server()
    sim.run(0.1)
    assert sim.set_local_position_reference()
    sim.run(0.1)
    packets = []
    while "battery_state" not in [packet.topic for packet in packets]:
        packets = sim.step()
    stamp = rospy.Time(7)
    driver.publish(stamp, packets)
    assert [name for name, _ in ports.sent] == [f"dji_sdk/{name}" for name in ORDER]
    stamps = {message.header.stamp for _, message in ports.sent if hasattr(message, "header")}
    assert stamps == {stamp}


def test_a_joy_of_any_length_is_taken():
    sim, ports, _ = server()
    generic = ports.callbacks["dji_sdk/flight_control_setpoint_generic"]
    for length in (0, 1, 4, 5, 6, 100_000):
        generic(Joy(axes=[0.0] * length))
    assert sim.run(0.1)
