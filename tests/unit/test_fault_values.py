"""Every topic can be frozen, not a number, or displaced, each in its own unit."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uav_sim.faults.topics import NUMBERS, TELEMETRY
from uav_sim.faults.values import map_numbers, shifted
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import GeoPoint, load_preset
from uav_sim.telemetry import LocalFrame


@pytest.fixture(scope="module")
def values():
    """Return a value of every topic, of an aircraft that turns and moves."""
    sim = SimulatedM100(load_preset("dji_hil"))
    sim.place((1.0, 2.0, 10.0), velocity=(1.0, -1.0, 0.5), yaw=0.7, authority=True)
    return {packet.topic: packet.value for packet in sim.run(0.5)}


def numbers(value):
    """Return all numbers in a value."""
    if isinstance(value, GeoPoint):
        return [value.latitude, value.longitude, value.altitude]
    if isinstance(value, tuple):
        return [number for part in value for number in numbers(part)]
    return [value]


@pytest.mark.parametrize("topic", NUMBERS)
def test_every_number_becomes_nan_and_the_type_stays(values, topic):
    wrong = map_numbers(values[topic], lambda _: math.nan)
    assert type(wrong) is type(values[topic])
    assert len(numbers(wrong)) == len(numbers(values[topic]))
    assert all(math.isnan(number) for number in numbers(wrong))


@pytest.mark.parametrize("topic", TELEMETRY)
def test_an_offset_changes_a_topic_and_no_offset_does_not(values, topic):
    value = values[topic]
    same = shifted(topic, value, (0.0, 0.0, 0.0))
    assert type(same) is type(value) and numbers(same) == pytest.approx(numbers(value))
    moved = shifted(topic, value, (1.0, 1.0, 1.0))
    assert len(numbers(moved)) == len(numbers(value))
    assert numbers(moved) != pytest.approx(numbers(value), abs=1e-9)


def test_an_attitude_turns_about_world_axes(values):
    moved = shifted("attitude", values["attitude"], (0.1, -0.2, 0.3))
    turn = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    expected = (turn * Rotation.from_quat(values["attitude"])).as_quat()
    assert abs(np.dot(moved, expected)) == pytest.approx(1.0)


def test_a_place_on_earth_moves_by_metres(values):
    home = load_preset("dji_hil").home
    frame = LocalFrame(home)
    frame.reference = home
    before = frame.to_local(values["gps_position"])
    after = frame.to_local(shifted("gps_position", values["gps_position"], (30.0, -40.0, 5.0)))
    assert np.subtract(after, before) == pytest.approx([30.0, -40.0, 5.0], abs=0.01)


def test_whole_numbers_stay_within_a_byte():
    assert shifted("gps_health", 5, (-9.0, 0.0, 0.0)) == 0
    assert shifted("flight_status", 3, (300.0, 0.0, 0.0)) == 255
