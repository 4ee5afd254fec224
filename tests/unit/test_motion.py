import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_sim.motion import Chase, Circle, Line, Spline

POINTS = ((0.0, 0.0, 5.0), (4.0, 1.0, 6.0), (5.0, -2.0, 5.0), (1.0, -3.0, 4.0))
PATHS = {
    "straight": Line((1.0, 2.0, 3.0), (0.5, -1.0, 0.2)),
    "stops": Line((1.0, 2.0, 3.0), (2.0, 0.0, 0.0), 4.0, "stop"),
    "bounces": Line((1.0, 2.0, 3.0), (0.0, 3.0, 4.0), 10.0, "bounce"),
    "circle": Circle((3.0, 0.0, 2.0), (0.0, 0.0), 1.5),
    "circle, other way": Circle((3.0, 0.0, 2.0), (1.0, 1.0), -4.0),
    "spline": Spline(POINTS, 1.2, "stop"),
    "spline to and fro": Spline(POINTS, 1.2, "bounce"),
    "closed spline": Spline(POINTS, 3.0, "loop"),
}
times = st.floats(0.0, 60.0)


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@settings(max_examples=30)
@given(t=times)
def test_velocity_is_the_derivative_of_the_position(path, t):
    h = 1e-5
    if path.kinks(t - 2 * h, t + 2 * h):
        return
    after, before = np.array(path.position(t + h)), np.array(path.position(max(t - h, 0.0)))
    slope = (after - before) / (h + min(t, h))
    assert path.velocity(t) == pytest.approx(tuple(slope), abs=1e-3)


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@settings(max_examples=30)
@given(t=times)
def test_speed_stays_below_its_bound(path, t):
    assert np.linalg.norm(path.velocity(t)) <= path.max_speed + 1e-9


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS)
@settings(max_examples=30)
@given(t=times, h=st.floats(1e-3, 1.0), share=st.floats(0.0, 1.0))
def test_between_kinks_a_path_stays_near_its_chord(path, t, h, share):
    if path.kinks(t, t + h):
        return
    a, b = np.array(path.position(t)), np.array(path.position(t + h))
    point = np.array(path.position(t + share * h))
    off = np.linalg.norm(point - (a + share * (b - a)))
    assert off <= path.max_acceleration * h * h / 8 + 1e-9


def test_a_line_stops_at_its_distance():
    path = PATHS["stops"]
    assert path.position(2.0) == path.position(50.0) == (5.0, 2.0, 3.0)
    assert path.velocity(1.9) == (2.0, 0.0, 0.0) and path.velocity(2.0) == (0.0, 0.0, 0.0)
    assert path.kinks(0.0, 5.0) == (2.0,) and path.kinks(2.0, 5.0) == ()


def test_a_line_bounces_at_both_ends():
    path = PATHS["bounces"]  # 5 m/s over 10 m
    assert path.position(2.0) == pytest.approx((1.0, 8.0, 11.0))
    assert path.position(4.0) == pytest.approx((1.0, 2.0, 3.0))
    assert path.position(5.0) == pytest.approx((1.0, 5.0, 7.0))
    assert path.velocity(3.0) == pytest.approx((0.0, -3.0, -4.0))
    assert path.kinks(0.0, 9.0) == pytest.approx((2.0, 4.0, 6.0, 8.0))
    assert path.kinks(2.0, 4.0) == ()


def test_a_circle_keeps_its_radius_height_and_speed():
    path = PATHS["circle"]
    for t in np.linspace(0.0, 20.0, 50):
        x, y, z = path.position(t)
        assert (math.hypot(x, y), z) == pytest.approx((3.0, 2.0))
    assert path.velocity(0.0) == pytest.approx((0.0, 1.5, 0.0)), "counter-clockwise"
    assert path.position(2 * math.pi * 3.0 / 1.5) == pytest.approx(path.position(0.0))


def test_a_spline_meets_its_points_at_times_by_distance():
    path, t = PATHS["spline"], 0.0
    assert path.position(0.0) == pytest.approx(POINTS[0])
    for a, b in zip(POINTS, POINTS[1:]):
        t += math.dist(a, b) / 1.2
        assert path.position(t) == pytest.approx(b)
    assert path.duration == pytest.approx(t)
    assert path.velocity(0.0) == pytest.approx((0.0, 0.0, 0.0))
    assert path.position(t + 9.0) == pytest.approx(POINTS[-1])


def test_a_spline_goes_back_the_way_it_came():
    path = PATHS["spline to and fro"]
    T = path.duration
    assert path.position(1.3 * T) == pytest.approx(path.position(0.7 * T))
    assert path.velocity(1.3 * T) == pytest.approx([-v for v in path.velocity(0.7 * T)])
    assert path.position(2.4 * T) == pytest.approx(path.position(0.4 * T))


def test_a_closed_spline_has_no_beginning():
    path = PATHS["closed spline"]
    T = path.duration
    assert path.position(T + 0.3) == pytest.approx(path.position(0.3))
    assert path.velocity(T - 1e-9) == pytest.approx(path.velocity(0.0), abs=1e-6)
    assert np.linalg.norm(path.velocity(0.0)) > 0.5


@given(
    target=st.tuples(*[st.floats(-20, 20)] * 3),
    velocity=st.tuples(*[st.floats(-1, 1)] * 3),
    h=st.floats(1e-3, 0.1),
)
def test_a_chase_keeps_its_limits(target, velocity, h):
    chase = Chase(speed=2.0, acceleration=3.0)
    position, new = chase.advance((0.0, 0.0, 0.0), velocity, target, h)
    assert math.dist(new, velocity) <= 3.0 * h + 1e-9
    assert math.hypot(*new[:2], new[2]) <= 2.0 + 1e-9
    mean = [0.5 * h * (a + b) for a, b in zip(velocity, new)]
    assert position == pytest.approx(tuple(mean))


def test_a_chase_catches_what_flees_more_slowly_and_not_what_is_faster():
    def gap(speed, duration=30.0, h=0.02):
        chase, position, velocity = Chase(2.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        least = math.inf
        for k in range(round(duration / h)):
            target = (5.0 + speed * k * h, 3.0, 2.0)
            position, velocity = chase.advance(position, velocity, target, h)
            least = min(least, math.dist(position, target))
        return least

    assert gap(1.0) < 0.1
    assert gap(2.5) > 3.0
