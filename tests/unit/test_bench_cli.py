"""The bench as a program: what it writes, what it refuses."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.model import INTEGRATORS, reference_step, step_function
from nmpc_control.params import load_vehicle
from uav_sim.closed_loop.bench import cli, node_memory
from uav_sim.closed_loop.bench.agreement import Comparison, summary
from uav_sim.closed_loop.bench.effort import QUICK
from uav_sim.closed_loop.bench.integrators import errors
from uav_sim.closed_loop.bench.native import native_time, traced_calls
from uav_sim.closed_loop.bench.objective import relative_gap
from uav_sim.closed_loop.bench.random_problems import random_problems
from uav_sim.closed_loop.bench.recording import exact_solver

ROW = {
    *("problem", "backend", "p50_ms", "p95_ms", "p99_ms", "max_ms"),
    *("iterations_mean", "cost_gap", "residual"),
}


@pytest.fixture
def tiny(monkeypatch):
    # N = 60 with 8 slots is compiled anyway: it is what the bench solves
    effort = replace(QUICK, problems=1, repeats=1, until=0.1, horizons=(20, 60), slots=(0, 4, 8))
    monkeypatch.setattr(cli, "QUICK", effort)


def test_json_has_the_keys_that_others_read(tiny, tmp_path, capsys):
    cli.main(["--quick", "--quiet", "--out", str(tmp_path), "--only", "backends", "scaling"])
    data = json.loads((tmp_path / "bench.json").read_text())
    assert {"machine", "versions", "rows", "python_share"} <= set(data)
    assert {row["backend"] for row in data["rows"]} == {"budgeted", "converged", "ipopt", "paper"}
    assert all(set(row) == ROW for row in data["rows"])
    assert data["rows"][-1]["problem"] == "all"
    for key, sizes in (("scaling_n", [20, 60]), ("scaling_obstacles", [0, 4, 8])):
        assert data[key]["size"] == sizes
        assert len(data[key]["p50_ms"]) == len(sizes)
        assert np.isfinite(data[key]["exponent"])
    assert 0.0 < data["python_share"] < 1.0
    assert (tmp_path / "bench_backends.png").stat().st_size > 1000
    assert "budgeted" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "named"),
    [(["--only", "nothing"], "--only"), (["--seed", "-1"], "--seed"), (["--seed", "x"], "--seed")],
)
def test_bad_input_ends_with_status_two(arguments, named, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(arguments)
    assert end.value.code == 2
    assert named in capsys.readouterr().err


def test_folder_that_is_a_file_is_named(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(SystemExit) as end:
        cli.main(["--out", str(file), "--only", "paper"])
    assert end.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_calls_of_compiled_functions_are_traced_and_released():
    problem = random_problems(seed=0, count=1)[0]
    solver = exact_solver(problem.structure)
    with traced_calls() as calls:
        iterations = solver.solve(problem.instance, problem.guess).iterations
    assert len(calls) >= 2 * iterations, "at least one sweep each way for every iteration"
    traced = len(calls)
    solver.solve(problem.instance, problem.guess)
    assert len(calls) == traced
    assert native_time(solver, problem) > 0.0


def test_gap_is_relative_to_the_best_cost():
    assert relative_gap(110.0, 100.0) == pytest.approx(0.1)
    assert relative_gap(2e-6, 1e-6) == pytest.approx(1e-3), "costs near zero are rounding"


def test_integrators_are_told_apart_by_their_errors():
    vehicle, exact = load_vehicle("paper"), reference_step(0.1)
    fine, coarse = (errors(step_function(0.1, i), exact, vehicle, 0.1) for i in INTEGRATORS[::2])
    assert fine[0] < 0.01
    assert fine[1] < 0.001
    assert coarse[0] > 1.0
    assert coarse[1] > 10.0, "an Euler step of 0.1 s is unstable for the paper's lags"
    assert errors(exact, exact, vehicle, 0.1) == (0.0, 0.0)


def test_resident_memory_is_what_a_process_holds():
    program = "held = bytearray(b'x') * int({}); print('', flush=True); input()"
    sizes = []
    for held in (1e6, 41e6):
        process = subprocess.Popen(
            [sys.executable, "-c", program.format(held)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        process.stdout.readline()
        sizes.append(node_memory.resident_memory(process.pid))
        process.communicate(b"\n")
    assert np.diff(sizes) == pytest.approx(40e6 / 2**20, rel=0.1)


def test_without_ros_no_node_is_measured(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert node_memory.measure("dji_hil") == {}


def comparison(gap, input_gap, reached):
    return Comparison("k", 0, 1.0, gap, input_gap, reached, 1, "converged", 3, 0.0, "converged", 9)


def test_summary_counts_worse_ones_and_other_inputs():
    figures = summary(
        [
            comparison(0.0, 0.0, reached=False),
            comparison(2e-4, 0.5, reached=True),
            comparison(-1e-3, 0.5, reached=True),
            comparison(5e-5, 2e-3, reached=False),
        ]
    )
    assert figures["not_worse_percent"] == 75.0
    assert figures["better_percent"] == 25.0
    assert figures["same_input_percent"] == 50.0, "only those without an obstacle in reach count"
    assert figures["without_obstacle"] == 2
