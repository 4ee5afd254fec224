"""Flights in wind, with errors of the sensors, and among obstacles that move."""

import json
from pathlib import Path

import numpy as np
import pytest

from nmpc_control.config import load_yaml
from nmpc_control.params import load_parameters
from nmpc_control.scenario import load_scenario
from uav_sim.closed_loop.loop import fly
from uav_sim.closed_loop.simulate import main, new_loop
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.world import World

MOVING = """
name: moving
duration: 6.0
reference: {type: line, start: [0.0, 0.0, 5.0], end: [4.0, 0.0, 5.0]}
weights: outdoor
obstacles:
  - {id: stands, position: [2.0, 6.0, 5.0], radius: 0.5}
  - {id: passes, position: [2.0, 4.0, 5.0], radius: 0.4, velocity: [0.0, -0.8, 0.0],
     motion: {type: line, distance: 8.0, end: bounce}}
  - {id: pops_up, position: [6.5, 0.0, 5.0], radius: 0.4, appear: {within: 4.0}}
"""


def run(tmp_path, *arguments):
    """Fly with the command-line tool; returns exit status and metrics."""
    file = tmp_path / "metrics.json"
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--quiet", "--json", str(file)])
    return end.value.code, json.loads(file.read_text())


@pytest.mark.parametrize("level", ["indoor", "outdoor"])
def test_a_disturbed_flight_arrives(tmp_path, level):
    status, metrics = run(tmp_path, "step_z", "--disturbance", level, "--seed", "3")
    assert status == 0
    assert (metrics["disturbance"], metrics["seed"]) == (level, 3)
    assert 0.01 < metrics["average_deviation_truth_m"] < 1.5


def test_same_seed_same_flight():
    def flight(seed):
        scenario = load_scenario("hover")
        disturbance = Disturbance(load_disturbance("outdoor"), seed)
        parameters = load_parameters("dji_hil", scenario.weights)
        loop = new_loop(scenario, parameters, "dji_hil", disturbance=disturbance)
        loop.aircraft.place(scenario.initial_position)
        for _ in range(400):
            loop.step()
        return [truth.position for truth in loop.log.truths]

    assert flight(1) == flight(1)
    assert flight(1) != flight(2)


def test_what_moves_is_sensed_where_it_is(tmp_path: Path):
    path = tmp_path / "moving.yaml"
    path.write_text(MOVING)
    status, metrics = run(tmp_path, str(path))
    assert metrics["collisions"] == 0 and status == 0
    assert set(metrics["clearance_truth_m"]) == {"stands", "passes", "pops_up"}
    assert metrics["clearance_m"] == pytest.approx(metrics["clearance_truth_m"], abs=0.05)

    scenario = load_scenario(str(path))
    assert [o.id for o in scenario.obstacles] == ["stands", "passes"]
    world = World.from_list(load_yaml(path)["obstacles"], 0.5)
    loop = new_loop(scenario, load_parameters("dji_hil", "outdoor"), "dji_hil", world)
    fly(scenario, loop)
    last = loop.log.obstacles[-1]
    known = {o.id: o for o in loop.controller.obstacles}
    assert set(known) == {"stands", "passes", "pops_up"}
    for obstacle, position, velocity in last[1]:
        assert np.array_equal(known[obstacle.id].position, position)
        assert np.array_equal(known[obstacle.id].velocity, velocity)
        assert known[obstacle.id].stamp == last[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--disturbance", "stormy"], "level: got 'stormy', expected"),
        (["--seed", "-1"], "expected a whole number"),
        (["--seed", "one"], "invalid"),
    ],
)
def test_wrong_options_end_in_one_line(capsys, arguments, words):
    with pytest.raises(SystemExit) as end:
        main(["hover", *arguments])
    assert end.value.code == 2
    assert words in capsys.readouterr().err
