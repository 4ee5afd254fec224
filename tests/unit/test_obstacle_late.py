# SPDX-License-Identifier: MIT
"""What is too old when it is heard of first is not known, and that is not hidden."""

import pytest

from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import Sighting, fault

TREE = Sighting("tree", "cylinder", (0.5, 4.0), (3.0, 0.0, 2.0))
BIRD = Sighting("bird", "sphere", (0.3,), (5.0, 0.0, 2.0), (-1.0, 0.0, 0.0), stamp=10.0)


@pytest.fixture
def memory():
    return ObstacleMemory(load_obstacle_parameters())


def say(memory, t, *sightings, sender="/tracker"):
    memory.hear(t, sender, [(s, fault(s)) for s in sightings])


@pytest.mark.parametrize("others", [(), (TREE,), (BIRD._replace(id="seen", stamp=12.5),)])
def test_a_sender_whose_clock_is_late_is_stale_from_its_first_list_on(memory, others):
    say(memory, 12.4, BIRD._replace(stamp=10.5), sender="/good")
    say(memory, 12.5, BIRD, *others)
    assert memory.rejected == {"too old": 1}
    assert memory.stale(12.5) == "what /tracker says of obstacle bird is 2.5 s old"
    say(memory, 12.5, BIRD._replace(stamp=12.0), *others)
    assert memory.stale(12.5) == "", "the twin that is less late is known"


def test_one_in_a_frame_that_was_not_known_then_is_stale(memory):
    memory.hear(12.5, "/tracker", [(BIRD._replace(stamp=12.4), "frame"), (TREE, "frame")])
    assert memory.rejected == {"frame": 2}
    assert memory.stale(12.5) == "what /tracker says of obstacle bird is of no use: frame not known"
    memory.hear(12.6, "/tracker", [(TREE, "frame")])
    assert memory.stale(12.6) == "what /tracker says of obstacle tree is of no use: frame not known"
    say(memory, 12.7, TREE)
    assert memory.stale(12.7) == ""


def test_one_that_begins_to_move_with_old_news_is_stale(memory):
    say(memory, 10.0, TREE)
    say(memory, 12.5, TREE._replace(velocity=(1.0, 0.0, 0.0), stamp=10.0))
    assert [o.id for o in memory.obstacles(12.5)] == ["tree"]
    assert memory.stale(12.5) == "what /tracker says of obstacle tree is 2.5 s old"
    say(memory, 12.6, TREE)
    assert memory.stale(12.6) == ""


@pytest.mark.parametrize("end", ["absent", "forgotten", "a jump of the clock"])
def test_a_late_sender_is_stale_until_it_says_otherwise_or_is_forgotten(memory, end):
    say(memory, 12.5, BIRD)
    assert memory.stale(99.0)
    if end == "absent":
        say(memory, 99.0)
    elif end == "forgotten":
        assert memory.forget("/tracker") == 1
        assert memory.forget("/tracker") == 0
    else:
        memory.start_anew()
    assert memory.stale(99.0) == ""
