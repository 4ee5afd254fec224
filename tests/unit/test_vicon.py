import dataclasses
import math

import numpy as np
import pytest

from uav_sim.disturbance import load_disturbance
from uav_sim.vicon import Vicon

INDOOR = load_disturbance("indoor").vicon
STEADY = dataclasses.replace(INDOOR, dropout_rate=0.0)


def capture(parameters, duration=20.0, step=0.005, seed="1", speed=0.0):
    """Return poses with the times at which they came."""
    vicon, got = Vicon(parameters, seed), []
    for k in range(1, round(duration / step) + 1):
        t = k * step
        got += [(t, pose) for pose in vicon.poses(t, (speed * t, 2.0, 3.0), (0.1, 0.0, 1.0))]
    return got


@pytest.mark.parametrize("rate", [50.0, 100.0, 120.0, 200.0])
def test_rate(rate):
    poses = capture(dataclasses.replace(STEADY, rate=rate))
    assert len(poses) / 20.0 == pytest.approx(rate, rel=0.01)


def test_stamp_is_the_time_of_capture_and_grows():
    poses = capture(dataclasses.replace(STEADY, position=0.0), speed=4.0)
    stamps = np.array([pose.t for _, pose in poses])
    assert np.diff(stamps).min() > 0.0
    late = np.array([t for t, _ in poses]) - stamps
    assert 0.005 <= late.min() + 1e-9 and late.max() <= 0.005 + 0.002 + 0.005 + 1e-9
    assert [pose.position[0] for _, pose in poses] == pytest.approx(4.0 * stamps)


def test_noise():
    poses = [pose for _, pose in capture(STEADY, duration=40.0)]
    position = np.array([pose.position for pose in poses])
    assert (position - (0.0, 2.0, 3.0)).std(axis=0) == pytest.approx([0.002] * 3, rel=0.06)
    x, y, z, w = np.array([pose.orientation for pose in poses]).T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    assert yaw.mean() == pytest.approx(1.0, abs=0.001)
    assert yaw.std() == pytest.approx(0.004, rel=0.1)


def test_drop_outs_come_as_often_and_last_as_long_as_configured():
    often = dataclasses.replace(INDOOR, dropout_rate=0.5, dropout_time=0.2)
    stamps = np.array([pose.t for _, pose in capture(often, duration=200.0, step=0.01)])
    gaps = np.diff(stamps)
    gaps = gaps[gaps > 0.015]
    assert gaps.max() <= 0.2 + 0.01 + 1e-9
    expected = 200.0 / (1.0 / 0.5 + 0.1) * 0.9  # a tenth falls between two frames
    assert len(gaps) == pytest.approx(expected, rel=0.3)
    assert gaps.mean() == pytest.approx(0.11, abs=0.02)


def test_no_drop_outs_without_a_rate():
    stamps = [pose.t for _, pose in capture(STEADY, duration=30.0)]
    assert np.diff(stamps).max() == pytest.approx(0.01)


def test_the_seed_decides():
    assert capture(INDOOR) == capture(INDOOR)
    assert capture(INDOOR) != capture(INDOOR, seed="2")


def test_quaternions_are_normal():
    for _, pose in capture(INDOOR, duration=1.0):
        assert math.hypot(*pose.orientation) == pytest.approx(1.0)
