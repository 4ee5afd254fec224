# SPDX-License-Identifier: MIT
"""A clock that is set back is noticed once, whoever sleeps by it; a small step is waited out."""

from nmpc_control.clock_steps import ClockSteps


def readings(*times):
    clock = ClockSteps()
    return [clock.went_back(t) for t in times]


def test_a_jump_back_is_told_once():
    assert readings(10.0, 10.05, 5.0, 5.05, 5.1) == [False, False, True, False, False]


def test_many_small_steps_back_are_one_jump_in_the_end():
    assert readings(10.0, 9.95, 9.91, 9.87, 9.92) == [False, False, False, True, False]


def test_twin_forward_and_standing_clocks_are_no_jump():
    assert not any(readings(10.0, 10.0, 9.95, 10.1, 15.0))
