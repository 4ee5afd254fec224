"""Softened bounds hold where they can, and the way back is found where they cannot."""

import ctypes
import dataclasses

import numpy as np
import pytest
from problems import SPHERE, random_states, straight_reference, tight

from nmpc_control.errors import ConfigError, ProblemError
from nmpc_control.ipopt import IpoptSolver, slack_kinds, transcribe
from nmpc_control.nmpc import Nmpc
from nmpc_control.ocp import Structure
from nmpc_control.state import hover_input, hover_state
from uav_sim.closed_loop.bench.problem import Recorder

EXCESS = 2e-3  # [m], [m/s]
START = hover_state(np.array([0.0, 0.0, 5.0]))


@pytest.fixture(scope="module", params=["compiled", "ipopt"])
def nmpc(request) -> Nmpc:
    optimiser = tight(request.param)
    if request.param == "compiled":
        optimiser.solver.tolerance = 1e-7
    return optimiser


def solve(nmpc: Nmpc, x0=START, obstacles=(), avoidance=None, **limits):
    base = nmpc.parameters
    changed = dataclasses.replace(
        base,
        limits=dataclasses.replace(base.limits, **limits),
        avoidance=dataclasses.replace(base.avoidance, **(avoidance or {})),
    )
    nmpc.use(changed)
    nmpc.reset()
    try:
        plan = nmpc.solve(0.0, x0, straight_reference(nmpc), hover_input(), obstacles)
    finally:
        nmpc.use(base)
    assert plan.found
    return plan, nmpc._last


def test_the_speed_is_kept(nmpc):
    free, _ = solve(nmpc)
    bounded, solution = solve(nmpc, speed=1.7)
    assert np.linalg.norm(free.states[:, 6:9], axis=1).max() > 1.9
    assert np.linalg.norm(bounded.states[:, 6:9], axis=1).max() <= 1.7 + EXCESS
    assert solution.softened == ""


def test_the_fence_is_kept(nmpc):
    fence = np.array([6.0, 1000.0, 1000.0])
    bounded, solution = solve(nmpc, fence_max=fence)
    assert bounded.states[:, 0].max() <= 6.0 + EXCESS
    assert bounded.states[-1, 0] == pytest.approx(6.0, abs=0.05)
    assert solution.softened == ""
    assert solution.violation <= EXCESS


def test_the_height_band_is_kept(nmpc):
    x0 = START.copy()
    x0[8] = 1.5  # climbing
    free, _ = solve(nmpc, x0)
    bounded, _ = solve(nmpc, x0, fence_max=np.array([1000.0, 1000.0, 5.25]))
    assert free.states[:, 2].max() > 5.3
    assert bounded.states[:, 2].max() <= 5.25 + EXCESS


def test_the_input_rate_is_kept_from_the_input_before(nmpc):
    rate = np.array([5.0, 0.6, 0.6, 0.6])
    free, _ = solve(nmpc)
    bounded, _ = solve(nmpc, input_rate=rate)
    step = rate * nmpc.structure.dt

    def changes(plan):
        return np.abs(np.diff(np.vstack([hover_input(), plan.inputs]), axis=0))

    assert np.any(changes(free) > 1.5 * step)
    assert np.all(changes(bounded) <= step + 1e-6)


def test_eq_7_is_kept_as_an_inequality(nmpc):
    plan, solution = solve(nmpc, obstacles=(SPHERE,), avoidance={"term": "hard"})
    least = nmpc.parameters.vehicle.radius + nmpc.parameters.avoidance.safety_distance
    assert SPHERE.distance(plan.states[:, :3]).min() >= least - EXCESS
    assert solution.softened == ""


def test_outside_the_fence_the_way_back_is_found_and_reported(nmpc):
    x0 = hover_state(np.array([0.0, 1.0, 5.0]))
    plan, solution = solve(nmpc, x0, fence_max=np.array([1000.0, 0.5, 1000.0]))
    excess = plan.states[:, 1] - 0.5
    assert solution.softened == "fence"
    assert solution.violation == pytest.approx(0.5, abs=0.02)
    inside = int(np.argmax(excess <= 0.0))
    assert 0 < inside < 15
    assert np.all(np.diff(excess[:inside]) <= 0.0), "it never goes farther out"
    assert excess[inside:].max() <= EXCESS


def test_inside_the_margin_the_way_out_is_found_and_reported(nmpc):
    x0 = hover_state(SPHERE.position + [0.0, -(0.6 + 0.8), 0.0])
    plan, solution = solve(nmpc, x0, (SPHERE,), avoidance={"term": "hard"})
    clearance = SPHERE.distance(plan.states[:, :3])
    assert solution.softened == "obstacle"
    assert clearance[-1] >= 1.0 - EXCESS
    assert clearance.min() >= clearance[0] - 0.02


@pytest.mark.parametrize(
    "limits",
    [
        {"speed": 0.0},
        {"fence_min": np.array([2000.0, 0.0, 0.0])},
        {"input_rate": np.array([-1.0, 1.0, 1.0, 1.0])},
        {"soft_weight": -1.0},
        {"fence_max": np.array([np.nan, 1.0, 1.0])},
    ],
    ids=["no speed", "fence crossed", "negative rate", "negative weight", "NaN"],
)
def test_bounds_that_cannot_be_meant_are_refused(nmpc, limits):
    base = nmpc.parameters
    with pytest.raises(ProblemError):
        nmpc.use(dataclasses.replace(base, limits=dataclasses.replace(base.limits, **limits)))
    assert nmpc.parameters is base


def test_the_barrier_is_the_same_problem_to_both_backends():
    """Random states, one inside the margin: IPOPT finds nothing cheaper near our solution."""
    ours = tight("compiled", "barrier")
    ours.solver.tolerance = 1e-7
    ours.solver = recorder = Recorder(ours.solver)
    theirs = IpoptSolver(ours.structure, 1e-7, 500, 30.0)
    felt = inside = 0
    for x0 in random_states(8, seed=21) + [hover_state(SPHERE.position + [0.0, -1.4, 0.0])]:
        plan, solution = solve(ours, x0, (SPHERE,))
        again = theirs.solve(recorder.instances[-1], solution.guess)
        assert again.found
        assert again.cost == pytest.approx(plan.cost, rel=1e-3)
        felt += SPHERE.distance(plan.states[:, :3]).min() < 1.25
        inside += solution.softened == "obstacle"
    assert felt >= 4, "the sample must hold problems in which the sphere is felt"
    assert inside >= 1


@pytest.mark.parametrize("weight", [-1.0, 0.0, np.nan, np.inf])
def test_a_weight_of_eq_7_that_protects_nothing_is_refused(nmpc, weight):
    base = nmpc.parameters
    avoidance = dataclasses.replace(base.avoidance, term="barrier", weight=weight)
    with pytest.raises(ProblemError, match="weight"):
        nmpc.use(dataclasses.replace(base, avoidance=avoidance))
    assert nmpc.parameters is base


@pytest.mark.parametrize("soft_weight", [1000.0, 50.0, 5.0])
def test_where_a_bound_cannot_hold_both_solve_the_same_l1_problem(soft_weight):
    """The weight of the penalty means what it says, also far outside the fence."""
    x0 = hover_state(np.array([0.0, 3.0, 5.0]))
    solutions = []
    for backend in ("compiled", "ipopt"):
        optimiser = tight(backend)
        optimiser.solver.tolerance = 1e-8
        limits = {"fence_max": np.array([1000.0, 0.5, 1000.0]), "soft_weight": soft_weight}
        solutions.append(solve(optimiser, x0, **limits)[1])
    ours, theirs = solutions
    assert ours.cost == pytest.approx(theirs.cost, rel=2e-3)
    assert ours.states[20, 1] == pytest.approx(theirs.states[20, 1], abs=0.05)


def test_outside_opposite_faces_of_two_axes_the_penalty_is_the_sum_over_both():
    """The faces of an axis share a slack variable in IPOPT; the reported cost is still L1."""
    x0 = hover_state(np.array([0.0, 3.0, 2.0]))
    fence = {
        "fence_min": np.array([-1000.0, -1000.0, 2.5]),
        "fence_max": np.array([1000.0, 1.0, 1000.0]),
        "soft_weight": 40.0,
    }
    optimiser = tight("ipopt")
    plan, solution = solve(optimiser, x0, **fence)
    p = plan.states[:, :3]
    excess = np.maximum(p - fence["fence_max"], 0) + np.maximum(fence["fence_min"] - p, 0)
    assert np.all(excess[0] == pytest.approx([0.0, 2.0, 0.5]))
    assert solution.violation == pytest.approx(2.0, abs=1e-3)
    assert plan.cost > fence["soft_weight"] * excess.sum()
    ours = tight("compiled")
    ours.solver.tolerance = 1e-5
    assert plan.cost == pytest.approx(solve(ours, x0, **fence)[0].cost, rel=2e-3)


def test_ipopt_has_as_few_slacks_as_the_penalty_needs():
    structure = Structure(3, 0.1, "exact_lag", 8)
    for hard, per_stage in ((False, 4), (True, 12)):
        assert len(slack_kinds(structure, hard)) == per_stage
        unknowns = transcribe(structure, hard)["x"].numel()
        assert unknowns == 4 * 10 + 3 * 4 + 4 * per_stage


def test_a_linear_solver_that_is_not_installed_is_named():
    structure = Structure(2, 0.1, "exact_lag", 0)
    try:
        ctypes.CDLL("libhsl.so")
    except OSError:
        with pytest.raises(ConfigError, match="solver.linear_solver: got 'ma57'"):
            IpoptSolver(structure, 1e-6, 10, 1.0, linear_solver="ma57")
    else:
        IpoptSolver(structure, 1e-6, 10, 1.0, linear_solver="ma57")
