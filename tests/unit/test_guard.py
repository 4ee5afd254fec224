# SPDX-License-Identifier: MIT
"""The guard against a numeric aircraft and a solver that misbehaves."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import GOOD, LIMITS, PARAMS, TICK, VEHICLE, Aircraft, Flight, make_plan

from nmpc_control import dji
from nmpc_control.braking import MADE_UP
from nmpc_control.dji import FlightStatus, RcMode
from nmpc_control.estimator import StateEstimate
from nmpc_control.guard_data import Action, GuardInputs
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode, Request
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import load_vehicle
from nmpc_control.state import GRAVITY, Goal, hover_input

INDOORS = {"gps_health": 0, "needs_gps": False}
LENIENT = dataclasses.replace(
    PARAMS,
    plan_check=dataclasses.replace(
        PARAMS.plan_check,
        timeout=1e3,
        input_tolerance=1e3,
        velocity_residual=1e3,
        position_residual=1e3,
        attitude_residual=1e3,
        minimum_clearance=0.0,
        growth_tolerance=1e3,
        clearance_horizon=1e-6,
    ),
)


def cruise(t, x):
    """A plan towards a goal: keep flying as now."""
    return make_plan(x, t), Goal.TRAJECTORY


def airborne(position=(0.0, 0.0, 5.0), velocity=(0.0, 0.0, 0.0), yaw=0.0, **kwargs):
    return Aircraft(**kwargs).airborne(position, velocity, yaw)


def flight_without_gps(aircraft=None, solver=None):
    flight = Flight(params=PARAMS, aircraft=aircraft or airborne(), solver=solver)
    flight.change = dict(INDOORS)
    return flight


def gaps(flight):
    """Return the longest time between two setpoints since the first."""
    times = [t for t, _, output in flight.log if output.axes is not None]
    return max(np.diff(times))


def everything_sent(flight):
    return [output.axes for _, _, output in flight.log if output.axes is not None]


# a whole flight


def test_from_the_ground_to_hover_and_back():
    flight = Flight()
    output = flight.run(1.0)
    assert (output.mode, output.axes) == (Mode.READY, None)
    output = flight.tick(Request.START)
    assert output.answer == (True, "taking off")
    assert output.actions == (Action.OBTAIN_AUTHORITY, Action.TAKE_OFF)
    assert (output.mode, output.axes) == (Mode.TAKING_OFF, None)
    output = flight.run(1.0)
    assert output.mode is Mode.HOVERING
    assert output.rung in (Rung.NEW_PLAN, Rung.LAST_PLAN)
    assert output.axes[4] == dji.ATTITUDE_THRUST
    output = flight.tick(Request.LAND)
    assert output.answer == (True, "landing")
    assert output.actions == (Action.HOLD, Action.LAND)
    assert output.mode is Mode.LANDING
    assert output.axes[4] == dji.VELOCITY, "held until DJI's own landing has begun"
    output = flight.tick()
    assert output.axes is None
    assert output.actions == (Action.RELEASE_AUTHORITY,)
    assert output.mode is Mode.WAITING
    assert flight.run(0.5).mode is Mode.READY


def test_waiting_says_what_is_missing():
    flight = Flight()
    flight.solver = None
    output = flight.run(0.2, rc=RcMode.P)
    assert output.mode is Mode.WAITING
    assert output.reason == (
        "the RC switch is not in F but P; 0 of 10 plans verified in a row (no plan has come)"
    )


def test_rungs_alternate_between_new_and_last_plan_at_a_steady_rate():
    flight = Flight().hovering()
    rungs = [flight.tick().rung for _ in range(30)]
    assert rungs.count(Rung.NEW_PLAN) == 10
    assert rungs.count(Rung.LAST_PLAN) == 20
    assert gaps(flight) == pytest.approx(TICK)


def looked_at(flight, obstacles=(), late=0.0):
    """Return the tick after a look at a plan; ``obstacles`` come to be known between the two."""
    x, solver, flight.solver = flight.aircraft.x.copy(), flight.solver, None
    plan, goal = solver(flight.t + 0.01, x)
    estimate = StateEstimate(flight.t + 0.01, x, 0.0, 0.0, 0.0)
    flight.guard.look_at_plan(
        GuardInputs(flight.t + 0.01, GOOD, estimate, plan=plan, goal=goal, obstacles=())
    )
    flight.obstacles, flight.t = obstacles, flight.t + late
    return flight.tick()


def test_a_plan_looked_at_before_the_tick_is_flown_by_it():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = cruise
    output = looked_at(flight)
    assert (output.rung, output.mode) == (Rung.NEW_PLAN, Mode.FLYING)
    assert flight.tick().rung is Rung.LAST_PLAN


def test_a_plan_looked_at_is_not_flown_when_its_tick_comes_late():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver, stall = cruise, PARAMS.plan_check.timeout + 0.1
    output = looked_at(flight, late=stall)
    assert output.mode is Mode.BRAKING
    assert "s old" in output.reason


def test_a_plan_looked_at_is_checked_again_for_what_came_to_be_known_since():
    flight = Flight(aircraft=airborne()).hovering()
    ahead = [GRAVITY, 0.0, 0.1, 0.0]  # pitched: 1 m/s^2 forward
    flight.solver = lambda t, x: (make_plan(x, t, ahead), Goal.TRAJECTORY)
    ball = Obstacle("ball", flight.aircraft.x[:3] + [2.5, 0.0, 0.0], [0.2])
    output = looked_at(flight, (ball,))
    assert "the plan hits obstacle ball" in output.reason
    assert flight.run(PARAMS.plan_check.grace + 0.1).mode is Mode.BRAKING


def test_mode_follows_the_goal_of_the_plan():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = cruise
    assert flight.run(0.1).mode is Mode.FLYING
    flight.solver = lambda t, x: (make_plan(x, t), Goal.HOLD)
    assert flight.run(0.1).mode is Mode.HOVERING


def test_the_plan_is_sampled_by_time():
    flight = Flight(aircraft=airborne()).hovering()
    inputs = np.tile(hover_input(), (60, 1))
    inputs[:, 3] = 0.01 * np.arange(60)  # the yaw rate tells the stage
    flight.solver = lambda t, x: (make_plan(x, t, inputs), Goal.HOLD)
    while flight.tick().rung is not Rung.NEW_PLAN:
        pass
    flight.solver = None
    sent = [flight.tick().axes[3] for _ in range(20)]
    expected = [0.01 * int((k + 1) * TICK / 0.1 + 1e-9) for k in range(20)]
    assert sent == pytest.approx(expected)


# solver faults


def nan_with_success(t, x):
    plan = make_plan(x, t)
    states = plan.states.copy()
    states[30, 4] = math.nan
    return dataclasses.replace(plan, states=states), Goal.HOLD


def out_of_bounds(t, x):
    return make_plan(x, t, [9.81, 0.5, 0.0, 0.0]), Goal.HOLD


def wrong_dynamics(t, x):
    plan = make_plan(x, t)
    states = plan.states.copy()
    states[:, 0] += np.linspace(0.0, 10.0, 61)  # flies east without leaning
    return dataclasses.replace(plan, states=states), Goal.HOLD


def old(t, x):
    return make_plan(x, t - 0.7), Goal.HOLD


def not_found(t, x):
    return dataclasses.replace(make_plan(x, t), found=False, status="failed"), Goal.HOLD


def from_elsewhere(t, x):
    return make_plan(x + np.eye(10)[0] * 3.0, t), Goal.HOLD


@pytest.mark.parametrize(
    ("solver", "word"),
    [
        (nan_with_success, "not finite"),
        (out_of_bounds, "out of range"),
        (wrong_dynamics, "departs from the model"),
        (old, "0.7"),
        (not_found, "found no plan: failed"),
        (from_elsewhere, "3.00 m away"),
        (None, "the plan is 0.5"),
    ],
)
def test_bad_plans_are_never_flown(solver, word):
    flight = Flight(aircraft=airborne()).hovering()
    begun = flight.t
    flight.solver = solver
    output = flight.run(2.0)
    assert output.mode is Mode.BRAKING
    assert output.rung is Rung.BRAKE
    assert word in output.reason
    assert gaps(flight) == pytest.approx(TICK)
    left = next(t for t, _, o in flight.log if t > begun and o.mode is Mode.BRAKING)
    assert 0.4 < left - begun <= 0.58  # the last verified plan is flown for as long as it holds
    flight.solver = lambda t, x: (make_plan(x, t), Goal.HOLD)
    assert flight.run(0.9).mode is Mode.BRAKING
    assert flight.run(0.2).mode is Mode.HOVERING


@pytest.mark.parametrize("solver", [out_of_bounds, wrong_dynamics, old])
def test_twin_without_the_check_flies_the_bad_plan(solver):
    flight = Flight(params=LENIENT, aircraft=airborne()).hovering()
    flight.solver = solver
    output = flight.run(1.0)
    assert output.mode is Mode.HOVERING
    assert flight.guard.ladder.rejected == 0


@pytest.mark.parametrize("failures", [1, 5])
def test_a_few_failures_are_bridged_by_the_last_plan(failures):
    flight = Flight(aircraft=airborne()).hovering()
    good, flight.solver = flight.solver, nan_with_success
    flight.run(failures * 3 * TICK)
    flight.solver = good
    flight.run(0.2)
    assert Mode.BRAKING not in {output.mode for t, _, output in flight.log if t > 103.0}
    assert flight.guard.ladder.rejected == failures


def flight_towards_a_sphere(params):
    """Cruise at 2 m/s at a sphere that the solver does not know."""
    flight = Flight(params=params, aircraft=airborne()).hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [2.0, 0.0, 0.0])
    flight.solver = cruise
    sphere = Obstacle("ball", np.array([8.0, 0.1, 5.0]), np.array([0.5]))
    flight.obstacles = (sphere,)
    flight.change = INDOORS
    flight.run(6.0)
    path = np.array([inputs.estimate.vector[:3] for _, inputs, _ in flight.log])
    return flight, float(sphere.distance(path).min()) - VEHICLE.radius


def test_plans_through_a_sphere_end_in_a_brake_in_front_of_it():
    flight, clearance = flight_towards_a_sphere(PARAMS)
    reasons = [o.reason for _, _, o in flight.log if o.mode is Mode.BRAKING]
    assert "obstacle ball" in reasons[-1]
    assert clearance > 0.5
    assert flight.speed < 0.2


def test_twin_without_the_check_hits_the_sphere():
    flight, clearance = flight_towards_a_sphere(LENIENT)
    assert clearance < 0.0


def test_an_obstacle_that_pops_up_stops_the_last_plan_at_once():
    flight = Flight(aircraft=airborne()).hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [1.0, 0.0, 0.0])
    flight.solver = cruise
    assert flight.run(0.3).mode is Mode.FLYING
    flight.solver = None
    x = flight.aircraft.x[0]
    flight.obstacles = (Obstacle("popup", np.array([x + 2.4, 0.0, 5.0]), np.array([0.5])),)
    output = flight.tick()
    assert output.mode is Mode.BRAKING
    assert "popup" in output.reason


def test_nothing_that_is_sent_is_ever_outside_the_limits():
    rng = np.random.default_rng(3)

    def wild(t, x):
        return make_plan(x, t, rng.normal(size=(60, 4)) * [5.0, 0.4, 0.4, 1.0]), Goal.HOLD

    flight = Flight(params=LENIENT, aircraft=airborne()).hovering()
    flight.solver = wild
    for k in range(300):
        flight.change = {"gps_health": 0} if k % 7 == 0 else {}
        flight.tick()
    for axes in everything_sent(flight):
        assert dji.checked(axes, PARAMS.setpoint_limits) == axes


# the pilot


def test_leaving_f_silences_the_stream_in_the_same_tick_and_return_brakes():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = cruise
    flight.run(0.5)
    output = flight.tick(rc=RcMode.P)
    assert (output.mode, output.axes) == (Mode.MANUAL, None)
    assert output.actions == (Action.RELEASE_AUTHORITY,)
    output = flight.run(2.0, rc=RcMode.P)
    assert (output.mode, output.axes) == (Mode.MANUAL, None)
    output = flight.run(2.0)
    assert (output.mode, output.axes) == (Mode.READY, None)  # back in F alone does nothing
    output = flight.tick(Request.START)
    assert output.answer == (True, "braking to hover")
    assert output.mode is Mode.BRAKING
    flight.solver = lambda t, x: (make_plan(x, t), Goal.HOLD)
    assert flight.run(1.2).mode is Mode.HOVERING


def test_start_is_refused_while_the_pilot_flies():
    flight = Flight(aircraft=airborne())
    flight.change = {"rc": RcMode.P}
    flight.run(1.0)
    output = flight.tick(Request.START)
    assert output.mode is Mode.MANUAL
    assert output.answer == (False, "the pilot has control: RC P")


def test_a_silent_rc_counts_as_the_pilot():
    flight = Flight(aircraft=airborne()).hovering()
    assert flight.tick(rc_age=0.29).mode is Mode.HOVERING
    assert flight.tick(rc_age=0.31).mode is Mode.MANUAL


# authority


def test_nothing_is_streamed_before_authority_is_given():
    flight = Flight(aircraft=airborne())
    flight.run(1.0)
    flight.aircraft.serve = lambda actions: None
    flight.tick(Request.START)
    output = flight.run(5.0)
    assert (output.mode, output.axes) == (Mode.BRAKING, None)
    output = flight.run(8.0)
    assert output.mode is Mode.RELEASED
    assert "not given within" in output.reason


def test_the_first_setpoint_fits_the_attitude_at_which_authority_comes():
    """A pilot who rolls while the call is under way has levelled out when it is answered."""
    flight = Flight(aircraft=airborne())
    flight.run(1.0, **INDOORS)
    serve, flight.aircraft.serve = flight.aircraft.serve, lambda actions: None
    flight.aircraft.x[3] = 0.35
    flight.tick(Request.START, **INDOORS)
    flight.solver = None  # or it would fly at once
    for _ in range(50):
        flight.aircraft.x[3:9] = 0.0
        assert flight.tick(**INDOORS).axes is None
    flight.aircraft.serve, flight.aircraft.authority = serve, True
    assert abs(flight.tick(**INDOORS).applied[1]) < 0.05


def test_a_refused_call_is_told():
    flight = Flight(aircraft=airborne())
    flight.run(1.0)
    flight.tick(Request.START)
    output = flight.tick(failure="obtain authority was refused (ack 6): F is needed")
    assert output.mode is Mode.RELEASED
    assert "ack 6" in output.reason


def test_release_gives_authority_back_and_is_silent():
    flight = Flight(aircraft=airborne()).hovering()
    output = flight.tick(Request.RELEASE)
    assert (output.mode, output.rung, output.axes) == (Mode.RELEASED, Rung.RELEASE, None)
    assert output.actions == (Action.RELEASE_AUTHORITY,)
    assert flight.run(2.0).mode is Mode.RELEASED


# hover


def test_hover_tells_the_controller_and_waits_for_it():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = cruise
    flight.run(0.5)
    output = flight.tick(Request.HOVER)
    assert output.answer == (True, "hovering")
    assert output.actions == (Action.HOLD,)
    flight.run(0.2)
    flight.solver = lambda t, x: (make_plan(x, t), Goal.HOLD)
    assert flight.run(1.0).mode is Mode.HOVERING
    flight.solver = cruise  # a new goal, later
    assert flight.run(1.0).mode is Mode.FLYING


def test_a_controller_that_does_not_hold_is_braked():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = cruise
    flight.run(0.5)
    flight.tick(Request.HOVER)
    assert flight.run(0.4).mode is Mode.FLYING
    output = flight.run(3.0)
    assert output.mode is Mode.BRAKING
    assert "did not hold" in output.reason
    flight.solver = lambda t, x: (make_plan(x, t), Goal.HOLD)
    assert flight.run(1.2).mode is Mode.HOVERING


# the lower rungs


def test_with_gps_the_brake_is_djis_own_hold():
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = None
    output = flight.run(1.0)
    assert output.axes == (0.0, 0.0, 0.0, 0.0, float(dji.VELOCITY))
    assert output.applied is None


@pytest.mark.parametrize("yaw", [0.0, 2.5])
@pytest.mark.parametrize("plant", ["dji_hil", "eth"])
def test_without_gps_the_brake_stops_and_holds_by_attitude(plant, yaw):
    aircraft = airborne(yaw=yaw, vehicle=load_vehicle(plant))
    flight = flight_without_gps(aircraft).hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [2.0, -1.0, 0.5], yaw)
    flight.solver = None
    output = flight.run(5.0)
    assert (output.mode, output.rung) == (Mode.BRAKING, Rung.BRAKE)
    assert output.axes[4] == dji.ATTITUDE_THRUST
    assert flight.speed < 0.1
    stopped = flight.aircraft.x[:3].copy()
    assert np.linalg.norm(stopped[:2]) < 4.0
    flight.run(10.0)
    assert np.linalg.norm(flight.aircraft.x[:2] - stopped[:2]) < 0.1
    assert abs(flight.aircraft.x[2] - 5.0) < 0.35


@pytest.mark.parametrize("thrust_error", [-1.4, 1.4])
def test_the_brake_learns_the_thrust_that_the_map_does_not_know(thrust_error):
    flight = flight_without_gps(airborne(thrust_error=thrust_error))
    flight.run(1.0)
    flight.aircraft.airborne([0.0, 0.0, 5.0])
    flight.tick(Request.START)
    flight.solver = None
    flight.run(10.0)
    assert abs(flight.aircraft.x[8]) < 0.1
    assert abs(flight.aircraft.x[2] - 5.0) < 1.0


def test_the_brake_is_bounded_and_changes_slowly():
    flight = flight_without_gps().hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [6.0, 6.0, 0.0])
    flight.solver = None
    flight.run(3.0)
    applied = np.array(
        [o.applied for _, _, o in flight.log if o.mode is Mode.BRAKING and o.applied]
    )
    largest = math.atan((PARAMS.brake.deceleration + MADE_UP) / 9.81)
    assert np.hypot(applied[:, 1], applied[:, 2]).max() <= largest * 1.02
    change = np.abs(np.diff(applied[:, 1:3], axis=0)).max()
    assert change <= PARAMS.brake.tilt_rate * TICK + 1e-9
    assert (applied >= LIMITS.input_min).all()
    assert (applied <= LIMITS.input_max).all()


def test_losing_gps_while_it_holds_goes_on_with_the_brake_from_level():
    tilted = [9.81, 0.0, 0.3, 0.0]
    flight = Flight(aircraft=airborne()).hovering()
    flight.solver = lambda t, x: (make_plan(x, t, tilted), Goal.HOLD)
    flight.run(0.5)
    flight.solver = None
    assert flight.run(2.0).axes[4] == dji.VELOCITY
    output = flight.tick(gps_health=2)
    assert output.axes[4] == dji.ATTITUDE_THRUST
    assert abs(output.axes[1]) <= PARAMS.brake.tilt_rate * TICK + 1e-9


def test_position_lost_brakes_on_velocity_then_releases():
    flight = flight_without_gps().hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [2.0, 0.0, 0.0])
    begun = flight.t
    output = flight.run(3.0, position_age=0.3)
    assert (output.mode, output.rung) == (Mode.BRAKING, Rung.BRAKE_BLIND)
    assert flight.speed < 0.2
    output = flight.tick(position_age=5.1)
    assert output.mode is Mode.RELEASED
    assert output.actions == (Action.RELEASE_AUTHORITY,)
    first = next(t for t, _, o in flight.log if t > begun and o.mode is Mode.BRAKING)
    assert first - begun <= TICK + 1e-9


def test_position_back_after_a_drop_out_flies_on():
    flight = flight_without_gps().hovering()
    flight.run(0.5, position_age=0.3)
    assert flight.run(1.2).mode is Mode.HOVERING


def test_position_and_velocity_lost_brakes_as_long_as_the_speed_needs():
    flight = flight_without_gps(solver=lambda t, x: (make_plan(x, t), Goal.HOLD)).hovering()
    flight.aircraft.airborne([0.0, 0.0, 5.0], [3.0, 0.0, 0.0])
    flight.tick()
    begun, released = flight.t, None
    for k in range(150):
        age = (k + 1) * TICK
        output = flight.tick(position_age=age, velocity_age=age)
        if output.mode is Mode.RELEASED:
            released = flight.t - begun
            break
    needed = 3.0 / PARAMS.brake.deceleration + VEHICLE.delay + PARAMS.modes.velocity_timeout
    assert released == pytest.approx(needed, abs=2.5 * TICK)
    assert flight.speed < 1.2


def test_dead_attitude_releases_at_once():
    flight = Flight(aircraft=airborne()).hovering()
    output = flight.tick(attitude_age=0.21)
    assert (output.mode, output.axes) == (Mode.RELEASED, None)
    assert output.actions == (Action.RELEASE_AUTHORITY,)


# local position reference


def test_the_reference_is_asked_for_once_on_the_ground():
    flight = Flight()
    flight.change = {"position_age": math.inf}
    flight.run(4.9)
    asked = [o for _, _, o in flight.log if Action.SET_REFERENCE in o.actions]
    assert len(asked) == 1
    flight.change = {}
    flight.run(20.0)
    asked = [o for _, _, o in flight.log if Action.SET_REFERENCE in o.actions]
    assert len(asked) == 1


@pytest.mark.parametrize(
    "change",
    [{"gps_health": 3}, {"flight_status": FlightStatus.IN_AIR}, {"position_age": 0.1}],
)
def test_no_reference_without_gps_in_the_air_or_where_there_is_one(change):
    flight = Flight()
    flight.change = {"position_age": math.inf, **change}
    flight.run(12.0)
    assert not any(Action.SET_REFERENCE in o.actions for _, _, o in flight.log)


# time and failures of its own


def test_a_clock_that_jumps_back_does_not_stop_the_stream():
    flight = Flight(aircraft=airborne()).hovering()
    flight.t -= 50.0
    modes = [flight.tick().mode for _ in range(100)]
    assert set(modes) <= {Mode.HOVERING, Mode.BRAKING}
    assert modes[-1] is Mode.HOVERING
    assert all(o.axes is not None for _, _, o in flight.log[-100:])


def test_an_exception_in_the_tick_brakes_and_then_gives_way():
    flight = Flight(aircraft=airborne()).hovering()
    telemetry = flight.log[-1][1].telemetry
    for _ in range(10):
        output = flight.guard.give_way(flight.t, telemetry, ValueError("boom"))
        assert output.mode is Mode.BRAKING
        assert output.axes[4] == dji.VELOCITY
        assert "boom" in output.reason
    output = flight.guard.give_way(flight.t, telemetry, ValueError("boom"))
    assert (output.mode, output.axes) == (Mode.FAULT, None)
    assert output.actions == (Action.RELEASE_AUTHORITY,)


def test_an_exception_does_not_outrank_the_pilot():
    flight = Flight(aircraft=airborne()).hovering()
    telemetry = dataclasses.replace(flight.log[-1][1].telemetry, rc=RcMode.P)
    assert flight.guard.give_way(flight.t, telemetry, ValueError()).axes is None


def test_a_single_exception_on_the_ground_changes_nothing():
    flight = Flight()
    flight.run(1.0)
    output = flight.guard.give_way(flight.t, flight.log[-1][1].telemetry, ValueError("boom"))
    assert (output.mode, output.axes, output.actions) == (Mode.READY, None, ())
    assert flight.tick().mode is Mode.READY


def test_first_flights_command_vertical_velocity_instead_of_thrust():
    params = dataclasses.replace(PARAMS, vertical_command="velocity")
    flight = Flight(params=params, aircraft=airborne())
    flight.change = dict(INDOORS)
    flight.run(1.0)
    flight.tick(Request.START)
    flight.solver = lambda t, x: (make_plan([*x[:8], 0.5, 0.0], t), Goal.HOLD)
    output = flight.run(1.5)
    assert output.mode is Mode.HOVERING
    assert output.axes[4] == dji.ATTITUDE_VERTICAL_VELOCITY
    assert output.axes[2] == pytest.approx(0.5, abs=0.1)
    assert output.applied[0] == pytest.approx(9.81)
    flight.solver = None
    output = flight.run(1.0)
    assert (output.mode, output.axes[2]) == (Mode.BRAKING, 0.0)
