# SPDX-License-Identifier: MIT
"""A small campaign that is really flown: in parallel, interrupted, and without avoidance."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

SRC = Path(__file__).resolve().parents[2] / "src"
PROGRAM = [sys.executable, str(SRC / "uav_sim" / "scripts" / "campaign")]
PATHS = os.pathsep.join(str(SRC / name / "src") for name in ("nmpc_control", "uav_sim"))


def start(file, *arguments):
    """Start the program in a process group of its own."""
    return subprocess.Popen(
        [*PROGRAM, "--quiet", "--check", "off", "--json", str(file), *arguments],
        env={**os.environ, "PYTHONPATH": PATHS},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def rows_of(file):
    return json.loads(file.read_text())["rows"]


def untimed(row):
    """Return what must not depend on the machine."""
    return {k: v for k, v in row.items() if k not in ("solve_time_ms", "wall_s")}


def test_flights_are_the_same_whatever_workers_and_number(tmp_path):
    both, second = tmp_path / "both.json", tmp_path / "second.json"
    options = ("--suite", "appearing", "--seed", "5")
    many = start(both, *options, "--flights", "2", "--workers", "2")
    one = start(second, *options, "--flights", "1", "--first", "1", "--workers", "1")
    for process in (many, one):
        _, errors = process.communicate(timeout=200)
        assert process.returncode in (0, 1), errors
    first_row, second_row = rows_of(both)
    assert first_row["collisions"] == second_row["collisions"] == 0
    assert untimed(rows_of(second)[0]) == untimed(second_row)
    assert first_row["seed"] != second_row["seed"]


def test_without_avoidance_it_hits_and_the_program_says_so(tmp_path):
    """Twin of all suites: neither controller nor guard knows of the sphere."""
    file = tmp_path / "off.json"
    process = start(
        file, "--suite", "appearing", "--flights", "1", "--workers", "1", "--avoidance", "off"
    )
    process.communicate(timeout=200)
    assert process.returncode == 1
    (row,) = rows_of(file)
    assert row["collisions"] == 1
    assert row["arrived"]
    assert row["clearance_m"] < 0.0


def test_ctrl_c_keeps_what_is_finished(tmp_path):
    file = tmp_path / "long.json"
    process = start(file, "--suite", "appearing", "--flights", "500", "--workers", "2")
    ledger = Path(f"{file}l")
    while process.poll() is None and (
        not ledger.exists() or len(ledger.read_text().splitlines()) < 2
    ):
        try:
            process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            continue
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "--resume" in errors
    assert errors.count("\n") == 1
    assert 2 <= len(ledger.read_text().splitlines()) < 50
