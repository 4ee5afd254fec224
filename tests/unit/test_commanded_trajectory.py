# SPDX-License-Identifier: MIT
"""Trajectories commanded point by point: met where they can be flown, refused in words else."""

import numpy as np
import pytest

from nmpc_control.commanded_trajectory import MOST_POINTS, CommandError, commanded_trajectory
from nmpc_control.params import load_parameters

LIMITS = load_parameters().limits
TIMES = np.array([0.0, 2.0, 4.0, 7.0])
POSITIONS = np.array([[0.0, 0, 2], [2, 1, 2], [4, 0, 3], [6, 0, 2]])
YAWS = np.array([3.0, -3.0, -2.5, -2.0])


def made(times=TIMES, positions=POSITIONS, yaws=YAWS, velocities=None, limits=LIMITS):
    return commanded_trajectory(
        np.array(times, float), np.array(positions, float), yaws, velocities, 0.7, limits
    )


def test_points_are_met_at_their_times_from_rest_to_rest():
    sample = made(times=TIMES + 5.0).sample(TIMES)
    assert sample.position == pytest.approx(POSITIONS)
    assert np.linalg.norm(sample.velocity[[0, -1]], axis=1) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.cos(sample.yaw) == pytest.approx(np.cos(YAWS))
    assert np.ptp(sample.yaw) < 2.0, "turned the shorter way"


def test_given_velocities_are_met():
    velocities = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0.2], [0, 0, 0]])
    sample = made(velocities=velocities).sample(TIMES)
    assert sample.position == pytest.approx(POSITIONS)
    assert sample.velocity == pytest.approx(velocities, abs=1e-9)


def test_velocity_and_acceleration_are_the_derivatives_of_the_position():
    trajectory, t, h = made(), np.linspace(0.1, 6.9, 50), 1e-4
    low, mid, high = (trajectory.sample(t + k * h) for k in (-1, 0, 1))
    assert mid.velocity == pytest.approx((high.position - low.position) / (2 * h), abs=1e-5)
    assert mid.acceleration == pytest.approx((high.velocity - low.velocity) / (2 * h), abs=1e-4)
    assert mid.yaw_rate == pytest.approx((high.yaw - low.yaw) / (2 * h), abs=1e-5)


def test_without_rotations_the_yaw_stays():
    sample = made(yaws=None).sample(TIMES)
    assert sample.yaw == pytest.approx([0.7] * 4)
    assert not sample.yaw_rate.any()


def changed(array, index, value):
    array = np.array(array, float)
    array[index] = value
    return array


MOVING = np.ones((4, 3))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"times": [0.0], "positions": POSITIONS[:1], "yaws": None}, "got 1 points"),
        (
            {"times": np.arange(MOST_POINTS + 1), "positions": np.zeros((MOST_POINTS + 1, 3))},
            f"got {MOST_POINTS + 1} points",
        ),
        ({"positions": changed(POSITIONS, (2, 1), np.nan)}, "point 3: its position is not finite"),
        ({"yaws": changed(YAWS, 1, np.inf)}, "point 2: its yaw is not finite"),
        ({"velocities": changed(MOVING, (3, 0), np.nan)}, "point 4: its velocity is not finite"),
        ({"times": [-1.0, 2.0, 4.0, 7.0]}, "none negative"),
        ({"times": [0.0, 2.0, 2.0, 7.0]}, "point 3: at 2 s"),
        ({"times": [0.0, 2.0, 1.0, 7.0]}, "point 3: at 1 s"),
        ({"times": [0.0, 2.0, 4.0, 9000.0]}, "it takes 9000 s"),
        ({"velocities": MOVING}, "point 1: 1.73 m/s, it must begin at rest"),
        ({"velocities": changed(MOVING, 0, 0.0)}, "point 4: 1.73 m/s, it must end at rest"),
        ({"positions": changed(POSITIONS, (2, 0), 60.0)}, "speed [m/s]: got"),
        ({"positions": changed(POSITIONS, (1, 2), 0.1)}, "the place is outside of the fence"),
        ({"times": TIMES / 4.0}, "tilt [rad]: got"),
        ({"yaws": np.array([0.0, 3.0, 0.0, 3.0])}, "yaw rate [rad/s]: got"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_words(arguments, words):
    with pytest.raises(CommandError) as error:
        made(**arguments)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_between_the_points_the_fence_counts_too():
    """The points are inside, the curve that joins them is not; twin of the same with room."""
    positions = np.array([[0.0, 0, 0.4], [1, 0, 3.0], [2, 0, 0.4], [3, 0, 0.4], [4, 0, 3.0]])
    times = np.array([0.0, 3.0, 6.0, 9.0, 12.0])
    with pytest.raises(CommandError, match="outside of the fence"):
        made(times, positions, None)
    assert made(times, positions + [0, 0, 2.0], None).duration == 12.0
