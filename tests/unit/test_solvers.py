"""Both backends on the same problems.

Against each other, and against what must hold by the problem's statement.
"""

import dataclasses
import time

import numpy as np
import pytest
from problems import SPHERE, parameters, random_states, straight_reference, tight

from nmpc_control import prediction
from nmpc_control.compiled_function import compile_functions
from nmpc_control.errors import ProblemError
from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.ocp import Structure
from nmpc_control.packing import pack_stages
from nmpc_control.state import GRAVITY, hover_input, hover_state
from nmpc_control.sweeps import sweeps


@pytest.fixture(scope="module")
def compiled() -> Nmpc:
    return tight("compiled")


@pytest.fixture(scope="module")
def ipopt() -> Nmpc:
    return tight("ipopt")


def solve(nmpc: Nmpc, x0: np.ndarray, obstacles=(), cold: bool = True):
    if cold:
        nmpc.reset()
    return nmpc.solve(0.0, x0, straight_reference(nmpc), hover_input(), obstacles)


def test_compiled_and_ipopt_find_the_same_optimum_with_active_bounds(compiled, ipopt):
    bounded = 0
    for x0 in random_states(12, seed=3):
        ours, theirs = solve(compiled, x0), solve(ipopt, x0)
        assert ours.cost == pytest.approx(theirs.cost, rel=1e-5)
        span = compiled.parameters.limits.input_max - compiled.parameters.limits.input_min
        assert np.abs(ours.inputs[0] - theirs.inputs[0]) == pytest.approx(
            0.0, abs=1e-3 * span.min()
        )
        bounded += np.any(np.isclose(ours.inputs, compiled.parameters.limits.input_max, atol=1e-9))
    assert bounded >= 3, "the sample must hold problems with active bounds"


def test_compiled_is_not_worse_than_ipopt_beside_an_obstacle(compiled, ipopt):
    ratios = []
    for x0 in random_states(12, seed=4):
        ratios.append(solve(compiled, x0, (SPHERE,)).cost / solve(ipopt, x0, (SPHERE,)).cost)
    # the problem is not convex there: single ones may differ
    assert np.median(ratios) <= 1.0 + 1e-3
    assert np.sum(np.array(ratios) > 1.0 + 1e-3) <= 2


def test_what_flies_says_converged_only_within_its_tolerance(compiled):
    """Random states, tight rates and an obstacle: what is left to gain is what was promised."""
    base = parameters("compiled")
    worse = []
    for rate in (base.limits.input_rate, np.array([5.0, 0.6, 0.6, 0.6])):
        p = dataclasses.replace(base, limits=dataclasses.replace(base.limits, input_rate=rate))
        flies = Nmpc(
            dataclasses.replace(
                p, solver=p.solver.with_budget(max_iterations=200, time_budget=10.0)
            )
        )
        compiled.use(p)
        for x0 in random_states(15, seed=17):
            for obstacles in ((), (SPHERE,)):
                flies.reset()
                plan = flies.solve(0.0, x0, straight_reference(flies), hover_input(), obstacles)
                if plan.status != "converged":
                    continue
                compiled._last, compiled._last_t = flies._last, 0.0
                best = compiled.solve(
                    0.0, x0, straight_reference(flies), hover_input(), obstacles
                ).cost
                worse.append((plan.cost - best) / (1.0 + best))
    compiled.use(parameters("compiled"))
    compiled.reset()
    assert len(worse) > 30
    assert np.max(worse) < 0.01
    assert np.mean(np.array(worse) > flies.solver.tolerance) < 0.1


def test_a_damaged_library_is_compiled_again(monkeypatch, tmp_path):
    monkeypatch.setenv("NMPC_CACHE", str(tmp_path))
    functions = sweeps(Structure(3, 0.1, "exact_lag", 0))
    compile_functions(functions)
    (library,) = tmp_path.glob("*.so")
    library.unlink()
    library.write_bytes(b"")
    again = compile_functions(functions)
    assert all(again[f.name()].class_name() == "External" for f in functions)


@pytest.mark.parametrize("backend", ["compiled", "ipopt"])
def test_plan_satisfies_dynamics_and_bounds(backend):
    nmpc = tight(backend)
    for x0 in random_states(4, seed=5):
        plan = solve(nmpc, x0, (SPHERE,))
        assert plan.states[0] == pytest.approx(x0)
        for k in range(plan.horizon):
            expected = prediction.step(
                plan.states[k], plan.inputs[k], plan.dt, nmpc.parameters.vehicle
            )
            assert plan.states[k + 1] == pytest.approx(expected, abs=3e-3)
        assert np.all(plan.inputs >= nmpc.parameters.limits.input_min - 1e-9)
        assert np.all(plan.inputs <= nmpc.parameters.limits.input_max + 1e-9)


def test_gradient_of_the_backward_sweep_matches_finite_differences():
    """The slope that line search and convergence rest on is the cost's true derivative."""
    nmpc = tight("compiled")
    x0 = random_states(1, seed=6)[0]
    nmpc.solver.max_iterations = 0
    solve(nmpc, x0, (SPHERE,))
    a = nmpc.solver._arrays
    nmpc.solver._backward()
    slope, epsilon = a["summary"][0, 0], 1e-6
    costs = []
    for alpha in (epsilon, 0.0):
        a["alpha"][0, 0] = alpha
        nmpc.solver._forward()
        costs.append(a["cost"].sum())
    assert slope < 0
    assert (costs[0] - costs[1]) / epsilon == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("backend", ["compiled", "ipopt"])
def test_on_the_reference_the_hover_input_is_optimal(backend):
    """At rest on a reference at rest the cost is zero and the plan is hover."""
    nmpc = tight(backend)
    x0 = hover_state(np.array([1.0, 2.0, 3.0]), yaw=0.4)
    plan = nmpc.solve(0.0, x0, np.tile(x0, (61, 1)), hover_input())
    assert plan.inputs == pytest.approx(np.tile(hover_input(), (60, 1)), abs=1e-4)
    assert plan.cost == pytest.approx(0.0, abs=1e-6)


def test_r_delta_counts_the_input_really_applied_before(compiled):
    x0 = hover_state(np.array([0.0, 0.0, 5.0]))
    reference = np.tile(x0, (61, 1))
    compiled.reset()
    strong = np.array([GRAVITY + 3.0, 0.2, 0.0, 0.0])
    after_strong = compiled.solve(0.0, x0, reference, strong).inputs[0]
    assert GRAVITY + 0.05 < after_strong[0] < strong[0]
    assert 0.005 < after_strong[1] < strong[1]


def test_yaw_error_is_wrapped(compiled):
    x0 = hover_state(np.array([0.0, 0.0, 5.0]), yaw=3.0)
    reference = np.tile(hover_state(np.array([0.0, 0.0, 5.0]), yaw=-3.0), (61, 1))
    compiled.reset()
    plan = compiled.solve(0.0, x0, reference, hover_input())
    assert plan.inputs[0, 3] > 0, "the short way from 3 to -3 rad is up through pi"
    assert plan.states[-1, 5] == pytest.approx(2 * np.pi - 3.0, abs=0.02)


def test_terminal_stage_has_its_own_weight(compiled):
    x0 = random_states(1, seed=8)[0]
    light = solve(compiled, x0)
    base = compiled.parameters
    heavy = dataclasses.replace(
        base, weights=dataclasses.replace(base.weights, Q_f=base.weights.Q_f * 1000)
    )
    compiled.use(heavy)
    try:
        end = straight_reference(compiled)[-1, :3]
        assert np.linalg.norm(solve(compiled, x0).states[-1, :3] - end) < np.linalg.norm(
            light.states[-1, :3] - end
        )
    finally:
        compiled.use(base)


def test_obstacle_bends_the_plan_out_of_the_margin_and_without_avoidance_it_does_not(compiled):
    x0 = hover_state(np.array([0.0, 0.0, 5.0]))
    x0[6] = 1.5
    sphere = Obstacle("on the path", np.array([4.5, 0.1, 5.0]), np.array([0.5]))
    assert np.min(sphere.distance(solve(compiled, x0, (sphere,)).states[:, :3])) > 0.9
    base = compiled.parameters
    compiled.use(
        dataclasses.replace(base, avoidance=dataclasses.replace(base.avoidance, enabled=False))
    )
    try:
        assert np.min(sphere.distance(solve(compiled, x0, (sphere,)).states[:, :3])) < 0.0
    finally:
        compiled.use(base)


def test_moving_obstacle_is_predicted(compiled):
    """A sphere that will have left the path when the aircraft arrives does not disturb the plan."""
    x0 = hover_state(np.array([0.0, 0.0, 5.0]))
    x0[6] = 1.5
    standing = Obstacle("s", np.array([4.5, 0.1, 5.0]), np.array([0.5]), stamp=0.0)
    leaving = dataclasses.replace(standing, velocity=np.array([0.0, 3.0, 0.0]))
    free = solve(compiled, x0).cost
    assert solve(compiled, x0, (standing,)).cost > free + 0.1
    assert solve(compiled, x0, (leaving,)).cost == pytest.approx(free, rel=1e-3)


def test_more_obstacles_than_slots_keeps_the_nearest(compiled):
    x0 = hover_state(np.array([0.0, 0.0, 5.0]))
    x0[6] = 1.5
    sphere = Obstacle("near", np.array([4.5, 0.1, 5.0]), np.array([0.5]))
    far = [Obstacle(f"far{i}", np.array([50.0, i, 5.0]), np.array([0.5])) for i in range(50)]
    assert solve(compiled, x0, (*far, sphere)).cost == pytest.approx(
        solve(compiled, x0, (sphere,)).cost, rel=1e-6
    )


def test_warm_start_needs_fewer_iterations_than_a_cold_one(compiled):
    x0 = random_states(1, seed=9)[0]
    cold = solve(compiled, x0)
    warm = solve(compiled, x0, cold=False)
    assert warm.iterations < cold.iterations
    assert warm.cost == pytest.approx(cold.cost, rel=1e-6)


def test_a_target_ten_metres_away_is_reached_from_hover_in_thirty_iterations(compiled):
    rng = np.random.default_rng(14)
    x0 = hover_state(np.array([0.0, 0.0, 15.0]))
    for way in rng.normal(size=(20, 3)) * [1.0, 1.0, 0.3]:
        target = hover_state(x0[:3] + 10.0 * way / np.linalg.norm(way))
        compiled.reset()
        plan = compiled.solve(0.0, x0, np.tile(target, (61, 1)), hover_input())
        assert plan.status == "converged"
        assert plan.iterations <= 30
        assert np.linalg.norm(plan.states[-1, :3] - target[:3]) < 0.5


@pytest.mark.parametrize("seed", [15, 16])
def test_a_guess_far_from_the_state_is_no_worse_than_none(compiled, seed):
    """A jump of the position by metres is solved as from hover, not from where it was."""
    x0, jumped = random_states(2, seed=seed)
    jumped[:3] += [4.0, -3.0, 1.0]
    cold = solve(compiled, jumped).cost
    solve(compiled, x0)
    assert solve(compiled, jumped, cold=False).cost == pytest.approx(cold, rel=1e-4)


def test_useless_guess_falls_back_to_hover(compiled):
    x0 = random_states(1, seed=10)[0]
    reference = solve(compiled, x0).cost
    compiled._last = dataclasses.replace(compiled._last, inputs=np.full((60, 4), np.nan))
    assert solve(compiled, x0, cold=False).cost == pytest.approx(reference, rel=1e-4)


def test_a_state_that_is_not_finite_gives_no_plan_and_the_next_solve_is_clean(compiled):
    x0 = random_states(1, seed=11)[0]
    expected = solve(compiled, x0).cost
    assert not solve(compiled, np.full(10, np.nan)).found
    assert solve(compiled, x0, cold=False).cost == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("backend", ["compiled", "ipopt"])
def test_wall_time_budget_is_kept_and_followed_by_a_clean_solve(backend):
    nmpc = Nmpc(parameters(backend, time_budget=1e-5, max_iterations=500, tolerance=1e-9))
    x0 = random_states(1, seed=12)[0]
    start = time.perf_counter()
    short = solve(nmpc, x0)
    assert time.perf_counter() - start < 0.5
    assert short.status != "converged"


def test_compiled_code_and_interpreter_agree(monkeypatch):
    functions = sweeps(Structure(5, 0.1, "exact_lag", 2))
    compiled_code = compile_functions(functions)
    monkeypatch.setenv("PATH", "")
    interpreted = compile_functions(functions)
    rng = np.random.default_rng(13)
    for f in functions:
        arguments = [rng.uniform(0.5, 1.5, f.size_in(i)) for i in range(f.n_in())]
        ours, theirs = compiled_code[f.name()](*arguments), interpreted[f.name()](*arguments)
        assert interpreted[f.name()] is f, "without a compiler the function itself comes back"
        for a, b in zip(ours, theirs):
            np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-9, atol=1e-9)


def test_compiled_library_is_reused(monkeypatch, tmp_path):
    monkeypatch.setenv("NMPC_CACHE", str(tmp_path))
    functions = sweeps(Structure(3, 0.1, "exact_lag", 0))
    compile_functions(functions)
    (library,) = tmp_path.glob("*.so")
    before = library.stat().st_mtime_ns
    compile_functions(functions)
    assert [p.stat().st_mtime_ns for p in tmp_path.glob("*.so")] == [before]
    compile_functions(sweeps(Structure(4, 0.1, "exact_lag", 0)))
    assert len(list(tmp_path.glob("*.so"))) == 2


@pytest.mark.parametrize(
    "spoil",
    [
        lambda p: dataclasses.replace(p, weights=dataclasses.replace(p.weights, Q=-p.weights.Q)),
        lambda p: dataclasses.replace(
            p, weights=dataclasses.replace(p.weights, R=p.weights.R * np.nan)
        ),
        lambda p: dataclasses.replace(
            p,
            limits=dataclasses.replace(
                p.limits, input_min=p.limits.input_max, input_max=p.limits.input_min
            ),
        ),
    ],
    ids=["negative weight", "NaN weight", "bounds crossed"],
)
def test_unusable_parameters_are_refused_and_the_old_ones_stay(compiled, spoil):
    base, theta = compiled.parameters, compiled._theta.copy()
    with pytest.raises(ProblemError):
        compiled.use(spoil(base))
    assert compiled.parameters is base
    assert np.array_equal(compiled._theta, theta)


def test_wrong_shapes_and_nan_references_are_refused():
    structure = Structure(10, 0.1)
    with pytest.raises(ProblemError):
        pack_stages(structure, np.zeros((10, 10)), hover_input())
    with pytest.raises(ProblemError):
        pack_stages(structure, np.full((11, 10), np.nan), hover_input())
    with pytest.raises(ProblemError):
        Structure(0, 0.1)
