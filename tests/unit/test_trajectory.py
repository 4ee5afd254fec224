# SPDX-License-Identifier: MIT
"""Trajectories against closed forms."""

import math
from functools import partial

import numpy as np
import pytest

from nmpc_control import trajectory
from nmpc_control.bspline import BSpline
from nmpc_control.curves import CurveError
from nmpc_control.trajectory import Trajectory

CURVED = np.array([[0.0, 0, 1], [2, 2, 2], [4, -2, 3], [6, 3, 2], [8, 0, 1]])
CUBIC = partial(BSpline.interpolate, degree=3)


def every_kind() -> dict:
    """Return one trajectory of each kind."""
    return {
        "hold": trajectory.hold([1.0, 2, 3], 5.0, 0.4),
        "line": trajectory.line([0.0, 0, 1], [3.0, 4, 1], speed=2.0),
        "polyline": trajectory.polyline(CURVED, speed=1.0),
        "waypoints": trajectory.waypoints(CURVED, speed=1.0),
        "constant speed": trajectory.waypoints(
            CURVED, speed=1.0, timing="arc_length", yaw="tangent"
        ),
        "approximating": trajectory.waypoints(
            CURVED, 1.0, spline=partial(BSpline.approximate, degree=2)
        ),
        "yaw list": trajectory.waypoints(CURVED, speed=1.0, yaw=[0.0, 1.0, 3.0, -3.0, -2.0]),
        "circle": trajectory.circle([0.0, 0, 2], 3.2, speed=0.65, yaw="tangent"),
        "sinusoidal": trajectory.sinusoidal([0.0, 0, 2], 2.5, 1.0, speed=0.5, yaw="tangent"),
        "step": trajectory.step([0.0, 0, 1], [1.5, 1.5, 2.5], 5.0, 15.0),
        "approach": trajectory.approach([0.0, 0, 1], [3.0, 4, 1], 2.0, 1.0, 3.0, -3.0),
    }


KINDS = every_kind()
SMOOTH = [kind for kind in KINDS if kind not in ("polyline", "step", "approach")]


@pytest.mark.parametrize("kind", KINDS)
def test_samples_have_one_row_per_time(kind: str) -> None:
    sample = KINDS[kind].sample(np.linspace(-1.0, 100.0, 7))
    for name in ("position", "velocity", "acceleration"):
        assert getattr(sample, name).shape == (7, 3)
    assert sample.yaw.shape == sample.yaw_rate.shape == (7,)


@pytest.mark.parametrize("kind", KINDS)
def test_before_the_start_and_after_the_end_it_stands_still(kind: str) -> None:
    path = KINDS[kind]
    sample = path.sample([-1e6, -1e-3, path.duration, path.duration + 1e6])
    assert np.allclose(sample.position, [path.start, path.start, path.end, path.end])
    assert not sample.velocity.any() and not sample.acceleration.any() and not sample.yaw_rate.any()
    inside = path.sample([0.0, path.duration * (1 - 1e-9)])
    assert np.allclose(sample.yaw[[1, 2]], inside.yaw, atol=1e-5)


@pytest.mark.parametrize("kind", SMOOTH)
def test_velocity_acceleration_and_yaw_rate_are_the_derivatives(kind: str) -> None:
    path, h = KINDS[kind], 1e-5
    t = np.linspace(0.01, 0.99, 73) * path.duration
    low, mid, high = path.sample(t - h), path.sample(t), path.sample(t + h)
    assert np.allclose(mid.velocity, (high.position - low.position) / (2 * h), atol=1e-5)
    assert np.allclose(mid.acceleration, (high.velocity - low.velocity) / (2 * h), atol=1e-3)
    assert np.allclose(mid.yaw_rate, (high.yaw - low.yaw) / (2 * h), atol=1e-4)


def test_line_has_the_given_speed_and_the_duration_that_follows() -> None:
    path = KINDS["line"]
    assert path.duration == pytest.approx(2.5)
    assert np.allclose(path.sample(1.25).position, [[1.5, 2.0, 1.0]])
    assert np.allclose(path.sample(1.0).velocity, [[1.2, 1.6, 0.0]])


def test_circle_has_its_radius_speed_and_centripetal_acceleration() -> None:
    path = KINDS["circle"]
    assert path.duration == pytest.approx(2 * math.pi * 3.2 / 0.65)
    sample = path.sample(np.linspace(0.0, path.duration * 0.999, 50))
    arm = sample.position - [0.0, 0.0, 2.0]
    assert np.allclose(np.linalg.norm(arm, axis=1), 3.2)
    assert np.allclose(np.linalg.norm(sample.velocity, axis=1), 0.65)
    assert np.allclose(sample.acceleration, -(0.65**2) / 3.2**2 * arm)
    assert np.allclose(sample.yaw_rate, 0.65 / 3.2)
    assert sample.yaw[0] == pytest.approx(math.pi / 2)
    assert np.allclose(path.end, path.start)


def test_a_circle_with_negative_turns_is_clockwise_from_its_start_angle() -> None:
    path = trajectory.circle([0.0, 0, 1], 2.0, duration=8.0, turns=-0.5, start_angle=math.pi / 2)
    assert np.allclose(path.sample([0.0, 4.0, 8.0]).position, [[0, 2, 1], [2, 0, 1], [0, -2, 1]])


@pytest.mark.parametrize("timing", ["uniform", "arc_length"])
def test_a_closed_hexagon_is_at_corner_k_at_k_sixths_of_its_time(timing: str) -> None:
    angles = np.arange(6) * math.pi / 3
    corners = 6.2 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    path = trajectory.polyline(corners, speed=1.5, timing=timing, closed=True)
    assert path.duration == pytest.approx(6 * 6.2 / 1.5)
    at_corners = path.sample(np.arange(7) * path.duration / 6).position
    assert np.allclose(at_corners, corners[[0, 1, 2, 3, 4, 5, 0]], atol=1e-9)
    times = np.linspace(0.0, path.duration * 0.9999, 301)
    assert np.allclose(np.linalg.norm(path.sample(times).velocity, axis=1), 1.5)


def test_uniform_timing_passes_waypoints_at_equal_times() -> None:
    path = KINDS["waypoints"]
    assert path.duration == pytest.approx(path.length / 1.0)
    assert np.allclose(path.sample(np.linspace(0, path.duration, 5)).position, CURVED)


def test_arc_length_timing_has_constant_speed_on_the_same_curve() -> None:
    path, uniform = KINDS["constant speed"], KINDS["waypoints"]
    assert path.duration == pytest.approx(uniform.duration)
    sample = path.sample(np.linspace(0.0, path.duration * 0.9999, 500))
    assert np.allclose(np.linalg.norm(sample.velocity, axis=1), 1.0)
    dense = uniform.sample(np.linspace(0, uniform.duration, 20001)).position
    for point in sample.position[::50]:
        assert np.linalg.norm(dense - point, axis=1).min() < 2e-3


def test_step_jumps_once() -> None:
    sample = KINDS["step"].sample([0.0, 4.999, 5.0, 14.0])
    assert np.allclose(sample.position, [[0, 0, 1], [0, 0, 1], [1.5, 1.5, 2.5], [1.5, 1.5, 2.5]])
    assert not sample.velocity.any()


@pytest.mark.parametrize(
    ("distance", "duration", "peak"),
    [
        (10.0, 10.0 / 2.0 + 2.0 / 1.0, 2.0),
        (1.0, 2.0, 1.0),
    ],  # with cruise: d/v + v/a; without: 2 sqrt(d/a)
)
def test_approach_is_a_trapezoid_or_a_triangle(
    distance: float, duration: float, peak: float
) -> None:
    path = trajectory.approach([0.0, 0, 1], [0.0, distance, 1], 2.0, 1.0)
    assert path.duration == pytest.approx(duration)
    t = np.linspace(0.0, duration, 4001)
    sample = path.sample(t)
    assert sample.velocity[:, 1].max() == pytest.approx(peak, rel=1e-3)
    assert np.allclose(sample.velocity[[0, -1]], 0.0)
    assert np.abs(sample.acceleration).max() <= 1.0 + 1e-9
    assert np.allclose(np.gradient(sample.position[:, 1], t), sample.velocity[:, 1], atol=2e-3)
    assert np.allclose(path.end, [0.0, distance, 1.0])


def test_approach_turns_on_the_shorter_way_and_not_too_fast() -> None:
    path = KINDS["approach"]
    sample = path.sample(np.linspace(0, path.duration, 200))
    assert sample.yaw[0] == 3.0
    assert sample.yaw[-1] == pytest.approx(2 * math.pi - 3.0)
    turn = trajectory.approach([0.0, 0, 1], [0.0, 0, 1], 2.0, 1.0, 0.0, 3.0, yaw_rate=0.5)
    assert turn.duration == pytest.approx(3.0 / 0.5 + 1.0)
    assert np.abs(turn.sample(np.linspace(0, 7, 99)).yaw_rate).max() <= 0.5 + 1e-9


def test_approach_to_where_it_is_ends_at_once() -> None:
    path = trajectory.approach([1.0, 2, 3], [1.0, 2, 3], 2.0, 1.0, 0.3, 0.3)
    assert path.duration == 0.0
    sample = path.sample([0.0, 1.0])
    assert np.allclose(sample.position, [1.0, 2.0, 3.0])
    assert np.allclose(sample.yaw, 0.3)


def heading_of(path: Trajectory, t: np.ndarray) -> np.ndarray:
    """Return the direction of the velocity [rad] at times (M,)."""
    velocity = path.sample(t).velocity
    return np.arctan2(velocity[:, 1], velocity[:, 0])


@pytest.mark.parametrize("kind", ["circle", "sinusoidal", "constant speed"])
def test_tangent_yaw_follows_the_velocity_without_jumps(kind: str) -> None:
    path = KINDS[kind]
    t = np.linspace(0.0, path.duration * 0.9999, 2000)
    yaw = path.sample(t).yaw
    assert np.allclose(np.cos(yaw - heading_of(path, t)), 1.0)
    assert np.abs(np.diff(yaw)).max() < 0.1


def test_tangent_yaw_is_held_where_there_is_no_level_motion() -> None:
    path = trajectory.polyline(
        [[0.0, 0, 1], [0, 2, 1], [0, 2, 3], [-2, 2, 3]], speed=1.0, yaw="tangent"
    )
    yaw = path.sample(np.array([1.0, 3.0, 5.0])).yaw
    assert np.allclose(yaw, [math.pi / 2, math.pi / 2, math.pi])
    assert (
        not trajectory.line([0.0, 0, 1], [0.0, 0, 2], speed=1.0, yaw="tangent")
        .sample(0.5)
        .yaw.any()
    )


def test_a_yaw_list_is_met_at_the_waypoints_on_the_shorter_way() -> None:
    path = KINDS["yaw list"]
    yaw = path.sample(np.linspace(0, path.duration, 5)).yaw
    assert np.allclose(yaw, [0.0, 1.0, 3.0, 2 * math.pi - 3.0, 2 * math.pi - 2.0])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: trajectory.hold([0, 0, math.nan], 5.0), "position"),
        (lambda: trajectory.hold([0, 0], 5.0), "position"),
        (lambda: trajectory.hold([0, 0, 1], 0.0), "duration: got 0.0"),
        (lambda: trajectory.hold([0, 0, 1], 5.0, math.inf), "yaw"),
        (lambda: trajectory.line([0, 0, 1], [0, 0, 1], speed=1.0), "length"),
        (lambda: trajectory.line([0, 0, 1], [1, 0, 1], speed=-1.0), "speed: got -1.0"),
        (lambda: trajectory.line([0, 0, 1], [1, 0, 1]), "speed: got None"),
        (lambda: trajectory.line([0, 0, 1], [1, 0, 1], 1.0, 1.0), "not both"),
        (lambda: trajectory.waypoints([[0, 0, 1]], 1.0), "two points"),
        (lambda: trajectory.waypoints([[0, 0], [1, 1]], 1.0), "points"),
        (lambda: trajectory.waypoints(CURVED, 1.0, timing="fast"), "timing: got 'fast'"),
        (lambda: trajectory.waypoints(CURVED, 1.0, yaw="north"), "yaw: got 'north'"),
        (lambda: trajectory.waypoints(CURVED, 1.0, yaw=[0.0, 1.0]), "one number per point, 5"),
        (lambda: trajectory.circle([0, 0, 1], -1.0, speed=1.0), "radius: got -1.0"),
        (lambda: trajectory.approach([0, 0, 1], [1, 0, 1], 0.0, 1.0), "speed: got 0.0"),
    ],
)
def test_bad_input_is_a_named_error(call: object, words: str) -> None:
    with pytest.raises(CurveError) as caught:
        call()
    assert words in str(caught.value)
