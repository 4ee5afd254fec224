# SPDX-License-Identifier: MIT
"""Random stories around the guard: whatever is heard, asked or planned, some things never happen.

GUARD_EXAMPLES decides how many here, a few by default; ``make fuzz HOURS=5`` goes on for hours of
simulated time (``guard_fuzz.py``).
"""

import dataclasses
import math
import os

import numpy as np
from flight_stub import PARAMS, Aircraft, Flight, make_plan
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from nmpc_control import dji
from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.guard_data import Action
from nmpc_control.mode_inputs import AUTOMATIC, PLANNED, STREAMING, Mode, Request
from nmpc_control.state import Goal

EXAMPLES = int(os.environ.get("GUARD_EXAMPLES", "12"))  # for long runs outside of CI
NEEDS_SWITCH = dataclasses.replace(
    PARAMS, modes=dataclasses.replace(PARAMS.modes, needs_switch=True)
)
TIMEOUTS = PARAMS.modes
AGE = st.sampled_from([0.01, 0.15, 0.22, 0.28, 0.6, 4.0, math.inf])
CHANGES = {
    "rc": st.sampled_from(RcMode),
    "rc_age": AGE,
    "attitude_age": AGE,
    "velocity_age": AGE,
    "position_age": AGE,
    "status_age": AGE,
    "battery_age": AGE,
    "gps_age": AGE,
    "gps_health": st.integers(0, 5),
    "battery": st.sampled_from([math.nan, 0.0, 0.11, 0.19, 0.5, 1.0]),
    "sticks": st.sampled_from([0.0, 0.5, math.nan]),
    "flight_status": st.sampled_from(FlightStatus),
    "authority": st.booleans(),
    "failure": st.sampled_from(["", "refused (ack 0)"]),
}


def nothing(t, x):
    return None, Goal.HOLD


def hold(t, x):
    return make_plan(x, t), Goal.HOLD


def goal(t, x):
    return make_plan(x, t), Goal.TRAJECTORY


def wild(t, x):
    rng = np.random.default_rng(abs(round(t * 50)))
    return make_plan(x, t, rng.normal(size=(60, 4)) * [5.0, 0.5, 0.5, 1.0]), Goal.HOLD


def poisoned(t, x):
    plan = make_plan(x, t)
    inputs = plan.inputs.copy()
    inputs[3, 1] = math.nan
    return dataclasses.replace(plan, inputs=inputs), Goal.HOLD


def old(t, x):
    return make_plan(x, t - 2.0), Goal.HOLD


class Story(RuleBasedStateMachine):
    """Ticks of a guard between which anything may change."""

    ticks = 0  # of all stories so far

    @initialize(in_air=st.booleans())
    def begin(self, in_air):
        aircraft = Aircraft().airborne([0.0, 0.0, 5.0]) if in_air else Aircraft()
        self.flight = Flight(params=NEEDS_SWITCH, aircraft=aircraft)
        self.seen = 0
        self.mode = Mode.WAITING
        self.flight.run(0.2, rc=RcMode.P)
        self.flight.run(0.8)
        self.check()

    @rule(request=st.sampled_from(Request), ticks=st.integers(1, 10))
    def ask(self, request, ticks):
        self.flight.run(ticks * 0.02, request)

    @rule(request=st.just(Request.START))
    def start(self, request):
        self.flight.change = {}
        self.flight.solver = hold
        self.flight.run(0.5, rc=RcMode.P)
        self.flight.run(1.0)
        self.flight.tick(request)
        self.flight.run(1.2)

    @rule(ticks=st.integers(1, 60))
    def wait(self, ticks):
        self.flight.run(ticks * 0.02)

    @rule(
        change=st.sampled_from(sorted(CHANGES)).flatmap(
            lambda name: st.tuples(st.just(name), CHANGES[name])
        ),
        ticks=st.integers(1, 20),
    )
    def change(self, change, ticks):
        self.flight.change = {**self.flight.change, change[0]: change[1]}
        self.flight.run(ticks * 0.02)

    @rule()
    def recover(self):
        self.flight.change = {}
        self.flight.tick()

    @rule(solver=st.sampled_from([nothing, hold, goal, wild, poisoned, old]))
    def solve(self, solver):
        self.flight.solver = solver
        self.flight.run(0.2)

    @rule(early=st.sampled_from([0.0, 0.005, 0.015]))
    def look(self, early):
        self.flight.early = early
        self.flight.run(0.2)

    @rule(step=st.sampled_from([-50.0, -0.3, 0.4, 30.0]))
    def set_clock(self, step):
        self.flight.t += step
        self.flight.tick()

    @rule(off=st.sampled_from([0.5, 3.0, 5000.0]))
    def jump(self, off):
        self.flight.aircraft.x[0] += off
        self.flight.tick()

    @invariant()
    def check(self):
        for _, inputs, output in self.flight.log[self.seen :]:
            self.check_tick(self.mode, inputs.telemetry, output)
            self.mode = output.mode
        Story.ticks += len(self.flight.log) - self.seen
        self.seen = len(self.flight.log)

    def check_tick(self, before, telemetry, output):
        after = output.mode
        pilot = telemetry.rc is not RcMode.F or telemetry.rc_age > TIMEOUTS.rc_timeout
        if pilot:
            assert after not in AUTOMATIC
            assert output.axes is None
        if output.axes is not None:
            assert all(map(math.isfinite, output.axes))
            assert dji.checked(output.axes, PARAMS.setpoint_limits) == output.axes
            assert after in (*STREAMING, Mode.LANDING)
            assert telemetry.authority
        if after in AUTOMATIC and before not in AUTOMATIC:
            assert telemetry.request is Request.START
            assert output.answer[0]
            assert before is not Mode.MANUAL
            assert Action.OBTAIN_AUTHORITY in output.actions
        if before in AUTOMATIC and after not in AUTOMATIC:
            assert Action.RELEASE_AUTHORITY in output.actions
        if after in PLANNED:
            assert telemetry.attitude_age <= TIMEOUTS.attitude_timeout
            assert telemetry.position_age <= TIMEOUTS.position_timeout
            assert telemetry.velocity_age <= TIMEOUTS.velocity_timeout
        if after is not before and after not in (Mode.WAITING, Mode.READY):
            assert output.reason
            assert output.code
        if telemetry.request is not None:
            assert output.answer[1]
        assert not (after is Mode.WAITING and not output.reason)


Story.TestCase.settings = settings(
    max_examples=EXAMPLES, stateful_step_count=25, deadline=None, derandomize=EXAMPLES <= 12
)
TestStory = Story.TestCase
