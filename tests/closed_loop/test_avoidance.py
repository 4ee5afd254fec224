# SPDX-License-Identifier: MIT
"""Held up, pushed too near or out, or sent where nobody fits; and twins without protection."""

import dataclasses

import numpy as np
import pytest

from nmpc_control.mode_inputs import STREAMING, Mode, Request
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import load_parameters
from nmpc_control.reference_clock import ReferenceClock
from nmpc_control.scenario import load_scenario
from nmpc_control.state import Goal
from nmpc_control.trajectory import line
from uav_sim.closed_loop import loop
from uav_sim.closed_loop.simulate import new_loop

MARGIN = 0.5  # [m] hull to surface
NEVER_NEARER = MARGIN - 0.05  # [m] on truth
TWINS = pytest.mark.parametrize("protected", [True, False], ids=["", "twin"])


class Flight:
    """A hovering aircraft in the closed loop, and obstacles that only exist in what is known."""

    def __init__(self, protected=True, limits=None, **flight):
        """Take off; without protection neither problem nor guard is told of anything."""
        p = load_parameters("dji_hil", "outdoor")
        solver = p.solver.with_budget(time_budget=1.0)  # what is found does not hang on the load
        limits = dataclasses.replace(p.limits, **(limits or {})) if protected else p.limits
        flight = dataclasses.replace(p.flight, **flight)
        self.parameters = dataclasses.replace(p, solver=solver, limits=limits, flight=flight)
        self.loop = new_loop(load_scenario("hover"), self.parameters, "dji_hil")
        self.loop.aircraft.place([0.0, 0.0, 10.0])
        self.protected = protected
        self.field = ObstacleField(())
        self._from = 0
        while self.loop.guard.mode not in STREAMING or not self.loop.controller.engaged:
            self.loop.inbox.request = Request.START
            self.loop.step()
        self.run(0.5)

    @property
    def itinerary(self):
        return self.loop.controller.itinerary

    @property
    def plan(self):
        return self.loop.log.steps[-1].plan

    @property
    def truth(self):
        return self.loop.log.truths[-1]

    def know(self, obstacles):
        """Put obstacles into the world."""
        self.field, self._from = ObstacleField(obstacles), len(self.loop.log.truths)
        if self.protected:
            self.loop.controller.obstacles = self.loop.inbox.obstacles = tuple(obstacles)

    def run(self, seconds):
        end = self.loop.t + seconds
        while self.loop.t < end:
            self.loop.step()

    def until_over(self, seconds):
        """Fly until the goal is reached or given up."""
        end = self.loop.t + seconds
        while self.itinerary.outcome is None and self.loop.t < end:
            self.loop.step()
        return self.itinerary.outcome

    def push(self, by):
        """Move the aircraft at once by a way (3,) [m], where it is then told to hold."""
        plant = self.loop.aircraft.plant
        plant.position = tuple(plant.position + np.array(by))
        self.run(0.1)
        self.itinerary.hold(np.array(plant.position), 0.0)

    def begin(self, trajectory):
        self.itinerary.begin(self.loop.t, trajectory)

    def clearances(self):
        """Return the hull's least distance (M,) [m] from the obstacles since they are there."""
        truths = self.loop.log.truths[self._from :]
        positions = np.array([truth.position for truth in truths])
        distances = self.field.distances(positions, np.array([truth.t for truth in truths]))
        return distances.min(axis=0) - self.parameters.vehicle.radius


def ball(x, y=0.0, z=10.0, radius=0.5):
    return Obstacle(f"ball {x:g} {y:g} {z:g}", np.array([x, y, z]), np.array([radius]))


@TWINS
def test_pushed_into_the_margin_it_is_out_again_in_two_seconds(protected):
    flight = Flight(protected)
    flight.know([ball(0.0, 1.0 + MARGIN + 0.2)])
    flight.run(1.0)
    assert flight.clearances()[-1] > MARGIN
    flight.push([0.0, 0.4, 0.0])
    assert flight.clearances()[-1] == pytest.approx(MARGIN - 0.2, abs=0.05)
    flight.run(1.9)
    assert (flight.clearances()[-1] > MARGIN) == protected
    assert flight.clearances().min() > MARGIN - 0.3
    if protected:
        assert flight.loop.guard.mode in (Mode.HOVERING, Mode.FLYING)


@TWINS
def test_pushed_out_of_the_fence_it_is_inside_again_in_two_seconds(protected):
    flight = Flight(protected, limits={"fence_max": np.array([0.3, 1000.0, 120.0])})
    flight.push([0.5, 0.0, 0.0])
    assert flight.truth.position[0] == pytest.approx(0.5, abs=0.05)
    flight.run(1.9)
    assert (flight.truth.position[0] <= 0.3) == protected
    if protected:
        assert flight.loop.guard.mode in (Mode.HOVERING, Mode.FLYING)


def wall(x):
    """Return spheres across the way as far as anybody would go round, none with a way between."""
    return [ball(x + 2.5, y, z, 2.5) for y in np.arange(-18.0, 18.1, 4.0) for z in range(-2, 31, 4)]


def test_before_a_wall_it_stops_and_says_so_and_goes_on_when_it_is_gone():
    flight = Flight()
    flight.know(wall(6.0))
    flight.begin(line(np.array([0.0, 0.0, 10.0]), np.array([9.0, 0.0, 10.0]), speed=1.5))
    flight.run(9.0)
    clearances = flight.clearances()
    assert clearances.min() > NEVER_NEARER
    assert clearances[-1] < MARGIN + 1.0
    assert np.linalg.norm(flight.truth.velocity) < 0.15
    assert "held up by ball" in flight.plan.status
    assert flight.itinerary.goal is Goal.TRAJECTORY
    assert flight.loop.guard.mode is Mode.FLYING
    flight.know([])
    assert flight.until_over(15.0).arrived


@TWINS
def test_let_go_it_does_not_sprint_after_the_reference(protected, monkeypatch):
    """The twin's reference stands ahead of it and is flown after at once."""
    if not protected:
        monkeypatch.setattr(ReferenceClock, "release", lambda clock, t: None)
    pace = 1.5
    flight = Flight()
    flight.know(wall(6.0))
    flight.begin(line(np.array([0.0, 0.0, 10.0]), np.array([25.0, 0.0, 10.0]), speed=pace))
    flight.run(9.0)
    assert flight.plan.status.count("held up by")
    flight.know([])
    before = len(flight.loop.log.truths)
    flight.run(4.0)
    along = max(truth.velocity[0] for truth in flight.loop.log.truths[before:])
    assert flight.truth.velocity[0] > pace
    assert (along < 1.35 * pace) == protected
    assert protected or along > 2.0 * pace


@TWINS
def test_braked_for_long_without_leaving_the_mode_it_does_not_set_off_unasked(
    protected, monkeypatch
):
    """The guard brakes for what it cannot see; the twin's controller is not told."""
    if not protected:
        monkeypatch.setattr(loop, "BRAKES", ())
    flight = Flight(patience=5.0)
    flight.begin(line(np.array([0.0, 0.0, 10.0]), np.array([30.0, 0.0, 10.0]), speed=1.5))
    flight.run(2.0)
    flight.loop.inbox.obstacles_stale = "nothing heard of the laser"
    flight.run(3.0)
    assert flight.loop.guard.mode is Mode.FLYING
    assert flight.itinerary.goal is Goal.TRAJECTORY
    flight.run(3.5)
    given_up = flight.itinerary.outcome is not None
    assert given_up == protected
    assert not given_up or "held up" in flight.itinerary.outcome.message
    flight.loop.inbox.obstacles_stale = ""
    flight.run(2.0)
    assert (np.linalg.norm(flight.truth.velocity) > 1.0) != protected


def test_twin_that_knows_of_no_wall_flies_through_it():
    flight = Flight(protected=False)
    flight.know(wall(6.0))
    flight.begin(line(np.array([0.0, 0.0, 10.0]), np.array([9.0, 0.0, 10.0]), speed=1.5))
    flight.run(6.0)
    assert flight.clearances().min() < -0.5


@TWINS
def test_a_goal_inside_an_obstacle_is_given_up_outside_of_it(protected):
    flight = Flight(protected, patience=2.0)
    flight.know([ball(5.0, radius=1.0)])
    flight.itinerary.go_to(flight.loop.t, np.array([0.0, 0, 10]), 0.0, np.array([5.0, 0, 10]), 0.0)
    outcome = flight.until_over(12.0)
    flight.run(1.0)
    assert outcome.arrived == (not protected)
    assert (flight.clearances().min() > NEVER_NEARER) == protected
    if protected:
        assert "held up" in outcome.message
        assert np.linalg.norm(flight.truth.velocity) < 0.15


def test_where_only_the_guard_sees_an_obstacle_the_goal_is_given_up():
    """It brakes again and again for what the solver flies at: without patience for ever."""
    flight = Flight(patience=6.0)
    flight.know([ball(5.0, radius=1.0)])
    flight.loop.controller.obstacles = ()
    flight.itinerary.go_to(flight.loop.t, np.array([0.0, 0, 10]), 0.0, np.array([9.0, 0, 10]), 0.0)
    outcome = flight.until_over(20.0)
    flight.run(2.0)
    assert "held up" in outcome.message
    assert np.linalg.norm(flight.truth.velocity) < 0.15
    assert flight.loop.guard.mode is Mode.HOVERING
    assert flight.clearances().min() > 0.1


@TWINS
def test_a_gap_that_is_too_narrow_is_not_flown_through(protected):
    flight = Flight(protected)
    flight.know(
        [
            Obstacle(f"tower {y:g}", np.array([5.0, y, 10.0]), np.array([1.6, 60.0]), "cylinder")
            for y in (-2.0, 2.0)  # 0.8 m between them
        ]
    )
    flight.begin(line(np.array([0.0, 0.0, 10.0]), np.array([10.0, 0.0, 10.0]), speed=1.5))
    outcome = flight.until_over(20.0)
    assert (flight.clearances().min() > NEVER_NEARER) == protected
    assert outcome is not None and outcome.arrived, "the way round is found"
