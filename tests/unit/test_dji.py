# SPDX-License-Identifier: MIT
"""What goes out to the flight controller: bytes and signs of uav_sim/doc/dji_sdk.md."""

import dataclasses
import math

import numpy as np
import pytest

from nmpc_control import dji
from nmpc_control.params import load_vehicle
from nmpc_control.state import hover_input

HIL = load_vehicle("dji_hil")
LIMITS = dji.SetpointLimits(
    tilt=0.5236,
    yaw_rate=1.745,
    thrust_min=10.0,
    thrust_max=100.0,
    horizontal_velocity=10.0,
    vertical_velocity=4.0,
)
SWITCH = dji.Switch(p=-8000.0, a=0.0, f=8000.0)


def rc(mode=8000.0, gear=-4545.0, sticks=(0.0, 0.0, 0.0, 0.0)):
    return [*sticks, mode, gear]


def test_control_bytes_are_the_or_of_their_documented_bits():
    angle, rate, body, stable, thrust = 0x00, 0x08, 0x02, 0x01, 0x20
    assert dji.ATTITUDE_THRUST == angle | thrust | rate | body | stable == 43
    assert dji.ATTITUDE_VERTICAL_VELOCITY == angle | rate | body | stable == 11
    assert dji.VELOCITY == 0x40 | rate | stable == 73


def test_hover_input_becomes_the_hover_percentage_of_the_measured_map():
    axes = dji.attitude_thrust_axes(hover_input(), HIL, LIMITS)
    assert axes == pytest.approx((0.0, 0.0, (9.81 - 3.167) / 0.1732, 0.0, 43.0))


def test_signs_pass_unchanged():
    axes = dji.attitude_thrust_axes([9.81, 0.1, -0.2, 0.5], HIL, LIMITS)
    assert (axes[0], axes[1], axes[3]) == (0.1, -0.2, 0.5)


def test_static_gain_of_the_attitude_loop_is_not_divided_out():
    axes = dji.attitude_thrust_axes([9.81, 0.1, 0.1, 0.0], load_vehicle("eth"), LIMITS)
    assert axes[:2] == (0.1, 0.1)


@pytest.mark.parametrize("u", [[1e6, 3.0, -4.0, 50.0], [-1e6, -3.0, 4.0, -50.0]])
def test_extreme_inputs_end_at_the_limits_with_the_direction_kept(u):
    axes = dji.attitude_thrust_axes(u, HIL, LIMITS)
    assert math.hypot(axes[0], axes[1]) == pytest.approx(LIMITS.tilt)
    assert math.atan2(axes[1], axes[0]) == pytest.approx(math.atan2(u[2], u[1]))
    assert axes[2] == (100.0 if u[0] > 0 else 10.0)
    assert axes[3] == math.copysign(LIMITS.yaw_rate, u[3])


def test_narrower_tilt_limit_of_the_vehicle_wins():
    timid = dataclasses.replace(HIL, tilt_limit=0.2)
    axes = dji.attitude_thrust_axes([9.81, 1.0, 0.0, 0.0], timid, LIMITS)
    assert axes[0] == pytest.approx(0.2)


def test_ten_thousand_random_inputs_never_leave_the_limits():
    rng = np.random.default_rng(7)
    for u in rng.standard_cauchy((10_000, 4)) * 3.0:
        for axes in (
            dji.attitude_thrust_axes(u, HIL, LIMITS),
            dji.attitude_velocity_axes(u[:3], u[3], HIL, LIMITS),
            dji.velocity_axes(u[:3], u[3], LIMITS),
        ):
            assert dji.checked(axes, LIMITS) == axes


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_not_finite_never_becomes_a_setpoint(bad):
    for i in range(4):
        values = [9.81, 0.0, 0.0, 0.0]
        values[i] = bad
        with pytest.raises(dji.SetpointError):
            dji.attitude_thrust_axes(values, HIL, LIMITS)
        with pytest.raises(dji.SetpointError):
            dji.velocity_axes(values[:3], values[3], LIMITS)
        with pytest.raises(dji.SetpointError):
            dji.attitude_velocity_axes(values[:3], values[3], HIL, LIMITS)


@pytest.mark.parametrize(
    "axes",
    [
        (0.0, 0.0, 38.0, 0.0),
        (0.0, 0.0, 38.0, math.nan, 43.0),
        (0.6, 0.0, 38.0, 0.0, 43.0),
        (0.4, 0.4, 38.0, 0.0, 43.0),
        (0.0, 0.0, 9.0, 0.0, 43.0),
        (0.0, 0.0, 101.0, 0.0, 43.0),
        (0.0, 0.0, 38.0, 2.0, 43.0),
        (0.0, 0.0, 38.0, 0.0, 11.0),
        (8.0, 8.0, 0.0, 0.0, 73.0),
        (0.0, 0.0, 38.0, 0.0, 0xC0),
    ],
)
def test_the_last_look_refuses_anything_outside_the_limits(axes):
    with pytest.raises(dji.SetpointError):
        dji.checked(axes, LIMITS)


def test_applied_input_is_what_was_sent_after_clamping():
    axes = dji.attitude_thrust_axes([9.81, 0.1, 0.2, 0.3], HIL, LIMITS)
    assert dji.input_from_axes(axes, HIL) == pytest.approx((9.81, 0.1, 0.2, 0.3))
    axes = dji.attitude_thrust_axes([100.0, 0.0, 0.0, 0.0], HIL, LIMITS)
    assert dji.input_from_axes(axes, HIL)[0] == pytest.approx(0.1732 * 100.0 + 3.167)


def test_velocity_axes_are_east_north_up():
    assert dji.velocity_axes([1.0, 2.0, 0.5], 0.1, LIMITS) == (1.0, 2.0, 0.5, 0.1, 73.0)


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        (rc(8000.0), dji.RcMode.F),
        (rc(0.0), dji.RcMode.A),
        (rc(-8000.0), dji.RcMode.P),
        (rc(4000.0), dji.RcMode.UNKNOWN),
        (rc(8000.0, gear=0.0), dji.RcMode.OFF),
        (rc(8000.0)[:5], dji.RcMode.UNKNOWN),
        (rc(math.nan), dji.RcMode.UNKNOWN),
        ([], dji.RcMode.UNKNOWN),
    ],
)
def test_mode_switch(axes, expected):
    assert dji.rc_mode(axes, SWITCH) is expected


def test_switch_values_are_parameters():
    other_product = dji.Switch(p=10000.0, a=0.0, f=-10000.0)
    assert dji.rc_mode(rc(-10000.0), other_product) is dji.RcMode.F


def test_stick_deflection_is_the_largest_and_unreadable_sticks_are_not_centred():
    assert dji.stick_deflection(rc(sticks=(0.1, -0.3, 0.0, 0.2))) == 0.3
    assert dji.stick_deflection(rc(sticks=(math.nan, 0.0, 0.0, 0.0))) == math.inf
    assert dji.stick_deflection([]) == math.inf


def test_flight_status_of_unknown_values():
    assert dji.flight_status(3) is dji.FlightStatus.IN_AIR
    assert dji.flight_status(9) is dji.FlightStatus.UNKNOWN
