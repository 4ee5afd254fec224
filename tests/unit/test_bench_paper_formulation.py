"""The paper's formulation: its equations by hand, and its published results."""

import casadi as ca
import numpy as np
import pytest

from nmpc_control.scenario import load_scenario
from nmpc_control.state import GRAVITY
from uav_sim.closed_loop.bench import paper_formulation as paper
from uav_sim.closed_loop.bench.paper_flight import PUBLISHED, fly_as_in_the_paper


@pytest.fixture(scope="module")
def euler():
    step = paper.euler_step()
    return lambda x, u: np.asarray(step(x, u)).ravel()


@pytest.fixture(scope="module")
def without_spheres():
    return paper.PaperFormulation(0)


def hover_input():
    return np.array([paper.HOVER, 0.0, 0.0, 0.0])


def solve(formulation, x0, reference, spheres=()):
    spheres = np.array(spheres).reshape(-1, 4)
    return formulation.solve(x0, reference, spheres, paper.hover_guess(x0))


def at(position):
    return np.array([*position, *np.zeros(7)])


def test_hover_is_an_equilibrium_at_the_papers_thrust(euler):
    x = at([1.0, 2.0, 3.0])
    assert euler(x, hover_input()) == pytest.approx(x, abs=1e-12)
    assert paper.HOVER == pytest.approx(37.14, abs=0.01)


def test_one_euler_step_is_longer_than_the_attitude_lags_bear(euler):
    x = np.zeros(10)
    x[3:5] = 0.1
    following = euler(x, hover_input())
    assert following[3] / x[3] == pytest.approx(1 - 0.1 * 6.101 / 0.253)  # -1.41
    assert following[4] / x[4] == pytest.approx(1 - 0.1 * 6.497 / 0.267)  # -1.43


def test_drag_decelerates(euler):
    x = np.zeros(10)
    x[6:9] = [1.0, -2.0, 3.0]
    change = euler(x, hover_input())[6:9] - x[6:9]
    assert change == pytest.approx(-0.1 * np.array([0.1, 0.1, 0.01]) * x[6:9])


def test_full_thrust_climbs(euler):
    u = np.array([60.0, 0.0, 0.0, 0.0])
    climb = 0.1 * (paper.FORCE * 60.0 / paper.MASS - GRAVITY)
    assert euler(np.zeros(10), u)[8] == pytest.approx(climb)


def cost_of(states, inputs, reference, spheres=()):
    spheres = np.array(spheres).reshape(-1, 4)
    problem = paper._transcribe(len(spheres))
    cost = ca.Function("cost", [problem["x"], problem["p"]], [problem["f"]])
    x = np.concatenate([states.ravel(), inputs.ravel()])
    return float(cost(x, np.concatenate([np.zeros(10), reference.ravel(), spheres.ravel()])))


def test_weights_are_multiplied_before_squaring():
    states, inputs = np.zeros((paper.N, 10)), np.tile(hover_input(), (paper.N, 1))
    reference = np.tile([0.5, 0.0, 0.0], (paper.N, 1))
    assert cost_of(states, inputs, reference) == pytest.approx(paper.N * (paper.Q[0] * 0.5) ** 2)
    inputs[:, 0] += 2.0
    more = cost_of(states, inputs, reference) - paper.N * (paper.Q[0] * 0.5) ** 2
    assert more == pytest.approx(paper.N * (0.2 * 2.0) ** 2)


@pytest.mark.parametrize("distance", [0.9, 1.2])
def test_potential_acts_within_half_a_metre_of_the_surface(distance):
    states, inputs = np.zeros((paper.N, 10)), np.tile(hover_input(), (paper.N, 1))
    cost = cost_of(states, inputs, np.zeros((paper.N, 3)), [[distance, 0.0, 0.0, 0.6]])
    expected = 0.5 * 1500.0 * max(0.0, 1 / distance - 1 / 1.1) ** 2
    assert cost == pytest.approx(paper.N * expected)


def test_horizon_ends_in_an_equilibrium_and_obeys_the_model(without_spheres, euler):
    reference = np.linspace([0.0, 0.0, 1.0], [6.0, 0.0, 1.0], paper.N)
    solution = solve(without_spheres, at([0.0, 0.0, 1.0]), reference)
    assert solution.success
    x, u = solution.states, solution.inputs
    for k in range(paper.N - 1):
        assert x[k + 1] == pytest.approx(euler(x[k], u[k]), abs=1e-4)
    assert euler(x[-1], u[-1]) == pytest.approx(x[-1], abs=1e-4)
    assert np.abs(x[-1, 6:9]).max() < 1e-3
    assert np.abs(x[30, 6]) > 0.5, "it must be on its way in between"


def test_inputs_stay_inside_their_bounds(without_spheres):
    far = np.tile([5.0, -5.0, 9.0], (paper.N, 1))
    solution = solve(without_spheres, np.zeros(10), far)
    assert (solution.inputs >= paper.INPUT_MIN - 1e-6).all()
    assert (solution.inputs <= paper.INPUT_MAX + 1e-6).all()
    assert solution.inputs[0, 0] == pytest.approx(60.0, abs=0.1)


def test_warm_start_is_shifted_by_one_stage(without_spheres):
    solution = solve(without_spheres, np.zeros(10), np.tile([1.0, 0.0, 0.0], (paper.N, 1)))
    guess = solution.shifted()
    assert (guess.states[:-1] == solution.states[1:]).all()
    assert (guess.inputs[-1] == solution.inputs[-1]).all()


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_closed_loop_gives_the_published_figures(name):
    figures = fly_as_in_the_paper(load_scenario(name, variant="paper")).figures()
    mean, most, iterations = PUBLISHED[name]
    assert figures["deviation_mean_m"] == pytest.approx(mean, rel=0.08)
    assert figures["deviation_max_m"] == pytest.approx(most, rel=0.05)
    assert figures["iterations_mean"] == pytest.approx(iterations, rel=0.10)
    assert figures["failed"] == 0
