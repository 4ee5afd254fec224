import math

import pytest

from uav_sim.errors import SetpointError
from uav_sim.preset import load_preset
from uav_sim.setpoint import Frame, Horizontal, Vertical, Yaw, decode, limited

PRESET = load_preset("dji_hil")


def limit(axes, suffix="generic"):
    return limited(decode(suffix, axes), PRESET.flight_controller.limits, PRESET.tilt_limit)


# The self-test vectors of uav_sim/doc/dji_sdk.md, section 9.
@pytest.mark.parametrize(
    ("suffix", "axes", "expected"),
    [
        ("generic", [0.1, 0.0, 27.0, 0.0, 43.0], (5.7296, 0.0, 27.0, 0.0)),
        ("generic", [0.0, 0.1, 27.0, 0.0, 43.0], (0.0, -5.7296, 27.0, 0.0)),
        ("generic", [0.0, 0.0, 27.0, 0.5, 43.0], (0.0, 0.0, 27.0, -28.6479)),
        ("ENUvelocity_yawrate", [1.0, 0.0, 0.0, 0.0], (0.0, 1.0, 0.0, 0.0)),
        ("ENUposition_yaw", [0.0, 2.0, 5.0, 0.0], (2.0, 0.0, 5.0, 90.0)),
        ("generic", [1.0, 1.0, 0.0, 0.0, float(0x4B)], (1.0, -1.0, 0.0, 0.0)),
    ],
)
def test_values_that_reach_the_flight_controller(suffix, axes, expected):
    setpoint = decode(suffix, axes)
    assert (setpoint.x, setpoint.y, setpoint.z, setpoint.yaw) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("suffix", "axes", "modes"),
    [
        (
            "generic",
            [0, 0, 0, 0, 0x2B],
            (Horizontal.ANGLE, Vertical.THRUST, Yaw.RATE, Frame.BODY, True),
        ),
        (
            "generic",
            [0, 0, 0, 0, 0x2A],
            (Horizontal.ANGLE, Vertical.THRUST, Yaw.RATE, Frame.BODY, False),
        ),
        (
            "generic",
            [0, 0, 0, 0, 0x82],
            (Horizontal.POSITION, Vertical.VELOCITY, Yaw.ANGLE, Frame.BODY, False),
        ),
        (
            "ENUposition_yaw",
            [0, 0, 0, 0],
            (Horizontal.POSITION, Vertical.POSITION, Yaw.ANGLE, Frame.GROUND, True),
        ),
        (
            "ENUvelocity_yawrate",
            [0, 0, 0, 0],
            (Horizontal.VELOCITY, Vertical.VELOCITY, Yaw.RATE, Frame.GROUND, True),
        ),
        (
            "rollpitch_yawrate_zposition",
            [0, 0, 0, 0],
            (Horizontal.ANGLE, Vertical.POSITION, Yaw.RATE, Frame.BODY, True),
        ),
    ],
)
def test_control_byte(suffix, axes, modes):
    s = decode(suffix, axes)
    assert (s.horizontal, s.vertical, s.yaw_mode, s.frame, s.stable) == modes


@pytest.mark.parametrize(("yaw", "heading"), [(0, 90), (90, 0), (180, -90), (-90, 180)])
def test_yaw_angle_becomes_heading(yaw, heading):
    assert decode("ENUposition_yaw", [0, 0, 0, math.radians(yaw)]).yaw == pytest.approx(heading)


def test_fixed_flag_topics_ignore_a_fifth_axis():
    assert decode("ENUvelocity_yawrate", [1, 2, 3, 0, 43]).horizontal is Horizontal.VELOCITY


@pytest.mark.parametrize(
    ("suffix", "axes", "reason"),
    [
        ("generic", [0.0, 0.0, 38.0, 0.0], "4 axes instead of 5"),
        ("ENUposition_yaw", [], "0 axes instead of 4"),
        ("generic", [0.0, math.nan, 38.0, 0.0, 43.0], "finite"),
        ("generic", [0.0, 0.0, 38.0, 0.0, math.inf], "finite"),
        ("generic", [0.0, 0.0, 38.0, 0.0, 300.0], "0..255"),
        ("generic", [0.0, 0.0, 38.0, 0.0, float(0xC0 | 0x2B)], "angular rates"),
        ("generic", [0.0, 0.0, 38.0, 0.0, float(0x3B)], "vertical mode 0x30"),
        ("generic", [0.0, 0.0, 38.0, 0.0, float(0x2D)], "frame 0x04"),
    ],
)
def test_what_cannot_be_decoded_is_refused_with_a_reason(suffix, axes, reason):
    with pytest.raises(SetpointError, match=reason):
        decode(suffix, axes)


def test_tilt_is_limited_as_a_vector():
    setpoint, words = limit([0.6, -0.6, 40.0, 0.0, 43.0])
    assert math.hypot(setpoint.x, setpoint.y) == pytest.approx(math.degrees(0.605))
    assert setpoint.x == pytest.approx(setpoint.y) and "tilt" in words


@pytest.mark.parametrize(
    ("axes", "field", "value", "word"),
    [
        ([0, 0, 110.0, 0, 0x2B], "z", 100.0, "thrust"),
        ([0, 0, 5.0, 0, 0x2B], "z", 10.0, "thrust"),
        ([0, 0, 40.0, 3.0, 0x2B], "yaw", -math.degrees(1.745), "yaw rate"),
        ([0, 0, 6.0, 0, 0x4B], "z", 4.0, "vertical velocity"),
        ([0, 0, -1.0, 0, 0x9B], "z", 0.0, "height"),
        ([30.0, 0, 0.0, 0, 0x4B], "x", 10.0, "horizontal velocity"),
    ],
)
def test_ranges_are_clamped_and_said(axes, field, value, word):
    setpoint, words = limit(axes)
    assert getattr(setpoint, field) == pytest.approx(value) and word in words


def test_what_is_in_range_passes_unchanged():
    setpoint, words = limit([0.3, 0.3, 38.0, 1.0, 43.0])
    assert (
        setpoint is not None
        and words == ""
        and setpoint == decode("generic", [0.3, 0.3, 38.0, 1.0, 43.0])
    )
