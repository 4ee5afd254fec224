# SPDX-License-Identifier: MIT
"""A sender that is silent, or heard and not understood, is stale, whatever it reported."""

import math

import pytest

from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import Sighting, fault

PARAMS = load_obstacle_parameters()
TREE = Sighting("tree", "cylinder", (0.5, 4.0), (3.0, 0.0, 2.0))
BIRD = Sighting("bird", "sphere", (0.3,), (5.0, 0.0, 2.0), (-1.0, 0.0, 0.0), stamp=10.0)
NAN = (math.nan,) * 3
TOO_MANY = "/laser sends 400 obstacles"


@pytest.fixture
def memory():
    return ObstacleMemory(PARAMS)


def say(memory, t, *sightings, sender="/laser", **options):
    memory.hear(t, sender, [(s, fault(s)) for s in sightings], **options)


@pytest.mark.parametrize("last", [(TREE,), ()])
def test_who_reported_what_stands_or_nothing_and_falls_silent_is_stale(memory, last):
    say(memory, 10.0, TREE)
    say(memory, 10.1, *last)
    assert memory.stale(12.1) == ""
    for t in (12.2, 20.0, 610.0):
        said = f"/laser reported obstacles and is silent for {t - 10.1:.1f} s"
        assert memory.stale(t) == said
    say(memory, 610.0)
    assert memory.stale(610.0) == "", "an empty list is a word"


@pytest.mark.parametrize("seen", [(TREE,), ()])
def test_twin_who_goes_on_is_never_stale(memory, seen):
    for i in range(600):
        say(memory, 10.0 + i / 10, *seen)
        assert memory.stale(10.0 + i / 10) == ""


def test_what_is_latched_or_known_stands_for_good(memory):
    say(memory, 10.0, TREE, sender="/map", latches=True)
    assert memory.stale(9e9) == ""
    say(memory, 10.0, TREE, BIRD, sender="/map", latches=True)
    assert memory.stale(12.5) == "/map reported moving obstacles and is silent for 2.5 s"
    say(memory, 13.0, TREE, sender="/map")
    assert memory.stale(15.5), "its newest list does not last"
    assert memory.summary(15.5).senders == ("/map",)
    say(memory, 16.0, TREE, sender="/map", latches=True)
    assert memory.summary(16.0).senders == ("/map (latched)",)


@pytest.mark.parametrize("latches", [False, True])
def test_who_is_heard_and_not_understood_is_as_good_as_silent(memory, latches):
    say(memory, 10.0, TREE, latches=latches)
    for i in range(1, 26):
        memory.refuse(10.0 + i / 10, "/laser", "too many", TOO_MANY)
    assert memory.stale(12.0) == ""
    assert memory.stale(12.5) == f"{TOO_MANY}, and nothing better comes for 2.5 s"
    assert memory.rejected == {"too many": 25}
    say(memory, 12.6, TREE, latches=latches)
    assert memory.stale(12.6) == ""


def test_twin_one_list_that_is_refused_now_and_then_is_nothing(memory):
    for i in range(100):
        if i % 10:
            memory.refuse(10.0 + i / 10, "/laser", "too many", TOO_MANY)
        else:
            say(memory, 10.0 + i / 10, TREE)
        assert memory.stale(10.0 + i / 10) == ""


def test_who_was_never_understood_is_stale_some_time_after_its_first_word(memory):
    for t in (10.0, 10.5, 11.0, 12.0):
        memory.refuse(t, "/laser", "frame", "/laser: frame 'nowhere'")
        assert memory.stale(t) == ""
    assert memory.stale(12.1) == "/laser: frame 'nowhere', and nothing better comes for 2.1 s"
    assert memory.summary(12.1).senders == ()
    assert memory.knows("/laser")
    assert memory.forget("/laser") == 0
    assert not memory.knows("/laser")
    assert memory.stale(99.0) == ""


@pytest.mark.parametrize("change", [{"position": NAN}, {"size": (-0.3,)}, {"id": ""}])
@pytest.mark.parametrize("entry", [BIRD, TREE._replace(shape="sphere", size=(0.3,))])
def test_what_is_heard_of_first_and_cannot_be_used_makes_its_sender_stale(memory, entry, change):
    bad = entry._replace(**change)
    say(memory, 10.0, bad, TREE._replace(id="other"))
    said = f"what /laser says of obstacle {bad.id} is of no use: {fault(bad)}"
    assert memory.stale(10.0) == said
    say(memory, 10.1, entry, TREE._replace(id="other"))
    assert memory.stale(10.1) == "", "the twin is known"


def test_what_stands_and_is_not_understood_any_more_is_borne_for_some_time(memory):
    say(memory, 10.0, TREE)
    for i in range(1, 26):
        say(memory, 10.0 + i / 10, TREE._replace(position=NAN))
        assert memory.stale(10.0 + i / 10) == "" or i > 20
    assert memory.stale(12.5) == "what /laser says of obstacle tree is of no use: not finite"
    assert len(memory.obstacles(12.5)) == 1
    say(memory, 12.6, TREE)
    assert memory.stale(12.6) == ""


def test_two_places_of_one_id_are_one_that_is_not_known(memory):
    say(memory, 10.0, TREE, TREE)
    assert memory.stale(10.0) == ""
    say(memory, 10.1, TREE, TREE._replace(position=(9.0, 0.0, 2.0)))
    assert memory.stale(10.1) == "what /laser says of obstacle tree is of no use: duplicate id"


def test_after_a_jump_of_the_clock_silence_counts_from_the_next_look(memory):
    say(memory, 10.0, TREE)
    memory.start_anew()
    assert memory.stale(5.0) == ""
    assert memory.stale(7.0) == ""
    assert memory.stale(7.1) == "/laser reported obstacles and is silent for 2.1 s"


def test_after_a_jump_what_a_latched_list_lacks_is_still_missing(memory):
    say(memory, 10.0, TREE._replace(position=NAN), latches=True)
    memory.start_anew()
    assert memory.stale(5.0) == "what /laser says of obstacle tree is of no use: not finite"


def test_a_list_that_was_parked_is_as_old_as_when_it_came(memory):
    say(memory, 60.0, TREE, received=10.0)
    assert memory.stale(60.0) == "/laser reported obstacles and is silent for 50.0 s"
