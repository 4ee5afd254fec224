# SPDX-License-Identifier: MIT
"""A gyro or accelerometer that contradicts the attitude betrays hardware in the loop."""

import numpy as np
import pytest

from nmpc_control.analysis.record import Series
from nmpc_control.analysis.source import is_hardware_in_the_loop

TIMES = np.arange(0.0, 20.0, 0.01)
GENERATOR = np.random.default_rng(0)


def imu(amplitude, gyro_works, vibration):
    """Roll swings at 1 rad/s of phase; the specific force stays along the body's z axis."""
    roll, rate = amplitude * np.sin(TIMES), amplitude * np.cos(TIMES)
    zero = np.zeros_like(roll)
    quaternion = np.stack([np.sin(roll / 2), zero, zero, np.cos(roll / 2)], axis=1)
    rates = np.stack([rate * gyro_works, zero, zero], axis=1)
    rates += 0.0007 * GENERATOR.normal(size=rates.shape)
    force = np.tile([0.0, 0.0, 9.8], (len(TIMES), 1))
    force += vibration * GENERATOR.normal(size=force.shape)
    return Series(TIMES, np.hstack([quaternion, rates, force]))


@pytest.mark.parametrize(
    ("gyro_works", "vibration", "expected"),
    [(True, 0.5, False), (False, 0.5, True), (True, 0.03, True), (False, 0.03, True)],
)
def test_verdict(gyro_works, vibration, expected):
    assert is_hardware_in_the_loop(imu(0.5, gyro_works, vibration)) is expected


def test_nothing_can_be_told_of_a_still_aircraft():
    assert is_hardware_in_the_loop(imu(0.01, False, 0.0)) is None


def test_repeated_stamps_and_few_samples_do_no_harm():
    samples = imu(0.5, True, 0.5)
    assert is_hardware_in_the_loop(Series(np.zeros(len(TIMES)), samples.values)) in (True, False)
    assert is_hardware_in_the_loop(Series(TIMES[:3], samples.values[:3])) is None
