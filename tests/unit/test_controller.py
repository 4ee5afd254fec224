"""One control step: what it needs, what it compensates, what it holds on to."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.controller import Controller
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import load_parameters
from nmpc_control.prediction import predict
from nmpc_control.state import GRAVITY, POSITION, Goal
from nmpc_control.trajectory import line

LEVEL = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture
def controller() -> Controller:
    return Controller(load_parameters("dji_hil"))


def tell(
    controller: Controller, t: float, position=(0.0, 0.0, 5.0), velocity=(0.0, 0.0, 0.0)
) -> None:
    controller.estimator.add_attitude(t, LEVEL)
    controller.estimator.add_imu(t, (0.0, 0.0, 0.0))
    controller.estimator.add_velocity(t, velocity)
    controller.estimator.add_position(t, position)


def test_no_plan_without_a_state_and_none_on_a_stale_one(controller):
    assert controller.step(0.0) is None
    tell(controller, 0.0)
    assert controller.step(0.05) is not None
    assert controller.step(controller.parameters.flight.state_timeout + 0.05) is None


def test_not_engaged_it_follows_and_engaged_it_holds(controller):
    tell(controller, 0.0, position=(1.0, 0.0, 5.0))
    assert controller.step(0.0).reference[POSITION] == pytest.approx([1.0, 0.0, 5.0])
    tell(controller, 0.1, position=(2.0, 0.0, 5.0))
    assert controller.step(0.1).reference[POSITION] == pytest.approx([2.0, 0.0, 5.0])
    controller.engaged = True
    tell(controller, 0.2, position=(3.0, 0.0, 5.0))
    assert controller.step(0.2).reference[POSITION] == pytest.approx([2.0, 0.0, 5.0])


def test_only_a_plan_that_was_found_and_is_flown_is_a_promise_to_others(controller):
    tell(controller, 0.0)
    assert not controller.step(0.0).is_promise, "a pilot flies, whatever the plan says"
    controller.engaged = True
    tell(controller, 0.1)
    step = controller.step(0.1)
    assert step.is_promise
    lost = dataclasses.replace(step.plan, found=False)
    assert not dataclasses.replace(step, plan=lost).is_promise


def test_who_held_it_up_before_is_forgotten_where_nothing_can_be_solved(controller):
    """Neither a missing state nor a problem that cannot be posed is held up by what was there."""
    tell(controller, 0.0)
    controller.nmpc.held_up_by = ("wall",)
    nowhere = Obstacle("nowhere", np.full(3, np.nan), np.array([1.0]))
    controller.obstacles = (nowhere,)
    assert not controller.step(0.05).plan.found
    assert controller.nmpc.held_up_by == ()
    controller.nmpc.held_up_by = ("wall",)
    assert controller.step(30.0) is None
    assert controller.nmpc.held_up_by == ()


def test_losing_engagement_ends_the_trajectory(controller):
    controller.engaged = True
    tell(controller, 0.0)
    controller.itinerary.begin(0.0, line(np.array([0, 0, 5.0]), np.array([9.0, 0, 5]), speed=1.0))
    assert controller.step(0.0).goal is Goal.TRAJECTORY
    controller.engaged = False
    tell(controller, 0.1)
    assert controller.step(0.1).goal is Goal.HOLD
    assert not controller.itinerary.outcome.arrived


def test_the_plan_starts_from_the_state_predicted_over_the_dead_time(controller):
    vehicle = controller.parameters.vehicle
    sent = [(-0.10 + 0.02 * i, np.array([GRAVITY + 1.0, 0.1, 0.0, 0.0])) for i in range(6)]
    for t, u in sent:
        controller.record_input(t, u)
    tell(controller, 0.0, velocity=(1.0, 0.0, 0.0))
    plan = controller.step(0.0).plan
    estimate = controller.estimator.estimate(0.0).vector
    assert plan.states[0] == pytest.approx(predict(estimate, 0.0, vehicle.delay, sent, vehicle))
    assert plan.states[0, 0] > 0.9 * vehicle.delay
    assert plan.states[0, 3] > 0.01, "roll that was commanded but is not yet seen"
    assert plan.delay == vehicle.delay


def test_input_that_is_not_finite_is_not_remembered(controller):
    controller.record_input(0.0, np.full(4, np.nan))
    tell(controller, 0.0)
    assert controller.step(0.0).plan.found


def test_clearance_counts_from_the_hull(controller):
    controller.obstacles = (Obstacle("s", np.array([3.0, 0.0, 5.0]), np.array([0.7])),)
    tell(controller, 0.0)
    assert controller.step(0.0).clearance == pytest.approx(
        3.0 - 0.7 - controller.parameters.vehicle.radius
    )
    controller.obstacles = ()
    assert controller.step(0.02).clearance == np.inf


def test_new_weights_act_without_a_new_solver(controller):
    tell(controller, 0.0, velocity=(1.0, 0.0, 0.0))
    solver, before = controller.nmpc.solver, controller.step(0.0).plan.cost
    weights = dataclasses.replace(
        controller.parameters.weights, Q=controller.parameters.weights.Q * 2
    )
    controller.use(dataclasses.replace(controller.parameters, weights=weights))
    assert controller.nmpc.solver is solver
    assert controller.step(0.02).plan.cost > 1.1 * before
