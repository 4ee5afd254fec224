"""Flights without ROS, the paper's table like for like, and a twin that must collide."""

import dataclasses
import json

import numpy as np
import pytest

from nmpc_control.params import load_parameters
from nmpc_control.scenario import list_scenarios, load_scenario
from uav_sim.closed_loop.loop import fly
from uav_sim.closed_loop.simulate import main, new_loop, simulate

PLANTS = ("dji_hil", "eth")
THE_PAPERS = (
    "hover",
    "go_to_point",
    "line_xy",
    "step_z",
    "step_xyz",
    "circle_xy",
    "sinusoidal",
    "rectangle",
    "hexagon",
    "spline",
    "long_spline",
    "one_obstacle",
    "multi_obstacle",
)


def run(tmp_path, *arguments):
    """Fly with the command-line tool; returns exit status and metrics."""
    file = tmp_path / "metrics.json"
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--quiet", "--json", str(file)])
    return end.value.code, json.loads(file.read_text())


def test_all_scenarios_of_the_paper_are_there():
    assert set(THE_PAPERS) <= set(list_scenarios())


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", list_scenarios())
def test_every_scenario_arrives_and_hits_nothing(tmp_path, name, plant):
    status, metrics = run(tmp_path, name, "--plant", plant)
    assert status == 0
    assert metrics["arrived"] is True
    assert metrics["collisions"] == 0
    assert metrics["plans_rejected"] == 0
    assert all(clearance > 0.4 for clearance in metrics["clearance_truth_m"].values())


def test_hexagon_like_for_like_with_the_papers_table(tmp_path):
    """The paper has 0.21 m average; 2.33 m is where the flight begins."""
    status, metrics = run(tmp_path, "hexagon", "--plant", "paper")
    assert status == 0
    assert metrics["vehicle_radius_m"] == 0.0
    assert metrics["scenario_time_s"] == pytest.approx(27.5)
    assert metrics["maximum_deviation_m"] == pytest.approx(2.33, abs=0.01)
    assert metrics["average_deviation_m"] <= 0.12
    assert metrics["average_deviation_after_6s_m"] <= 0.03


def test_multi_obstacle_like_for_like_with_the_papers_table(tmp_path):
    """The paper has 1.01 m average, its code 0.38 m from centre to surface."""
    status, metrics = run(tmp_path, "multi_obstacle", "--plant", "paper")
    assert status == 0
    assert metrics["vehicle_radius_m"] == 0.0
    assert metrics["scenario_time_s"] == pytest.approx(28.57)
    assert metrics["average_deviation_m"] <= 0.40
    assert min(metrics["clearance_truth_m"].values()) >= 0.5


@pytest.mark.parametrize("plant", PLANTS)
def test_without_avoidance_the_aircraft_collides(plant):
    """Twin of multi_obstacle.

    Neither the problem nor the guard knows the spheres, so the gates can fail.
    """
    scenario = load_scenario("multi_obstacle")
    loop = new_loop(scenario, load_parameters(plant, scenario.weights), plant)
    fly(dataclasses.replace(scenario, obstacles=()), loop)
    assert len(loop.aircraft.collisions) >= 2


def test_the_guard_alone_does_not_let_a_blind_plan_hit_a_sphere(tmp_path):
    """Avoidance off in the problem, but the guard knows the spheres.

    It brakes, and nothing is hit.
    """
    _, metrics = run(tmp_path, "multi_obstacle", "--avoidance", "off")
    assert metrics["collisions"] == 0
    assert metrics["plans_rejected"] > 0
    assert not metrics["arrived"]


@pytest.mark.long
def test_both_backends_fly_the_same_way():
    scenario = load_scenario("step_xyz")
    figures = {}
    for backend in ("compiled", "ipopt"):
        parameters = load_parameters("dji_hil", scenario.weights)
        solver = dataclasses.replace(parameters.solver, backend=backend)
        solver = solver.with_budget(tolerance=1e-9, time_budget=1.0, rate=10.0)
        figures[backend] = simulate(
            scenario, dataclasses.replace(parameters, solver=solver), "dji_hil"
        )
    assert figures["ipopt"]["arrived"]
    assert figures["compiled"]["average_deviation_m"] == pytest.approx(
        figures["ipopt"]["average_deviation_m"], abs=0.005
    )


def test_the_guard_flies_plans_of_the_papers_integrator():
    """With the paper's lags Euler steps depart from the guard's model far beyond its tolerances."""
    scenario = load_scenario("step_xyz")
    parameters = load_parameters("paper", scenario.weights)
    solver = dataclasses.replace(parameters.solver, integrator="euler")
    metrics = simulate(scenario, dataclasses.replace(parameters, solver=solver), "paper")
    assert metrics["arrived"]
    assert metrics["plans_rejected"] == 0


def test_two_flights_are_the_same():
    scenario = load_scenario("step_z")
    parameters = load_parameters("dji_hil", scenario.weights)
    patient = parameters.solver.with_budget(time_budget=10.0)  # wall time would tell them apart
    parameters = dataclasses.replace(parameters, solver=patient)
    first, second = (simulate(scenario, parameters, "dji_hil") for _ in range(2))
    assert first["average_deviation_truth_m"] == second["average_deviation_truth_m"]
    assert first["thrust_percent"] == second["thrust_percent"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "nowhere"),
        (["hexagon", "--variant", "none"], "none"),
        (["hexagon", "--weights", "heavy"], "heavy"),
        (["missing.yaml"], "missing.yaml"),
    ],
    ids=["scenario", "variant", "weights", "file"],
)
def test_bad_input_ends_in_one_line_and_status_two(capsys, arguments, words):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert "Traceback" not in error


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("reference: {type: hold}\n", "duration"),
        ("speed: .nan\nreference: {type: waypoints, points: [[0,0,2],[1,0,2]]}\n", "speed"),
        ("speed: 1.0\nreference: {type: waypoints, points: [[0,0,2]]}\n", "points"),
        (
            "speed: 1.0\nspede: 2\nreference: {type: waypoints, points: [[0,0,2],[1,0,2]]}\n",
            "spede",
        ),
        (
            "speed: 1.0\nreference: {type: waypoints, points: [[0,0,2],[1,0,2]]}\n"
            "obstacles: [{id: a, position: [5,0,2], radius: -1}]\n",
            "radius",
        ),
        (
            "speed: 1.0\nreference: {type: waypoints, points: [[0,0,2],[9,0,2]]}\n"
            "obstacles: [{id: a, position: [0.5,0,2], radius: 0.3}]\n",
            "a",
        ),
        ("speed: 1.0\nreference: [unclosed\n", "line"),
    ],
    ids=[
        "missing key",
        "NaN",
        "one waypoint",
        "unknown key",
        "negative radius",
        "start in obstacle",
        "syntax",
    ],
)
def test_bad_scenario_files_end_in_one_line_and_status_two(tmp_path, capsys, text, words):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(SystemExit) as end:
        main([str(path), "--quiet"])
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert "mine.yaml" in error
    assert words in error
    assert error.count("\n") == 1


def test_clearance_of_log_and_simulator_agree(tmp_path):
    """Two computations of one distance: offline from samples, and in the simulator."""
    _, metrics = run(tmp_path, "one_obstacle")
    for name, clearance in metrics["clearance_m"].items():
        assert clearance == pytest.approx(metrics["clearance_truth_m"][name], abs=0.01)
    assert np.isfinite(list(metrics["clearance_m"].values())).all()
