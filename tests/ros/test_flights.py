"""Whole flights through ROS with a user's command, judged by the JSON that it leaves."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional

import numpy as np
import pytest
import yaml
from ros_session import free_port, workspace_environment

from nmpc_control.analysis.bag import read_flight
from nmpc_control.scenario import load_scenario

pytestmark = pytest.mark.ros
_FLIGHT_TIMEOUT = 200.0  # [s] wall time
_GAP, _GAP_ABOVE_BARE = 40.0, 15.0  # [ms]


class Flight(NamedTuple):
    """What one flight left behind."""

    status: int
    output: str
    metrics: Dict[str, Any]
    bag: Path
    bare_gap: Optional[float]  # [ms] longest gap of the bare process


def fly(directory: Path, *arguments: str, bare: bool = False) -> Flight:
    """Fly with ``rosrun uav_sim fly``, with a bare 50 Hz process beside it where asked for."""
    environment = workspace_environment()
    environment.pop("ROS_IP", None)
    port = str(free_port())
    command = ["rosrun", "uav_sim", "fly", *arguments, "--bags", str(directory), "--port", port]
    environment["ROS_MASTER_URI"] = f"http://localhost:{port}"
    flight = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    beside, lines = None, []
    try:
        for line in flight.stdout:
            lines.append(line)
            if bare and beside is None and "in the air" in line:
                beside = _start_bare(environment)
            if beside is not None and "arrived: " in line:
                beside.send_signal(signal.SIGINT)
        status = flight.wait(_FLIGHT_TIMEOUT)
        gap = _gap_of(beside) if status == 0 and beside else None
    finally:
        for process in (flight, beside):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
    output = "".join(lines)
    figures = _only(directory.glob("*.json"), output)
    return Flight(status, output, json.loads(figures.read_text()), figures.with_suffix(".bag"), gap)


def _start_bare(environment: Dict[str, str]) -> subprocess.Popen:
    program = str(Path(__file__).parent / "bare_stream.py")
    environment = {**environment, "ROS_HOSTNAME": "localhost"}
    return subprocess.Popen(
        [sys.executable, program], env=environment, stdout=subprocess.PIPE, text=True
    )


def _gap_of(beside: subprocess.Popen) -> float:
    return float(beside.communicate(timeout=20)[0].split()[-1])


def _only(paths: Any, output: str) -> Path:
    found: List[Path] = list(paths)
    assert len(found) == 1, f"expected one JSON file, found {found}\n{output}"
    return found[0]


def corner_distances(flight: Flight, corners: np.ndarray) -> np.ndarray:
    """Return the least true distance [m] from each corner (n, 3)."""
    record = read_flight(flight.bag)
    position = record.true_position.between(
        record.reference.start, record.phase_end or np.inf
    ).values
    return np.array([np.linalg.norm(position - corner, axis=1).min() for corner in corners])


@pytest.fixture(scope="module")
def hexagon(tmp_path_factory) -> Flight:
    return fly(tmp_path_factory.mktemp("hexagon"), "hexagon", bare=True)


@pytest.fixture(scope="module")
def multi_obstacle(tmp_path_factory) -> Flight:
    return fly(tmp_path_factory.mktemp("multi_obstacle"), "multi_obstacle", bare=True)


@pytest.mark.alone
def test_hexagon_is_flown_on_its_path_and_round_its_corners(hexagon):
    assert hexagon.status == 0, hexagon.output
    metrics = hexagon.metrics
    assert metrics["scenario"] == "hexagon"
    assert metrics["arrived"] is True
    assert metrics["average_deviation_m"] <= 0.10
    assert metrics["average_deviation_truth_m"] <= 0.12
    corners = load_scenario("hexagon").trajectory.sample(np.linspace(0, 1, 7)[1:6] * 24.8).position
    assert np.all(corner_distances(hexagon, corners) <= 0.5)


@pytest.mark.alone
def test_multi_obstacle_arrives_and_keeps_away_from_the_spheres(multi_obstacle):
    assert multi_obstacle.status == 0, multi_obstacle.output
    metrics = multi_obstacle.metrics
    assert metrics["arrived"] is True
    assert metrics["collisions"] == 0
    assert metrics["scenario_time_s"] == pytest.approx(28.57, abs=0.01)
    assert metrics["average_deviation_m"] <= 0.60
    assert set(metrics["clearance_m"]) == {"first", "second", "third"}
    assert min(metrics["clearance_m"].values()) >= 0.4


@pytest.mark.alone
@pytest.mark.parametrize("name", ["hexagon", "multi_obstacle"])
def test_commands_leave_at_a_steady_rate(name, request):
    flight = request.getfixturevalue(name)
    gap = flight.metrics["command_gap_ms_max"]
    assert gap <= _GAP or gap <= flight.bare_gap + _GAP_ABOVE_BARE, (gap, flight.bare_gap)


@pytest.mark.parametrize("name", ["hexagon", "multi_obstacle"])
def test_the_figures_promised_to_users_are_there(name, request):
    metrics = request.getfixturevalue(name).metrics
    for key in ("solver_iterations_mean", "average_path_deviation_m", "maximum_deviation_m"):
        assert metrics[key] >= 0.0
    assert set(metrics["solve_time_ms"]) >= {"mean", "p50", "p99", "max"}
    low, high = metrics["thrust_percent"]
    assert 10.0 <= low < 39.0  # hover is at 38.4 %
    assert 38.0 < high <= 100.0
    assert 0.0 < metrics["navigation_time_s"] < metrics["total_time_s"]


def test_what_everything_was_set_to_is_in_the_bag(hexagon):
    recorded = yaml.safe_load(read_flight(hexagon.bag).parameters)
    assert recorded["parameters"]["nmpc_controller"]["vehicle"] == "dji_hil"
    assert recorded["commit"]


@pytest.mark.alone
@pytest.mark.parametrize(
    "name", [pytest.param("hexagon", marks=pytest.mark.long), "multi_obstacle"]
)
def test_on_the_other_plant_it_is_at_most_half_as_bad_again(name, request, tmp_path):
    flight = fly(tmp_path, name, "--plant", "eth")
    assert flight.status == 0, flight.output
    assert flight.metrics["collisions"] == 0
    allowed = 1.5 * request.getfixturevalue(name).metrics["average_deviation_m"]
    assert flight.metrics["average_deviation_m"] <= allowed


@pytest.mark.long
def test_without_avoidance_it_collides_and_says_so(tmp_path):
    """Twin of multi_obstacle.

    Problem and guard do not know the spheres, so the gate above can fail.
    """
    flight = fly(tmp_path, "multi_obstacle", "--avoidance", "off", "--speed", "1.5")
    assert flight.metrics["collisions"] >= 1
    assert flight.status == 1


@pytest.mark.long
def test_an_own_scenario_file_is_flown_by_its_path(tmp_path):
    scenario = tmp_path / "mine.yaml"
    scenario.write_text(
        "speed: 1.0\nreference: {type: waypoints, points: [[0, 0, 2], [3, 0, 2]]}\n"
        "obstacles:\n"
        "- {id: pole, shape: cylinder, position: [1.5, 1.7, 2], radius: 0.3, height: 4}\n"
    )
    flight = fly(tmp_path, str(scenario), "--speed", "1.5")
    assert flight.status == 0, flight.output
    assert flight.metrics["scenario"] == "mine"
    assert flight.metrics["clearance_m"]["pole"] > 0.4


def test_bad_input_starts_nothing(tmp_path):
    command = ["rosrun", "uav_sim", "fly", "nowhere", "--bags", str(tmp_path / "bags")]
    done = subprocess.run(
        command,
        env=workspace_environment(),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "nowhere" in done.stderr
    assert not (tmp_path / "bags").exists()
