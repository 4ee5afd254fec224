# SPDX-License-Identifier: MIT
"""What was heard reaches exactly one tick, with its age."""

import math

import numpy as np
import pytest
from flight_stub import PARAMS, make_plan

from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.mode_inputs import Request
from nmpc_control.state import Goal, hover_state


@pytest.fixture
def inbox():
    return GuardInbox(PARAMS)


def test_nothing_heard_is_infinitely_old(inbox):
    telemetry = inbox.inputs(10.0).telemetry
    ages = ("attitude", "velocity", "position", "rc", "status", "gps", "battery")
    assert [getattr(telemetry, f"{name}_age") for name in ages] == [math.inf] * 7
    assert telemetry.rc is RcMode.UNKNOWN
    assert telemetry.flight_status is FlightStatus.UNKNOWN


def test_telemetry_is_read_with_its_age(inbox):
    inbox.add_rc(9.9, [0.0, 0.2, 0.0, 0.0, 8000.0, -4545.0])
    inbox.add_flight_status(9.8, 3)
    inbox.add_gps_health(9.7, 5)
    inbox.add_battery(9.0, 80.0)
    inbox.add_height(1.5)
    inputs = inbox.inputs(10.0)
    telemetry = inputs.telemetry
    assert (telemetry.rc, telemetry.sticks) == (RcMode.F, 0.2)
    assert (telemetry.flight_status, telemetry.gps_health) == (FlightStatus.IN_AIR, 5)
    assert telemetry.battery == pytest.approx(0.8)
    ages = telemetry.rc_age, telemetry.status_age, telemetry.gps_age, telemetry.battery_age
    assert ages == pytest.approx((0.1, 0.2, 0.3, 1.0))
    assert inputs.height == 1.5


def filled(inbox, request):
    """Let a plan and all that one tick takes be heard; return the plan."""
    plan = make_plan(hover_state(np.zeros(3)), 10.0)
    inbox.add_plan(plan, Goal.APPROACH)
    inbox.add_plan_error("too short")
    inbox.request, inbox.failure, inbox.landing_granted = request, "refused", True
    return plan


def test_plan_request_and_failure_reach_one_tick_only(inbox):
    plan = filled(inbox, Request.START)
    first, second = inbox.inputs(10.0), inbox.inputs(10.02)
    assert first.plan is plan
    assert (first.goal, first.plan_error) == (Goal.APPROACH, "too short")
    assert (first.telemetry.request, first.telemetry.failure) == (Request.START, "refused")
    assert (second.plan, second.plan_error) == (None, "")
    assert (second.telemetry.request, second.telemetry.failure) == (None, "")
    assert (first.telemetry.landing_granted, second.telemetry.landing_granted) == (True, False)


def test_a_switch_that_leaves_f_between_two_ticks_is_not_missed(inbox):
    f, p = (0, 0, 0, 0, 8000.0, -10000.0), (0, 0, 0, 0, -8000.0, -10000.0)
    inbox.add_rc(1.00, f)
    assert inbox.inputs(1.00).telemetry.rc is RcMode.F
    inbox.add_rc(1.005, p)
    inbox.add_rc(1.015, f)
    assert inbox.inputs(1.02).telemetry.rc is RcMode.P
    assert inbox.inputs(1.04).telemetry.rc is RcMode.F


def test_that_obstacles_are_not_known_well_enough_stays_until_it_is_taken_back(inbox):
    inbox.obstacles_stale = "/tracker is silent"
    assert [inbox.inputs(t).obstacles_stale for t in (1.0, 1.02)] == ["/tracker is silent"] * 2


def test_a_look_at_the_plan_leaves_everything_else_to_the_tick(inbox):
    plan = filled(inbox, Request.LAND)
    look, tick = inbox.plan_inputs(10.0), inbox.inputs(10.02)
    assert (look.plan, look.goal, look.plan_error) == (plan, Goal.APPROACH, "too short")
    assert (look.telemetry.request, look.telemetry.failure) == (None, "")
    assert (tick.plan, tick.plan_error) == (None, "")
    assert (tick.telemetry.request, tick.telemetry.failure) == (Request.LAND, "refused")
    assert tick.telemetry.landing_granted
