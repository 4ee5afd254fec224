"""Problems of the bench: recorded, after jumps, random; scenes; the yardstick."""

from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.ocp import NU, NX, PARTS, SLOT_SIZE
from nmpc_control.scenario import load_scenario
from uav_sim.closed_loop.bench.objective import Objective
from uav_sim.closed_loop.bench.paper_backend import PaperBackend
from uav_sim.closed_loop.bench.parameters import bench_parameters
from uav_sim.closed_loop.bench.problem import Problem, Recorder
from uav_sim.closed_loop.bench.problems import KINDS, in_reach, recorded_problems
from uav_sim.closed_loop.bench.random_problems import random_problems
from uav_sim.closed_loop.bench.recording import exact_solver, record, structure_of
from uav_sim.closed_loop.bench.scenes import scatter

COUNT = 3


@pytest.fixture(scope="module")
def recorded():
    return recorded_problems(COUNT, seed=1, until=0.2)


@pytest.fixture(scope="module")
def drawn():
    return random_problems(seed=1, count=6)


@pytest.fixture(scope="module")
def solver(recorded):
    return exact_solver(recorded["hexagon"][0].structure, tolerance=1e-9)


def test_every_kind_is_recorded(recorded):
    assert tuple(recorded) == KINDS
    assert all(len(problems) == COUNT for problems in recorded.values())


def test_warm_problems_keep_the_guess_of_the_flight(recorded):
    for kind in KINDS[:-1]:
        for problem in recorded[kind]:
            assert problem.guess.states[0, :3] == pytest.approx(problem.instance.x0[:3], abs=0.6)
            moved = np.linalg.norm(problem.instance.x0[:3] - problem.earlier.x0[:3])
            assert moved < 0.6, "one stage earlier on the same flight, at 6 m/s at most"


def test_cold_starts_lie_five_metres_off_and_have_no_guess(recorded):
    warm = np.array([p.instance.x0 for p in recorded["hexagon"] + recorded["multi_obstacle"]])
    for problem in recorded["cold_start"]:
        distances = np.linalg.norm(warm[:, :3] - problem.instance.x0[:3], axis=1)
        assert distances == pytest.approx(5.0) or np.any(np.isclose(distances, 5.0))
        assert problem.guess is None
        assert problem.instance.x0[2] > 0.5


def test_a_push_changes_the_velocity_by_three_metres_per_second():
    scenario = load_scenario("go_to_point")
    parameters = bench_parameters(scenario.weights)
    solver = exact_solver(structure_of(parameters))
    flight = record(scenario, parameters, solver, pushes_seed=3, until=0.3)
    assert len(flight.pushes) == 1
    speeds = [np.linalg.norm(i.x0[6:9]) for i in flight.recorder.instances]
    first = flight.pushes[0]
    assert max(speeds[:first]) < 1.0
    assert max(speeds[first : first + 10]) == pytest.approx(3.0, abs=0.5)


def test_reach_is_the_distance_at_which_the_potential_begins(recorded):
    problem = recorded["hexagon"][0]
    stages = problem.instance.stages.copy()
    stages[NX + NU : NX + NU + SLOT_SIZE] = np.array([1.0, 2.0, 3.0, 1.0, 1 / 1.7])[:, None]
    theta = problem.instance.theta.copy()
    theta[PARTS["cushion"]] = 0.1
    problem = replace(problem, instance=replace(problem.instance, stages=stages, theta=theta))
    assert in_reach(problem, np.array([[1.0, 2.0, 4.75]]))
    assert not in_reach(problem, np.array([[1.0, 2.0, 4.85]]))


def test_random_problems_are_the_same_for_the_same_seed(drawn):
    again = random_problems(seed=1, count=6)
    assert all((a.instance.stages == b.instance.stages).all() for a, b in zip(drawn, again))
    assert all((a.instance.x0 == b.instance.x0).all() for a, b in zip(drawn, again))
    other = random_problems(seed=2, count=1)
    assert (other[0].instance.x0 != drawn[0].instance.x0).any()


def test_every_second_random_problem_is_warm_started(drawn):
    assert [p.guess is not None for p in drawn] == [False, True] * 3


def test_random_states_touch_no_obstacle(drawn):
    parameters = bench_parameters()
    reach = parameters.avoidance.safety_distance
    for problem in drawn:
        slots = problem.instance.stages[NX + NU :, 0].reshape(-1, SLOT_SIZE)
        slots = slots[slots[:, 4] < 1e5]
        distance = np.linalg.norm(slots[:, :3] - problem.instance.x0[:3], axis=1)
        assert (distance > 1 / slots[:, 4] - reach).all()


def test_scattered_spheres_leave_the_path_free():
    scenario = scatter(load_scenario("multi_obstacle"), 32, seed=5, gap=0.6)
    path = scenario.trajectory.sample(np.linspace(0, scenario.trajectory.duration, 500)).position
    assert len(scenario.obstacles) == 32
    # 1 cm: the scatter looked at other samples of the path
    assert all(np.min(o.distance(path)) > 0.59 for o in scenario.obstacles)


def test_recorder_passes_on_and_notes_down(recorded, solver):
    problem = recorded["hexagon"][0]
    recorder = Recorder(solver)
    solution = recorder.solve(problem.instance, problem.guess)
    assert recorder.solutions == [solution]
    noted = recorder.problems("again", stride=1, indices=[0])[0]
    assert noted == Problem("again", problem.structure, problem.instance, problem.guess)


def test_objective_is_the_cost_that_the_solver_reports(recorded, drawn, solver):
    objective = Objective(solver.structure)
    for problem in [*recorded["multi_obstacle"], *drawn]:
        solution = solver.solve(problem.instance, problem.guess)
        cost, states = objective(problem.instance, solution.inputs)
        assert cost == pytest.approx(solution.cost, rel=1e-9)
        assert states == pytest.approx(solution.states, abs=1e-9)


def test_defect_is_what_a_plan_violates(recorded, solver):
    problem = recorded["hexagon"][0]
    solution = solver.solve(problem.instance, problem.guess)
    objective = Objective(solver.structure)
    assert objective.defect(problem.instance, solution.states, solution.inputs) < 1e-9
    states = solution.states.copy()
    states[-1, 0] += 0.01
    defect = objective.defect(problem.instance, states, solution.inputs)
    assert defect == pytest.approx(0.01)


def test_paper_backend_sees_the_same_spheres(recorded):
    scenario = load_scenario("multi_obstacle")
    parameters = bench_parameters(scenario.weights)
    problem = recorded["multi_obstacle"][0]
    assert structure_of(parameters) == problem.structure
    spheres = PaperBackend(parameters)._spheres(problem.instance)
    expected = {(*o.position, o.size[0]) for o in scenario.obstacles}
    assert {tuple(np.round(sphere, 9)) for sphere in spheres} == expected
