# SPDX-License-Identifier: MIT
"""A small campaign that is really flown: in parallel, interrupted, and without avoidance."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from uav_sim.closed_loop.campaign.runner import fly_number
from uav_sim.closed_loop.campaign.settings import Settings

SRC = Path(__file__).resolve().parents[2] / "src"
PROGRAM = [sys.executable, str(SRC / "uav_sim" / "scripts" / "campaign")]
PATHS = os.pathsep.join(str(SRC / name / "src") for name in ("nmpc_control", "uav_sim"))
CHANGES = ("solver.compiled.rate=10",)  # [Hz] half as many solves: half as long
SETTINGS = Settings("appearing", 5, check=False, changes=CHANGES)


def start(file, *arguments):
    """Start the program in a process group of its own."""
    return subprocess.Popen(
        [*PROGRAM, "--quiet", "--check", "off", "--json", str(file), *arguments],
        env={**os.environ, "PYTHONPATH": PATHS},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def untimed(row):
    """Return what must not depend on the machine."""
    return {k: v for k, v in row.items() if k not in ("solve_time_ms", "solve_times_us", "wall_s")}


def numbers(ledger):
    """Return the numbers of the flights that are finished."""
    lines = ledger.read_text().splitlines()[1:] if ledger.exists() else []
    return {json.loads(line)["index"] for line in lines}


@pytest.mark.long
def test_ctrl_c_keeps_what_is_finished_and_flights_do_not_depend_on_workers(tmp_path):
    file = tmp_path / "c.json"
    ledger = Path(f"{file}l")
    options = ("--suite", "appearing", "--seed", "5", "--set", *CHANGES)
    process = start(file, *options, "--flights", "500", "--workers", "2")
    while process.poll() is None and not numbers(ledger):
        try:
            process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            continue
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "--resume" in errors
    assert errors.count("\n") == 1
    assert 2 <= len(numbers(ledger)) < 50

    process = start(file, *options, "--flights", "2", "--workers", "1", "--resume")
    _, errors = process.communicate(timeout=100)
    assert process.returncode in (0, 1), errors
    rows = json.loads(file.read_text())["rows"]
    assert [row["index"] for row in rows] == [0, 1]
    assert rows[0]["collisions"] == rows[1]["collisions"] == 0
    assert rows[0]["seed"] != rows[1]["seed"]
    again = json.loads(json.dumps(fly_number(SETTINGS, 1)))
    assert untimed(again) == untimed(rows[1])


def test_without_avoidance_it_hits():
    """Twin of all suites: neither controller nor guard knows of the sphere."""
    row = fly_number(dataclasses.replace(SETTINGS, avoidance=False), 1)
    assert row["collisions"] == 1
    assert row["arrived"]
    assert row["clearance_m"] < 0.0
    assert row["outcome"] == "hit sphere0"
