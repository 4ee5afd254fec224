# SPDX-License-Identifier: MIT
"""Every way in which a plan can be wrong is found; the same plan passes with that check off."""

import dataclasses
import math

import numpy as np
import pytest
from flight_stub import LIMITS, PARAMS, VEHICLE, make_plan
from hypothesis import given, settings
from hypothesis import strategies as st

from nmpc_control import plan_consistency, prediction
from nmpc_control.model import model_parameters, step_function
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import load_vehicle
from nmpc_control.plan_check import Finding, check_flown, check_plan
from nmpc_control.plan_consistency import euler_step, rk4_step
from nmpc_control.state import GRAVITY, Plan, hover_input, hover_state

START = hover_state(np.array([1.0, 2.0, 3.0]))
CHECK = PARAMS.plan_check
EVERYTHING = dataclasses.replace(
    CHECK,
    timeout=1e3,
    lead=1e3,
    input_tolerance=1e3,
    position_residual=1e3,
    attitude_residual=1e3,
    velocity_residual=1e3,
    yaw_rate_residual=1e3,
    position_jump=1e3,
    velocity_jump=1e3,
    attitude_jump=1e3,
)


def check(plan, t=10.0, state=START, inputs=(), obstacles=(), params=CHECK):
    return check_plan(
        plan,
        t=t,
        state=state,
        inputs=inputs,
        vehicle=VEHICLE,
        limits=LIMITS,
        obstacles=obstacles,
        params=params,
    )


def sphere(position, radius=0.5, **kwargs):
    return Obstacle("ball", np.array(position, dtype=float), np.array([radius]), **kwargs)


def altered(plan, **changes):
    """Return the plan with entries of its arrays changed: ``states={(k, i): value}``."""
    arrays = {}
    for name, entries in changes.items():
        arrays[name] = getattr(plan, name).copy()
        for at, value in entries.items():
            arrays[name][at] = value
    return dataclasses.replace(plan, **arrays)


def flying_east(speed=1.0, t=10.0):
    state = START.copy()
    state[6] = speed
    pitch = math.atan(VEHICLE.drag[0] * speed / GRAVITY)  # cancels the drag: constant speed
    state[4] = pitch
    return state, make_plan(state, t, [GRAVITY / math.cos(pitch), 0.0, pitch, 0.0])


@pytest.fixture
def hover():
    return make_plan(START, 10.0)


def test_a_plan_of_the_model_is_verified(hover):
    verdict = check(hover)
    assert verdict.ok
    assert verdict.clearance == math.inf


@pytest.mark.parametrize(
    ("name", "value"), [("states", math.nan), ("inputs", math.inf), ("states", 1e9)]
)
def test_numbers_that_are_not_finite(hover, name, value):
    plan = altered(hover, **{name: {(59, 2): value}})
    assert check(plan, params=EVERYTHING).finding is Finding.NOT_FINITE


@pytest.mark.parametrize("name", ["t", "dt", "delay"])
def test_times_that_are_not_finite(hover, name):
    plan = dataclasses.replace(hover, **{name: math.nan})
    assert check(plan, params=EVERYTHING).finding is Finding.NOT_FINITE


def test_shapes(hover):
    for plan in (
        dataclasses.replace(hover, states=hover.states[:-1]),
        dataclasses.replace(hover, states=hover.states[:, :9]),
        dataclasses.replace(hover, inputs=hover.inputs[:, :3]),
        dataclasses.replace(hover, inputs=hover.inputs[:0], states=hover.states[:1]),
        dataclasses.replace(hover, inputs=hover.inputs.ravel()),
        dataclasses.replace(hover, dt=0.0),
        dataclasses.replace(hover, delay=-0.1),
    ):
        assert check(plan, params=EVERYTHING).finding is Finding.SHAPE


def test_a_plan_that_the_solver_itself_disowns(hover):
    plan = dataclasses.replace(hover, found=False, status="failed")
    verdict = check(plan)
    assert verdict.finding is Finding.NOT_FOUND
    assert "failed" in verdict.sentence


def test_age(hover):
    assert check(hover, t=10.49).ok
    verdict = check(hover, t=10.51)
    assert verdict.finding is Finding.TOO_OLD
    assert "0.51 s" in verdict.sentence
    assert check(hover, t=9.85).finding is Finding.TOO_EARLY
    assert check(hover, t=9.85, params=EVERYTHING).ok
    assert check(hover, t=10.51, params=EVERYTHING).ok
    assert check(hover, t=17.0, params=EVERYTHING).finding is Finding.TOO_OLD  # it has ended


@pytest.mark.parametrize("i", range(4))
def test_input_bounds(i):
    bad = hover_input()
    bad[i] = LIMITS.input_max[i] * 1.05
    state = START
    inputs = np.tile(hover_input(), (60, 1))
    inputs[20] = bad
    plan = make_plan(state, 10.0, inputs)
    verdict = check(plan)
    assert verdict.finding is Finding.INPUT_BOUNDS
    assert "stage 20" in verdict.sentence
    assert check(plan, params=dataclasses.replace(CHECK, input_tolerance=0.1)).ok


@pytest.mark.parametrize(
    ("i", "size", "name"),
    [(0, 0.06, "position"), (4, 0.06, "attitude"), (8, 0.4, "velocity"), (9, 0.15, "yaw rate")],
)
def test_dynamics(hover, i, size, name):
    plan = altered(hover, states={(60, i): hover.states[60, i] + size})
    verdict = check(plan)
    assert verdict.finding is Finding.DYNAMICS
    assert name in verdict.sentence
    assert check(plan, params=EVERYTHING).ok


def test_a_plan_made_with_another_vehicle_is_refused():
    inputs = np.tile(hover_input(), (60, 1))
    inputs[:10, 2] = 0.3
    plan = dataclasses.replace(
        make_plan(START, 10.0, inputs, vehicle=load_vehicle("eth")), delay=VEHICLE.delay
    )
    assert check(plan).finding is Finding.DYNAMICS
    assert check(make_plan(START, 10.0, inputs)).ok


@pytest.mark.parametrize(("i", "size"), [(0, 1.1), (2, -1.1), (7, 1.6), (3, 0.4)])
def test_jump(hover, i, size):
    elsewhere = START.copy()
    elsewhere[i] += size
    # attitude decays over the dead time, so it is looked at when the plan takes effect at once
    t = 10.0 if i != 3 else 10.0 + VEHICLE.delay
    assert check(hover, t=t, state=elsewhere).finding is Finding.JUMP
    assert check(hover, t=t, state=elsewhere, params=EVERYTHING).ok


def test_the_jump_is_judged_where_the_inputs_already_sent_lead():
    sent = np.array([GRAVITY, 0.0, 0.43, 0.0])
    x = START.copy()
    x[6] = 2.0
    x[4] = 0.43
    expected = make_plan(x, 10.0, sent, dt=VEHICLE.delay, horizon=1).states[1]
    plan = make_plan(expected, 10.0)
    strict = dataclasses.replace(CHECK, position_jump=1e-3, velocity_jump=1e-3, attitude_jump=1e-3)
    history = [(9.0 + 0.02 * k, sent) for k in range(50)]
    assert check(plan, state=x, inputs=history, params=strict).ok
    assert check(plan, state=x, params=strict).finding is Finding.JUMP


def test_yaw_may_differ_by_whole_turns(hover):
    turned = START.copy()
    turned[5] += 2.0 * math.pi
    assert check(hover, state=turned).ok


def test_clearance_is_from_hull_to_surface():
    state, plan = flying_east()
    verdict = check(plan, state=state, obstacles=[sphere([3.0, 4.0, 3.0])])
    assert verdict.ok
    assert verdict.clearance == pytest.approx(2.0 - 0.5 - VEHICLE.radius, abs=1e-3)


def test_a_plan_through_a_sphere():
    state, plan = flying_east()
    verdict = check(plan, state=state, obstacles=[sphere([3.0, 2.9, 3.0])])
    assert verdict.finding is Finding.COLLISION
    assert "ball" in verdict.sentence
    assert "0.10 m" in verdict.sentence
    assert check(plan, state=state).ok  # the same plan without the sphere


def test_a_plan_past_a_sphere_inside_the_minimum():
    state, plan = flying_east()
    near = [sphere([3.0, 3.1, 3.0])]
    assert check(plan, state=state, obstacles=near).finding is Finding.CLEARANCE
    lenient = dataclasses.replace(CHECK, minimum_clearance=0.05)
    assert check(plan, state=state, obstacles=near, params=lenient).ok


def test_what_lies_between_two_stages_is_seen():
    state = START.copy()
    state[6] = 9.0  # 0.9 m from stage to stage
    plan = make_plan(state, 10.0)
    pin = Obstacle("pin", np.array([1.45, 2.0 + VEHICLE.radius, 3.0]), np.array([0.02]))
    at_stages = np.linalg.norm(plan.states[:, :3] - pin.position, axis=1) - 0.02
    assert at_stages.min() > VEHICLE.radius + 0.1  # clear by the stages alone
    in_effect = 10.0 + VEHICLE.delay
    verdict = check(plan, t=in_effect, state=state, obstacles=[pin])
    assert verdict.finding is Finding.COLLISION


def test_a_moving_obstacle_is_met_where_it_will_be():
    state, plan = flying_east()
    # it crosses the path just when the aircraft is there, 2 s after the plan takes effect
    crossing = sphere([3.0, 2.0 - 2.14, 3.0], velocity=np.array([0.0, 1.0, 0.0]), stamp=10.0)
    assert check(plan, state=state, obstacles=[crossing]).finding is Finding.COLLISION
    late = dataclasses.replace(crossing, stamp=13.0)
    assert check(plan, state=state, obstacles=[late]).ok
    standing = sphere([3.0, 2.0 - 2.14, 3.0])
    assert check(plan, state=state, obstacles=[standing]).ok


def test_only_the_near_future_may_refuse_but_all_of_it_is_reported():
    state, plan = flying_east()
    far = [sphere([1.0 + 5.5, 2.0, 3.0])]  # 4.5 s until the hulls touch
    verdict = check(plan, state=state, obstacles=far)
    assert verdict.ok
    assert verdict.clearance < 0.0
    whole = dataclasses.replace(CHECK, clearance_horizon=10.0)
    assert check(plan, state=state, obstacles=far, params=whole).finding is Finding.COLLISION


def test_inside_the_minimum_the_way_out_is_open_and_the_way_in_is_not():
    away, _ = flying_east(0.5)
    beside = [sphere([-0.12, 2.0, 3.0])]  # 0.12 m between the hulls, behind
    assert check(make_plan(away, 10.0), state=away, obstacles=beside).ok
    assert check(make_plan(START, 10.0), obstacles=beside).ok  # staying does not make it worse
    ahead = [sphere([2.12, 2.0, 3.0])]
    assert check(make_plan(away, 10.0), state=away, obstacles=ahead).finding is Finding.COLLISION
    hull_free = [sphere([1.0, 2.0 + 1.25, 3.0])]
    slowly = START.copy()
    slowly[7] = 0.06  # comes 0.18 m nearer within 3 s
    verdict = check(make_plan(slowly, 10.0), state=slowly, obstacles=hull_free)
    assert verdict.finding is Finding.CLEARANCE


def test_where_the_hull_touches_by_the_estimate_only_a_plan_that_leads_out_is_flown():
    touching = [sphere([0.1, 2.0, 3.0])]  # hulls overlap by 0.1 m
    out, _ = flying_east(1.0)
    assert check(make_plan(out, 10.0), state=out, obstacles=touching).ok
    assert check(make_plan(START, 10.0), obstacles=touching).finding is Finding.COLLISION


def test_an_obstacle_that_is_nowhere_is_not_an_obstacle_that_is_far(hover):
    ghost = sphere([math.nan, 0.0, 0.0])
    assert not check(hover, obstacles=[ghost]).ok


def test_boxes_and_cylinders():
    state, plan = flying_east()
    box = Obstacle("wall", np.array([3.0, 4.0, 3.0]), np.array([1.0, 2.0, 2.0]), "box")
    assert check(plan, state=state, obstacles=[box]).clearance == pytest.approx(0.5, abs=1e-3)
    pole = Obstacle("pole", np.array([3.0, 2.8, 0.0]), np.array([0.4, 10.0]), "cylinder")
    assert check(plan, state=state, obstacles=[pole]).finding is Finding.COLLISION


def test_a_verified_plan_is_looked_at_again():
    state, plan = flying_east()
    assert check(plan, state=state).ok
    again = dict(vehicle=VEHICLE, params=CHECK)
    assert check_flown(plan, t=10.3, obstacles=(), **again).ok
    assert check_flown(plan, t=10.6, obstacles=(), **again).finding is Finding.TOO_OLD
    popped_up = [sphere([3.0, 2.0, 3.0])]
    assert check_flown(plan, t=10.3, obstacles=popped_up, **again).finding is Finding.COLLISION
    passed = [sphere([0.0, 2.0, 3.0], radius=0.45)]  # behind: the past is not looked at
    assert check_flown(plan, t=10.3, obstacles=passed, **again).ok


def test_a_plan_is_judged_by_where_its_inputs_lead_this_aircraft():
    """A plan consistent in itself, 0.9 m beside the aircraft, clears a sphere that is hit."""
    state, _ = flying_east(speed=2.0)
    beside = state.copy()
    beside[1] += 0.9
    _, plan = flying_east(speed=2.0)
    plan = dataclasses.replace(plan, states=plan.states + (beside - state))
    ball = sphere(state[:3] + [2.0, -0.3, 0.0], radius=0.4)
    assert ball.distance(plan.states[:, :3]).min() - VEHICLE.radius > CHECK.minimum_clearance
    assert check(plan, state=state, obstacles=[ball]).finding is Finding.COLLISION
    assert check(plan, state=beside, obstacles=[ball]).ok


def test_another_heading_or_yaw_rate_is_a_jump(hover):
    for i, off in ((5, math.pi), (5, 0.5), (9, 8.0)):
        state = START.copy()
        state[i] += off
        assert check(hover, state=state).finding is Finding.JUMP


def test_the_dead_time_is_the_guards_own(hover):
    plan = dataclasses.replace(hover, delay=hover.delay + 0.05)
    assert check(plan, params=EVERYTHING).finding is Finding.SHAPE
    assert check(dataclasses.replace(hover, dt=2.0), params=EVERYTHING).finding is Finding.SHAPE


def test_ground_fence_and_speed_are_kept():
    low = START.copy()
    low[2] = LIMITS.fence_min[2] + 0.5
    sinking = make_plan(low, 10.0, [GRAVITY - 1.0, 0.0, 0.0, 0.0])
    assert check(sinking, state=low).finding is Finding.ENVELOPE
    level = make_plan(low, 10.0)
    assert check(level, state=low).ok
    state, _ = flying_east(speed=LIMITS.speed + 1.0)
    ahead = state.copy()
    ahead[0] += VEHICLE.delay * state[6]
    plan = make_plan(ahead, 10.0, [GRAVITY, 0.0, state[4], 0.0])
    assert check(plan, state=state).ok, "pushed by a gust: slowing down must be open"
    state, _ = flying_east(speed=LIMITS.speed - 1.0)
    ahead = state.copy()
    ahead[0] += VEHICLE.delay * state[6]
    faster = make_plan(ahead, 10.0, [GRAVITY, 0.0, 0.3, 0.0])
    assert check(faster, state=state).finding is Finding.ENVELOPE


def test_outside_the_fence_only_a_plan_that_does_not_go_farther_is_flown():
    outside = START.copy()
    outside[2] = LIMITS.fence_min[2] - 0.3
    assert check(make_plan(outside, 10.0), state=outside).ok
    rising = make_plan(outside, 10.0, [GRAVITY + 0.5, 0.0, 0.0, 0.0])
    assert check(rising, state=outside).ok
    sinking = make_plan(outside, 10.0, [GRAVITY - 0.5, 0.0, 0.0, 0.0])
    assert check(sinking, state=outside).finding is Finding.ENVELOPE


def rolled_out(step, inputs, state=START):
    """Return the plan of an integrator: what a solver that uses it would offer."""
    plan = make_plan(state, 10.0)
    states = [tuple(state)]
    for u in inputs:
        states.append(step(states[-1], u, plan.dt, VEHICLE))
    return dataclasses.replace(plan, states=np.array(states), inputs=np.array(inputs))


@pytest.fixture
def strong_inputs():
    """Inputs for which a coarse integrator departs from the model by more than is tolerated."""
    inputs = np.tile(hover_input(), (make_plan(START, 10.0).horizon, 1))
    inputs[0:2, 1], inputs[2:4, 1] = 0.4, -0.4
    return inputs


@pytest.mark.parametrize("step", [rk4_step, euler_step])
def test_a_plan_of_a_coarse_integrator_is_consistent_and_judged_by_where_it_leads(
    step, strong_inputs
):
    plan = rolled_out(step, strong_inputs)
    verdict = check(plan)
    assert verdict.ok, verdict.sentence
    exact = rolled_out(prediction.step, strong_inputs)
    if step is euler_step:
        assert np.abs(plan.states - exact.states).max() > CHECK.attitude_residual
    on_the_way = sphere(exact.states[-1, :3] + [0.0, -0.6, 0.0], radius=0.3)
    assert check(plan, obstacles=(on_the_way,)).finding is Finding.COLLISION


@pytest.mark.parametrize("step", [rk4_step, euler_step])
@pytest.mark.parametrize(("i", "size"), [(0, 0.06), (3, 0.06), (7, 0.35), (9, 0.12)])
def test_a_plan_of_a_coarse_integrator_with_a_wrong_state_is_refused(step, i, size, strong_inputs):
    plan = rolled_out(step, strong_inputs)
    exact = prediction.step(plan.states[4], plan.inputs[4], plan.dt, VEHICLE)
    off = math.copysign(size, plan.states[5, i] - exact[i])  # farther from the model, not nearer
    assert (
        check(altered(plan, states={(5, i): plan.states[5, i] + off})).finding is Finding.DYNAMICS
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_random_departures_are_not_explained_by_a_coarse_integrator(seed):
    """Noise beyond the tolerances in a plan of the model: no integrator makes it consistent."""
    rng = np.random.default_rng(seed)
    plan = make_plan(START, 10.0)
    k, i = rng.integers(1, plan.horizon), rng.choice([0, 1, 2, 3, 4, 6, 7, 8, 9])
    size = 1.1 * {3: 0.05, 4: 0.05, 6: 0.3, 7: 0.3, 8: 0.3, 9: 0.1}.get(int(i), 0.05)
    broken = altered(plan, states={(k, i): plan.states[k, i] + rng.choice([-1, 1]) * size})
    assert check(broken).finding is Finding.DYNAMICS


@pytest.mark.parametrize("name", ["dji_hil", "eth", "paper"])
def test_coarse_steps_are_those_of_the_controller(name):
    vehicle, rng = load_vehicle(name), np.random.default_rng(0)
    x = rng.normal(0.0, [3, 3, 3, 0.2, 0.2, 1.5, 2, 2, 1, 0.5])
    u = rng.uniform([5, -0.4, -0.4, -1], [15, 0.4, 0.4, 1])
    for integrator, step in (("rk4", rk4_step), ("euler", euler_step)):
        theirs = step_function(0.1, integrator)(x, u, model_parameters(vehicle))
        assert np.ravel(theirs.full()) == pytest.approx(step(x, u, 0.1, vehicle), abs=1e-12)


def slowed_by_nothing(deceleration):
    """Return a plan whose states slow down from 2.5 m/s to rest, while its inputs hover."""
    lie = dataclasses.replace(VEHICLE, disturbance=np.array([-deceleration, 0.0, 0.0]))
    states, u = [np.array([0, 0, 5.0, 0, 0, 0, 2.5, 0, 0, 0])], hover_input()
    for _ in range(40):
        x = np.array(prediction.step(states[-1], u, 0.1, lie))
        x[6] = max(x[6], 0.0)
        states.append(x)
    return Plan(10.0, 0.1, VEHICLE.delay, np.array(states), np.tile(u, (40, 1)))


@pytest.mark.parametrize("deceleration", [1.6, 2.5])
def test_a_brake_that_the_inputs_do_not_make_is_seen_in_the_sum(deceleration, monkeypatch):
    plan = slowed_by_nothing(deceleration)
    verdict = check(plan, state=plan.states[0])
    assert verdict.finding is Finding.DYNAMICS
    assert "on average" in verdict.sentence
    monkeypatch.setattr(plan_consistency, "SUMMED", np.inf)
    assert check(plan, state=plan.states[0]).ok, "each stage alone is within its tolerance"


def test_another_estimate_of_the_wind_is_no_departure():
    vehicle = dataclasses.replace(VEHICLE, disturbance=np.array([0.8, -0.6, 0.4]))
    states, u = [START], hover_input()
    for _ in range(30):
        states.append(np.array(prediction.step(states[-1], u, 0.1, vehicle)))
    plan = Plan(10.0, 0.1, VEHICLE.delay, np.array(states), np.tile(u, (30, 1)))
    assert check(plan).ok
