# SPDX-License-Identifier: MIT
"""Some rows of the fault matrix, and twins: with the protection off the row fails.

``make faults`` flies them all.
"""

import dataclasses
import functools

import pytest

from nmpc_control import obstacle_memory
from nmpc_control.dji import VELOCITY
from nmpc_control.obstacle_sighting import MAX_OBSTACLES
from uav_sim.closed_loop.faults.escape import way_out
from uav_sim.closed_loop.faults.flight import FAULT_AT, fly
from uav_sim.closed_loop.faults.judgement import row_of
from uav_sim.closed_loop.faults.matrix import load_cases, load_expectations
from uav_sim.closed_loop.faults.runner import judged

CASES, EXPECTED = load_cases(), load_expectations()


def flown(name, situation, prepare=lambda loop: None):
    case = CASES[name]
    return row_of(case, situation, fly(case, situation, prepare), EXPECTED[name][situation])


@pytest.mark.parametrize(
    ("name", "situation"),
    [
        ("solver_nan", "turn"),
        ("solver_into_obstacle", "beside"),
        ("controller_dead", "turn"),
        ("position_silent", "beside"),
        ("pilot_leaves_f", "turn"),
        ("guard_raises", "hover"),
        ("obstacles_static_silent", "hover"),
        ("obstacles_static_nan", "hover"),
        ("obstacles_static_too_many", "hover"),
        ("obstacle_appears_in_a_flood", "turn"),
    ],
)
def test_a_row_ends_as_expected(name, situation):
    row = flown(name, situation)
    assert row["passed"], row["failures"]
    assert row["nan_published"] == 0
    assert not row["collision"]


@pytest.mark.long
def test_a_collision_that_nobody_could_avoid_is_known_as_such():
    row = judged(CASES["obstacle_at_once"], "hover", EXPECTED["obstacle_at_once"]["hover"])
    assert row["collision"]
    assert row["unavoidable"]
    assert row["passed"], row["failures"]


def changed(loop, **changes):
    """Give the guard other parameters, each a whole part of them."""
    params = dataclasses.replace(loop.guard.params, **changes)
    loop.guard.params = loop.guard.situation.params = params
    loop.guard.ladder.params = params.plan_check


def without_ages(loop):
    p = loop.guard.params
    lasting = dataclasses.replace(p.modes, position_timeout=100.0, velocity_timeout=100.0)
    changed(loop, modes=lasting)


def without_plan_age(loop):
    changed(loop, plan_check=dataclasses.replace(loop.guard.params.plan_check, timeout=100.0))


def without_rc(loop):
    add, f = loop.inbox.add_rc, loop.guard.params.rc_switch.f
    loop.inbox.add_rc = lambda t, axes: add(t, axes if t < 3.0 else (*axes[:4], f, axes[5]))


def with_lists_that_stand_for_good(loop):
    for memory in loop._memories:
        memory.hear = functools.partial(memory.hear, latches=True)


def with_lists_that_are_refused_unseen(loop):
    for memory in loop._memories:
        memory.refuse = lambda *_: None
    with_lists_that_stand_for_good(loop)


def with_entries_that_are_refused_unseen(loop):
    for memory in loop._memories:
        memory._unseen = lambda *_: {}


@pytest.mark.parametrize(
    ("name", "situation", "off"),
    [
        ("position_silent", "turn", without_ages),
        ("controller_dead", "hover", without_plan_age),
        ("pilot_leaves_f", "hover", without_rc),
        ("obstacles_static_silent", "hover", with_lists_that_stand_for_good),
        ("obstacles_static_too_many", "hover", with_lists_that_are_refused_unseen),
        ("obstacles_static_nan", "hover", with_entries_that_are_refused_unseen),
    ],
)
def test_twin_with_the_protection_off_the_row_fails(name, situation, off):
    assert not flown(name, situation, off)["passed"]


def holding_at(vx, vz):
    """Return what makes DJI's velocity hold move [m/s] instead."""

    def prepare(loop):
        send = loop.send

        def moved(axes):
            holds = loop.t > FAULT_AT["hover"] and axes[4] == VELOCITY
            send((vx, 0.0, vz, 0.0, axes[4]) if holds else axes)

        loop.send = moved

    return prepare


@pytest.mark.parametrize(
    ("velocity", "words"), [((0.0, -0.5), "sinks by"), ((0.5, 0.0), "moves at 0.")]
)
def test_twin_a_hold_that_sinks_or_does_not_brake_fails(velocity, words):
    row = flown("controller_dead", "hover", holding_at(*velocity))
    assert row["way"] == ["braking no_plan"], "nothing but the motion tells"
    assert any(words in failure for failure in row["failures"])


def deaf_to_answers(loop):
    take = loop.inbox.inputs

    def inputs(t, steady):
        loop.inbox.landing_granted = False
        return take(t, steady)

    loop.inbox.inputs = inputs


@pytest.mark.long
def test_twin_a_guard_that_is_not_told_of_its_landing_holds_against_it():
    name = "status_silent_while_landing"
    assert flown(name, "hover")["passed"]
    row = flown(name, "hover", deaf_to_answers)
    assert any("against DJI's landing" in words for words in row["failures"])


def unworried(loop):
    for memory in loop._memories:
        memory.stale = lambda t: ""


@pytest.mark.long
@pytest.mark.parametrize(("prepare", "collides"), [(lambda loop: None, False), (unworried, True)])
def test_twin_a_memory_without_room_for_near_ones_holds_back_or_hits(
    monkeypatch, prepare, collides
):
    monkeypatch.setattr(obstacle_memory, "MAX_REMEMBERED", MAX_OBSTACLES)
    row = flown("obstacle_appears_in_a_flood", "turn", prepare)
    assert not row["passed"]
    assert row["collision"] == collides


def without_obstacles(loop):
    judge, look = loop.judge, loop.guard.look_at_plan
    loop.judge = lambda inputs: judge(dataclasses.replace(inputs, obstacles=()))
    loop.guard.look_at_plan = lambda inputs: look(dataclasses.replace(inputs, obstacles=()))


def test_twin_a_guard_that_knows_no_obstacles_hits_one_which_could_have_been_avoided():
    case = CASES["solver_into_obstacle"]
    flight = fly(case, "hover", without_obstacles)
    row = row_of(case, "hover", flight, EXPECTED[case.name]["hover"])
    assert row["collided_with"] == ["pillar"]
    assert not row["passed"]
    assert way_out(case, "hover", flight)
