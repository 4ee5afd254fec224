# SPDX-License-Identifier: MIT
"""Where more obstacles are known than count, the nearest do."""

import numpy as np
import pytest

from nmpc_control import obstacle_memory
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_crowd import nearest
from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting

HERE = np.array([0.0, 0.0, 2.0])
PERSON = Sighting("person", "cylinder", (0.3, 1.8), (2.0, 0.0, 2.0), (-1.0, 0.0, 0.0), stamp=10.0)
FAR = [
    Sighting(f"far{i}", "sphere", (0.5,), (60.0 + i, 0.0, 2.0), (0.1, 0.0, 0.0), stamp=10.0)
    for i in range(MAX_OBSTACLES)
]


@pytest.fixture
def memory():
    memory = ObstacleMemory(load_obstacle_parameters())
    memory.hear(10.0, "/depth", [(s, "") for s in FAR])
    assert not memory.is_crowded
    memory.hear(10.0, "/laser", [(PERSON, "")])
    assert memory.is_crowded
    return memory


def names(memory, t=10.0, place=HERE):
    return {o.id for o in memory.obstacles(t, place)}


def test_one_that_is_near_displaces_the_farthest_of_another_sender(memory):
    assert names(memory) == {s.id for s in FAR[:-1]} | {"person"}
    assert (memory.stale(10.0), memory.rejected) == ("", {})
    summary = memory.summary(10.0)
    assert (summary.known, summary.left_out) == (MAX_OBSTACLES, 1)


def test_twin_that_does_not_look_for_the_nearest_does_not_know_it(memory, monkeypatch):
    first = lambda crowd, count, place, t: range(count)  # noqa: E731
    monkeypatch.setattr(obstacle_memory, "nearest", first)
    assert "person" not in names(memory)


def test_what_is_left_out_comes_back_as_the_aircraft_goes_there(memory):
    first = memory.obstacles(10.0, HERE)
    assert memory.obstacles(10.4, HERE) is first
    there = names(memory, 10.6, HERE + (300.0, 0.0, 0.0))
    assert there == {s.id for s in FAR}


def test_a_crowd_of_what_is_known_from_a_scenario_hides_nobody_either(memory):
    memory.hear(10.1, "/depth", [])
    memory.set_known([Obstacle(s.id, np.array(s.position), np.ones(1)) for s in FAR])
    assert "person" in names(memory, 10.1)


def test_the_crowd_is_left_when_there_is_room_again(memory):
    assert len(names(memory)) == MAX_OBSTACLES
    memory.hear(10.1, "/depth", [(s, "") for s in FAR[:9]])
    assert names(memory, 10.1) == {s.id for s in FAR[:9]} | {"person"}
    assert memory.summary(10.1).left_out == 0


@pytest.mark.parametrize(
    "near",
    [
        Obstacle("wall", np.array([0.0, 50.0, 2.0]), np.array([100.0, 1.0, 5.0]), "box"),
        Obstacle("mast", np.array([0.0, 30.0, 30.0]), np.array([0.5, 60.0]), "cylinder"),
        Obstacle(
            "jet",
            np.array([40.0, 0.0, 2.0]),
            np.ones(1),
            velocity=np.array([40.0, 0, 0]),
            stamp=0.0,
        ),
        Obstacle(
            "old", np.array([0.0, 0.0, 2.0]), np.ones(1), velocity=np.array([4.0, 0, 0]), stamp=-3.0
        ),
        Obstacle(
            "plane",
            np.array([30.0, 0.0, 2.0]),
            np.ones(1),
            stamp=0.0,
            path=np.zeros((1, 3)),
            path_dt=3.0,
        ),
        Obstacle("lost", np.array([15.0, 0.0, 2.0]), np.ones(1), stamp=-9.0, growth=1.0),
    ],
)
def test_none_counts_as_farther_than_it_is(near):
    ball = Obstacle("ball", np.array([0.0, 14.0, 2.0]), np.ones(1))
    assert nearest([ball, near], 1, HERE, 0.0) == [1]
    small = Obstacle(near.id, near.position + (0.0, 90.0, 0.0), near.size, near.shape)
    assert nearest([small, ball], 1, HERE, 0.0) == [1], "the twin that is farther off"
