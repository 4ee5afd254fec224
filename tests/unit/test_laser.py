import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_sim.body import BodyState
from uav_sim.errors import ConfigError
from uav_sim.laser import Laser, laser_names, load_laser, rotation
from uav_sim.obstacle import Obstacle

UTM = load_laser("utm_30lx")
PLAIN = dataclasses.replace(
    UTM, noise=0.0, sees_ground=False, mount_position=(0.0, 0.0, 0.0), angle_increment=0.01
)
BALL = Obstacle("ball", "sphere", (0.5,), (5.0, 0.0, 5.0))
PILLAR = Obstacle("pillar", "cylinder", (0.5, 4.0), (5.0, 0.0, 5.0))
WALL = Obstacle("wall", "box", (1.0, 8.0, 6.0), (5.0, 0.0, 5.0))
HERE = (0.0, 0.0, 5.0)


def seen(obstacle, position=HERE, rpy=(0.0, 0.0, 0.0), **changes):
    laser = Laser(dataclasses.replace(PLAIN, **changes))
    state = BodyState(obstacle, obstacle.position, (0.0, 0.0, 0.0))
    return laser, laser.scan(position, rpy, [state])


def ahead(laser, ranges, angle=0.0):
    return ranges[np.argmin(abs(laser.angles - angle))]


def test_resolution_and_field_of_view_of_the_named_scanners():
    assert {"utm_30lx", "ust_10lx"} <= set(laser_names())
    for name in laser_names():
        laser = Laser(load_laser(name))
        assert len(laser.angles) == 1081
        assert np.degrees(laser.angles[[0, -1]]) == pytest.approx([-135.0, 135.0], abs=1e-3)


@pytest.mark.parametrize(("obstacle", "nearest"), [(BALL, 4.5), (PILLAR, 4.5), (WALL, 4.5)])
def test_range_ahead_and_nothing_elsewhere(obstacle, nearest):
    laser, ranges = seen(obstacle)
    assert ahead(laser, ranges) == pytest.approx(nearest, abs=1e-3)
    assert np.isinf(ahead(laser, ranges, 1.5)) and ahead(laser, ranges, 1.5) > 0


def test_width_of_a_ball_is_that_of_its_tangents():
    laser, ranges = seen(BALL)
    hit = laser.angles[np.isfinite(ranges)]
    assert hit.max() == pytest.approx(math.asin(0.1), abs=0.01)
    assert hit.min() == pytest.approx(-math.asin(0.1), abs=0.01)


def test_angles_turn_left_and_yaw_turns_the_scan():
    laser, ranges = seen(BALL, rpy=(0.0, 0.0, -0.5))
    assert ahead(laser, ranges, 0.5) == pytest.approx(4.5, abs=1e-3)


def test_a_tilted_plane_passes_below_a_ball_and_a_level_one_does_not():
    nose_down = (0.0, 0.2, 0.0)  # 1 m below its centre at 5 m
    _, tilted = seen(BALL, rpy=nose_down)
    assert not np.isfinite(tilted).any()
    laser, level = seen(BALL, rpy=nose_down, level=True)
    assert ahead(laser, level) == pytest.approx(4.5, abs=1e-3)


def test_a_tilted_plane_meets_the_ground():
    laser, ranges = seen(BALL, rpy=(0.0, 0.3, 0.0), sees_ground=True)
    assert ahead(laser, ranges) == pytest.approx(5.0 / math.sin(0.3), rel=1e-4)
    assert np.isinf(ahead(laser, ranges, 2.3))


def test_mount_is_in_body_axes():
    laser, ranges = seen(BALL, rpy=(0.0, 0.0, 0.0), mount_position=(0.5, 0.0, 0.0))
    assert ahead(laser, ranges) == pytest.approx(4.0, abs=1e-3)
    sideways = dataclasses.replace(BALL, position=(0.0, 5.0, 5.0))
    laser, ranges = seen(
        sideways, rpy=(0.0, 0.0, math.pi / 2), mount_position=(0.5, 0.0, 0.0), mount_rpy=(0, 0, 1.0)
    )
    assert ahead(laser, ranges, -1.0) == pytest.approx(4.0, abs=1e-3)


def test_the_nearer_one_hides_the_farther():
    laser = Laser(PLAIN)
    near = dataclasses.replace(BALL, position=(3.0, 0.0, 5.0))
    states = [BodyState(o, o.position, (0.0, 0.0, 0.0)) for o in (WALL, near)]
    assert ahead(laser, laser.scan(HERE, (0.0, 0.0, 0.0), states)) == pytest.approx(2.5, abs=1e-3)


def test_out_of_range_is_plus_and_too_near_minus_infinity():
    laser, ranges = seen(BALL, range_max=4.0)
    assert (ranges == np.inf).all()
    laser, ranges = seen(BALL, range_min=4.8)
    assert ahead(laser, ranges) == -np.inf
    laser, ranges = seen(BALL, position=(5.0, 0.1, 5.0))
    assert (ranges == -np.inf).all(), "inside"


@given(
    shape=st.sampled_from([BALL, PILLAR, WALL]),
    x=st.floats(-4, 4),
    y=st.floats(-4, 4),
    z=st.floats(1, 9),
    roll=st.floats(-0.6, 0.6),
    pitch=st.floats(-0.6, 0.6),
    yaw=st.floats(-3, 3),
)
def test_every_echo_lies_on_the_surface_and_no_beam_passes_through(
    shape, x, y, z, roll, pitch, yaw
):
    laser, ranges = seen(shape, (x, y, z), (roll, pitch, yaw), angle_increment=0.2, range_min=0.0)
    local = np.stack([np.cos(laser.angles), np.sin(laser.angles), 0 * laser.angles])
    beams = rotation((roll, pitch, yaw)) @ local
    offset = np.array([x, y, z]) - shape.position
    for beam, distance in zip(beams.T, ranges):
        if np.isfinite(distance):
            assert shape.distance(*(offset + distance * beam)) == pytest.approx(0.0, abs=1e-6)
        free = distance if np.isfinite(distance) else 30.0
        for s in np.linspace(0.0, 0.999, 40) * free:
            assert shape.distance(*(offset + s * beam)) > -1e-6


def test_noise_has_the_sigma_and_the_seed_decides():
    flat = dataclasses.replace(PLAIN, noise=0.02, angle_min=-0.5, angle_max=0.5)
    state = BodyState(WALL, WALL.position, (0.0, 0.0, 0.0))

    def scans(seed):
        laser = Laser(flat, seed)
        return np.array([laser.scan(HERE, (0.0, 0.0, 0.0), [state]) for _ in range(50)])

    exact = 4.5 / np.cos(Laser(flat).angles)
    assert (scans("1") - exact).std() == pytest.approx(0.02, rel=0.05)
    assert np.array_equal(scans("1"), scans("1"))
    assert not np.array_equal(scans("1"), scans("2"))


def test_rate():
    laser = Laser(UTM)
    assert sum(laser.due(0.005 * k) for k in range(200)) == 40


def test_wrong_configuration_is_named(tmp_path):
    with pytest.raises(ConfigError, match="one of ust_10lx, utm_30lx"):
        load_laser("sick")
    text = "\n".join(
        f"{k}: {list(v) if isinstance(v, tuple) else str(v).lower()}"
        for k, v in dataclasses.asdict(dataclasses.replace(UTM, angle_max=-3.0)).items()
    )
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="mine.yaml: angle_max: got -3.0"):
        load_laser(str(path))
