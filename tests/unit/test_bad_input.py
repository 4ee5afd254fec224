"""Bad numbers: refused by name before a flight; in flight an answer, never an exception or NaN."""

import dataclasses

import numpy as np
import pytest
from problems import SPHERE, parameters, straight_reference

from nmpc_control.controller import Controller
from nmpc_control.errors import ConfigError, ProblemError
from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.packing import pack_theta
from nmpc_control.params import Lag, load_parameters
from nmpc_control.scenario import load_scenario
from nmpc_control.state import Goal, Plan, hover_input, hover_state
from nmpc_control.trajectory import line

START = hover_state(np.array([0.0, 0.0, 5.0]))


@pytest.fixture(scope="module", params=["compiled", "ipopt"])
def nmpc(request) -> Nmpc:
    return Nmpc(parameters(request.param, time_budget=2.0))


def is_finite(plan: Plan) -> bool:
    return bool(np.all(np.isfinite(plan.states)) and np.all(np.isfinite(plan.inputs)))


def replaced(base, part: str, **values):
    return dataclasses.replace(base, **{part: dataclasses.replace(getattr(base, part), **values)})


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("argument", ["x0", "u_before"])
def test_a_state_or_input_that_is_not_finite_is_answered_without_a_plan(nmpc, argument, value):
    arguments = {"x0": START.copy(), "u_before": hover_input()}
    arguments[argument][1] = value
    plan = nmpc.solve(0.0, x_ref=straight_reference(nmpc), **arguments)
    assert not plan.found
    assert is_finite(plan)
    again = nmpc.solve(0.05, START, straight_reference(nmpc), hover_input())
    assert again.found, "the next solve is clean"


def test_what_follows_an_input_that_is_not_finite_is_as_if_it_had_not_been(nmpc):
    """No NaN stays behind in a solver's buffers."""
    nmpc.reset()
    expected = nmpc.solve(0.0, START, straight_reference(nmpc), hover_input()).cost
    nmpc.solve(0.0, START, straight_reference(nmpc), hover_input() * np.nan)
    nmpc.reset()
    again = nmpc.solve(0.0, START, straight_reference(nmpc), hover_input()).cost
    assert again == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("free", [("R", 0), ("R", 3)], ids=["thrust", "yaw rate"])
def test_inputs_that_cost_nothing_are_solved_all_the_same(free):
    """Without any weight on an input the recursion is singular, the problem is not."""
    name, index = free
    p = parameters("compiled", max_iterations=100, time_budget=2.0)
    weights = {"Q_f": np.zeros(10)}
    for part in (name, "R_delta"):
        weights[part] = getattr(p.weights, part).copy()
        weights[part][index] = 0.0
    nmpc = Nmpc(replaced(p, "weights", **weights))
    plan = nmpc.solve(0.0, START, np.tile(START, (61, 1)), hover_input())
    assert plan.status == "converged"
    assert plan.cost == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda ref: ref * np.nan, "not finite"),
        (lambda ref: ref[:5], "shape"),
        (lambda ref: ref[:, :9], "shape"),
        (lambda ref: ref[0], "shape"),
    ],
    ids=["NaN", "short", "narrow", "flat"],
)
@pytest.mark.parametrize("obstacles", [(), (SPHERE,)], ids=["free", "obstacle"])
def test_a_reference_that_cannot_be_meant_is_refused_by_name(nmpc, spoil, named, obstacles):
    with pytest.raises(ProblemError, match=named):
        nmpc.solve(0.0, START, spoil(straight_reference(nmpc)), hover_input(), obstacles)


def test_an_input_before_that_is_far_outside_its_bounds_is_led_back(nmpc):
    before = np.array([40.0, 1.0, -1.0, 3.0])
    nmpc.reset()
    plan = nmpc.solve(0.0, START, straight_reference(nmpc), before)
    assert plan.found
    assert np.all(plan.inputs <= nmpc.parameters.limits.input_max + 1e-6)
    nmpc.reset()


def test_obstacles_without_a_slot_are_told():
    nmpc = Nmpc(replaced(parameters("compiled"), "solver", obstacle_slots=0))
    plan = nmpc.solve(0.0, START, straight_reference(nmpc), hover_input(), (SPHERE,))
    assert "1 obstacles in reach have no slot" in plan.status
    assert nmpc.solve(0.1, START, straight_reference(nmpc), hover_input()).status == "converged"


@pytest.mark.parametrize(
    ("part", "values", "named"),
    [
        ("weights", {"Q": np.full(10, -1.0)}, "Q"),
        ("weights", {"Q_f": np.full(10, np.nan)}, "not finite"),
        ("weights", {"R": np.full(4, np.inf)}, "not finite"),
        ("weights", {"R_delta": np.full(4, -1e-9)}, "R_delta"),
        ("limits", {"input_min": np.full(4, 99.0)}, "u_min"),
        ("limits", {"fence_min": np.full(3, 2e3)}, "fence_min"),
        ("limits", {"speed": -1.0}, "speed"),
        ("limits", {"soft_weight": -1.0}, "soft_weight"),
        ("avoidance", {"eta": -1.0}, "eta"),
        ("vehicle", {"drag": np.full(3, np.nan)}, "not finite"),
        ("vehicle", {"roll": Lag(0.0, 1.0)}, "roll.time_constant"),
        ("vehicle", {"radius": np.inf}, "radius"),
        ("weights", {"Q": np.ones(9)}, "Q: got shape"),
        ("avoidance", {"safety_distance": -0.1}, "safety_distance"),
    ],
)
def test_parameters_that_cannot_be_meant_are_refused_by_name(part, values, named):
    p = replaced(load_parameters(), part, **values)
    with pytest.raises(ProblemError, match=named):
        pack_theta(p.vehicle, p.weights, p.limits, p.avoidance)


def test_a_flight_that_starts_in_an_obstacle_is_refused_when_it_is_planned(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "speed: 1.0\nreference: {type: waypoints, points: [[0,0,2],[9,0,2]]}\n"
        "obstacles: [{id: tree, position: [0.6,0,2], radius: 0.3}]\n"
    )
    with pytest.raises(ConfigError, match="tree"):
        load_scenario(str(path))


def test_pushed_into_the_margin_of_an_obstacle_the_solver_leads_out(nmpc):
    inside = SPHERE.position + [0.0, -0.75, 0.0]  # hull 0.35 m inside the sphere's surface
    for _ in range(3):  # as in flight: the next solve goes on where the last one ended
        plan = nmpc.solve(
            0.0, hover_state(inside), straight_reference(nmpc), hover_input(), (SPHERE,)
        )
        assert is_finite(plan)
    clearance = SPHERE.distance(plan.states[:, :3]) - nmpc.parameters.vehicle.radius
    assert clearance[0] < 0.0
    assert clearance[15] > 0.1
    nmpc.reset()


@pytest.fixture(scope="module")
def controller() -> Controller:
    return Controller(load_parameters("dji_hil"))


def tick(controller: Controller, t: float):
    controller.estimator.add_attitude(t, (0.0, 0.0, 0.0, 1.0))
    controller.estimator.add_imu(t, (0.0, 0.0, 0.0))
    controller.estimator.add_velocity(t, (0.0, 0.0, 0.0))
    controller.estimator.add_position(t, (0.0, 0.0, 5.0))
    return controller.step(t)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_obstacle_that_is_nowhere_is_a_status_not_an_exception(controller, value):
    t = 1.0 if np.isnan(value) else 2.0
    controller.obstacles = (Obstacle("lost", np.full(3, value), np.array([0.5])),)
    step = tick(controller, t)
    assert not step.plan.found
    assert "lost" in step.plan.status
    assert "finite" in step.plan.status
    assert is_finite(step.plan)
    controller.obstacles = ()
    assert tick(controller, t + 0.05).plan.found


def test_telemetry_that_is_not_finite_raises_nothing(controller):
    assert tick(controller, 3.0).plan.found
    controller.estimator.add_attitude(3.01, (np.nan, 0.0, 0.0, 1.0))
    controller.estimator.add_imu(3.01, (np.nan, 0.0, 0.0))
    controller.estimator.add_velocity(3.01, (np.inf, 0.0, 0.0))
    controller.estimator.add_position(3.01, (0.0, np.nan, 5.0))
    step = controller.step(3.02)
    assert step is None or (is_finite(step.plan) and np.isfinite(step.estimate.vector).all())


def test_a_reference_that_breaks_is_a_status_not_an_exception(controller, monkeypatch):
    controller.engaged = True
    tick(controller, 4.0)
    controller.itinerary.begin(4.0, line(np.array([0, 0, 5.0]), np.array([9.0, 0, 5]), speed=1))
    broken = np.full((controller.nmpc.structure.horizon + 1, 10), np.nan)
    monkeypatch.setattr(
        controller.itinerary, "reference", lambda times: broken[: len(np.atleast_1d(times))]
    )
    step = tick(controller, 4.05)
    assert step.goal is Goal.TRAJECTORY
    assert not step.plan.found
    assert is_finite(step.plan)
