# SPDX-License-Identifier: MIT
"""The estimator is exact for constant velocity and constant body rates, and refuses bad samples."""

import math

import numpy as np
import pytest

from nmpc_control.estimator import Estimator
from nmpc_control.rotations import quaternion_from_rpy
from nmpc_control.state import ATTITUDE, POSITION, VELOCITY, YAW, YAW_RATE

VELOCITY_WORLD = np.array([1.0, -2.0, 0.5])


def position_at(t):
    return np.array([3.0, 4.0, 5.0]) + VELOCITY_WORLD * t


@pytest.fixture
def estimator():
    estimator = Estimator()
    estimator.add_position(0.97, position_at(0.97))
    estimator.add_velocity(0.98, VELOCITY_WORLD)
    estimator.add_attitude(0.99, quaternion_from_rpy(0.1, -0.2, 0.3))
    estimator.add_imu(0.99, [0.0, 0.0, 0.0])
    return estimator


def test_nothing_is_estimated_until_every_source_was_heard():
    estimator = Estimator()
    estimator.add_position(1.0, [0.0, 0.0, 0.0])
    estimator.add_velocity(1.0, [0.0, 0.0, 0.0])
    estimator.add_attitude(1.0, [0.0, 0.0, 0.0, 1.0])
    assert estimator.estimate(1.0) is None
    estimator.add_imu(1.0, [0.0, 0.0, 0.0])
    assert estimator.estimate(1.0) is not None


def test_constant_velocity_is_exact(estimator):
    estimate = estimator.estimate(1.0)
    np.testing.assert_allclose(estimate.vector[POSITION], position_at(1.0), atol=1e-12)
    np.testing.assert_allclose(estimate.vector[ATTITUDE], [0.1, -0.2, 0.3], atol=1e-12)
    np.testing.assert_array_equal(estimate.vector[VELOCITY], VELOCITY_WORLD)
    ages = estimate.position_age, estimate.velocity_age, estimate.attitude_age, estimate.age
    assert ages == pytest.approx((0.03, 0.02, 0.01, 0.03))


def test_attitude_turns_with_the_body_rates(estimator):
    # level and turning about the body z axis only: yaw moves, roll and pitch stay
    estimator.add_attitude(1.0, quaternion_from_rpy(0.0, 0.0, 0.3))
    estimator.add_imu(1.0, [0.4, -0.2, 0.5])
    vector = estimator.estimate(1.02).vector
    np.testing.assert_allclose(vector[ATTITUDE], [0.008, -0.004, 0.31], atol=1e-4)


def test_yaw_rate_is_the_euler_rate_not_the_body_rate(estimator):
    roll, pitch = 0.3, 0.4
    estimator.add_attitude(1.0, quaternion_from_rpy(roll, pitch, 0.0))
    yaw_rate = 0.7  # a steady turn: body rates are this rate seen in body axes
    rates = [
        -yaw_rate * math.sin(pitch),
        yaw_rate * math.sin(roll) * math.cos(pitch),
        yaw_rate * math.cos(roll) * math.cos(pitch),
    ]
    estimator.add_imu(1.0, rates)
    vector = estimator.estimate(1.05).vector
    assert vector[YAW_RATE] == pytest.approx(yaw_rate)
    np.testing.assert_allclose(vector[ATTITUDE], [roll, pitch, 0.7 * 0.05], atol=1e-12)


def test_yaw_is_continuous_through_two_turns(estimator):
    yaws = np.arange(0.0, 4.0 * math.pi, 0.3)
    for i, yaw in enumerate(yaws):
        estimator.add_attitude(1.0 + 0.01 * i, quaternion_from_rpy(0.0, 0.0, yaw))
        assert estimator.estimate(1.0 + 0.01 * i).vector[YAW] == pytest.approx(yaw)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_samples_that_are_not_finite_are_refused_and_counted(estimator, bad):
    before = estimator.estimate(1.0).vector
    assert not estimator.add_position(1.0, [bad, 0.0, 0.0])
    assert not estimator.add_velocity(1.0, [0.0, bad, 0.0])
    assert not estimator.add_imu(1.0, [0.0, 0.0, bad])
    assert not estimator.add_attitude(1.0, [0.0, 0.0, bad, 1.0])
    assert not estimator.add_position(bad, [0.0, 0.0, 0.0])
    assert estimator.rejected == {"position": 2, "velocity": 1, "imu": 1, "attitude": 1}
    np.testing.assert_array_equal(estimator.estimate(1.0).vector, before)


def test_quaternion_of_wrong_length_is_refused_a_slightly_long_one_normalised(estimator):
    assert not estimator.add_attitude(1.0, [0.0, 0.0, 0.0, 0.0])
    assert not estimator.add_attitude(1.0, [0.0, 0.0, 0.0, 1.06])
    assert not estimator.add_attitude(1.0, [0.0, 0.0, 1.0])
    assert estimator.rejected["attitude"] == 3
    assert estimator.add_attitude(1.0, np.multiply(quaternion_from_rpy(0.1, 0.2, 0.3), 1.03))
    np.testing.assert_allclose(estimator.estimate(1.0).vector[ATTITUDE], [0.1, 0.2, 0.3])


def test_older_samples_are_ignored_without_being_counted(estimator):
    assert not estimator.add_position(0.5, [100.0, 0.0, 0.0])
    assert not estimator.add_position(0.97, [100.0, 0.0, 0.0])
    np.testing.assert_allclose(estimator.estimate(1.0).vector[POSITION], position_at(1.0))
    assert sum(estimator.rejected.values()) == 0


def test_a_dead_source_is_carried_half_a_second_and_its_age_grows(estimator):
    estimate = estimator.estimate(10.97)
    np.testing.assert_allclose(estimate.vector[POSITION], position_at(0.97 + 0.5))
    assert estimate.position_age == pytest.approx(10.0)


def test_vertical_pitch_gives_finite_numbers(estimator):
    estimator.add_attitude(1.0, quaternion_from_rpy(0.0, math.pi / 2, 0.0))
    estimator.add_imu(1.0, [1.0, 1.0, 1.0])
    assert np.isfinite(estimator.estimate(1.01).vector).all()


def test_forgetting_starts_anew_after_the_clock_went_backwards(estimator):
    estimator.forget()
    assert estimator.estimate(1.0) is None
    assert estimator.add_position(0.1, [1.0, 2.0, 3.0])
    assert estimator.age("position", 0.2) == pytest.approx(0.1)
    assert estimator.age("velocity", 0.2) == math.inf
