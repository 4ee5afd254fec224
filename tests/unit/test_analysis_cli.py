# SPDX-License-Identifier: MIT
"""The command as a user runs it: exit status, one line per complaint, and the files it writes."""

import csv
import io
import json
import os
import subprocess
import sys
from collections import namedtuple
from contextlib import redirect_stderr, redirect_stdout

import pytest
from analysis_bags import REPOSITORY, BagBuilder, Flight

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.cli import main
from nmpc_control.analysis.metrics import flight_metrics

PROGRAM = REPOSITORY / "src/nmpc_control/scripts/flight_metrics"
KEYS = {
    "scenario",
    "average_deviation_m",
    "maximum_deviation_m",
    "average_path_deviation_m",
    "solver_iterations_mean",
    "solve_time_ms",
    "thrust_percent",
    "navigation_time_s",
    "total_time_s",
    "clearance_m",
    "command_gap_ms_max",
    "arrived",
    "collisions",
}


Result = namedtuple("Result", "returncode stdout stderr")


def run(*arguments):
    """Run the command in this process: an exception that escapes it fails the test."""
    stdout, stderr, status = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(stdout), redirect_stderr(stderr):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code
    return Result(status, stdout.getvalue(), stderr.getvalue())


def run_program(*arguments):
    environment = dict(os.environ, PYTHONPATH=str(REPOSITORY / "src/nmpc_control/src"))
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.fixture(scope="module")
def flight():
    return Flight().build()


@pytest.fixture(scope="module")
def bag(flight, tmp_path_factory):
    return flight.write(tmp_path_factory.mktemp("bags") / "line.bag")


def test_prints_tables_and_writes_json_and_csv(bag, tmp_path):
    result = run_program(bag, "--json", tmp_path / "line.json", "--csv", tmp_path / "line.csv")
    assert (result.returncode, result.stderr) == (0, "")
    for words in ("table 1", "table 2", "table 3", "Average deviation [m]", "hull to ball"):
        assert words in result.stdout
    metrics = json.loads((tmp_path / "line.json").read_text())
    assert set(metrics) >= KEYS
    assert metrics == flight_metrics(read_flight(bag))
    with (tmp_path / "line.csv").open() as stream:
        (row,) = csv.DictReader(stream)
    assert float(row["average_deviation_m"]) == metrics["average_deviation_m"]


def damaged(path, content):
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.bag", b""),
        ("text.bag", b"scenario: hexagon\n"),
        ("binary.bag", bytes(range(256)) * 40),
        ("magic.bag", b"#ROSBAG V2.0\n"),
        ("old.bag", b"#ROSBAG V1.2\n" + b"\0" * 5000),
        ("header.bag", b"#ROSBAG V2.0\n\xff\xff\xff\xff" + b"\xff" * 5000),
    ],
)
def test_what_is_no_bag_is_one_line(name, content, tmp_path):
    bag = damaged(tmp_path / name, content)
    complains(run(bag, "--json", tmp_path / "out.json"), bag)
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize("seed", range(4))
def test_bag_with_damaged_bytes_gives_no_traceback(bag, seed, tmp_path):
    content = bytearray(bag.read_bytes())
    for k in range(40):
        content[(seed * 7919 + k * 104729) % len(content)] ^= 0xFF
    result = run(damaged(tmp_path / "damaged.bag", bytes(content)), "--quiet")
    assert result.returncode in (0, 2)
    assert len(result.stderr.splitlines()) == (1 if result.returncode else 0)


def test_missing_file_directory_and_bag_without_messages(tmp_path):
    for path in (tmp_path / "none.bag", tmp_path, BagBuilder().write(tmp_path / "void.bag")):
        complains(run(path), path)
    complains(run_program(tmp_path / "none.bag"), tmp_path / "none.bag")


def test_bag_without_a_usable_topic_says_what_is_expected(tmp_path):
    builder = BagBuilder()
    builder.add("chatter", "std_msgs/msg/String", 1.0, {"data": "hello"})
    path = builder.write(tmp_path / "chatter.bag")
    result = run(path)
    complains(result, path)
    assert "nmpc/odometry" in result.stderr


def complains(result, path):
    assert result.returncode == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"flight_metrics: {path}: ")


def test_good_bags_are_reported_beside_a_bad_one(bag, tmp_path):
    bad = damaged(tmp_path / "bad.bag", b"")
    result = run(bad, bag, "--json", tmp_path / "all.json", "--csv", tmp_path / "all.csv")
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert "line.bag" in result.stdout
    assert [m["bag"] for m in json.loads((tmp_path / "all.json").read_text())] == ["line.bag"]


def test_bags_of_the_same_name_keep_their_reports_apart(flight, tmp_path):
    commands = flight.without("odometry", "ground_truth", "trajectory", "plan")
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
        commands.write(tmp_path / folder / "f.bag")
    result = run(tmp_path / "before/f.bag", tmp_path / "after/f.bag", "--report", tmp_path / "out")
    assert result.returncode == 0
    pages = {path.name for path in (tmp_path / "out").glob("*.html")}
    assert pages == {"before_f.html", "after_f.html"}


def test_file_that_cannot_be_written_is_one_line(bag, tmp_path):
    result = run(bag, "--quiet", "--json", tmp_path / "none" / "line.json")
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert "line.json: cannot be written" in line


@pytest.mark.parametrize(
    "arguments", [(), ("--flight", "0"), ("--vehicle-radius", "nan"), ("--vehicle-radius", "-1")]
)
def test_wrong_arguments(bag, arguments):
    result = run(*((bag, *arguments) if arguments else ()))
    assert result.returncode == 2
    assert "usage: flight_metrics" in result.stderr


def test_help_explains_itself():
    result = run_program("--help")
    assert result.returncode == 0
    for word in ("BAG", "--json", "--csv", "--report", "--vehicle-radius", "Exit status"):
        assert word in result.stdout


def test_vehicle_radius_of_the_paper(bag, tmp_path):
    run(bag, "--quiet", "--vehicle-radius", "0", "--json", tmp_path / "paper.json")
    metrics = json.loads((tmp_path / "paper.json").read_text())
    assert metrics["clearance_m"]["ball"] == pytest.approx(1.2, abs=1e-9)
