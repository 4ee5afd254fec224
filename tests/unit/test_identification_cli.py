# SPDX-License-Identifier: MIT
"""The command as a user runs it: keys, files, one line per complaint."""

import io
import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest
from analysis_bags import REPOSITORY, BagBuilder, Flight, header
from identification_flights import START, excite, fly

from nmpc_control.analysis.identification.cli import main
from nmpc_control.config import from_dict, load_yaml
from nmpc_control.params import Vehicle

PROGRAM = REPOSITORY / "src/nmpc_control/scripts/identify"
DURATION = 14.0
RESPONSE = {"gain", "omega", "zeta", "dead_time_s", "fit_percent", "confidence"}


def run(*arguments):
    """Run the command in this process: an exception that escapes it fails the test."""
    stdout, stderr, status = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(stdout), redirect_stderr(stderr):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = end.code
    return status, stdout.getvalue(), stderr.getvalue()


def complains(result, *words):
    status, stdout, stderr = result
    assert (status, stdout) == (2, "")
    (line,) = stderr.splitlines()
    assert line.startswith("identify: ")
    for word in words:
        assert str(word) in line


@pytest.fixture(scope="module")
def builder():
    return fly("dji_hil", DURATION, excite(DURATION, hover=45.0)).bag()


@pytest.fixture(scope="module")
def bag(builder, tmp_path_factory):
    return builder.write(tmp_path_factory.mktemp("bags") / "flown.bag")


@pytest.fixture(scope="module")
def outcome(bag, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    files = {name: folder / name for name in ("out.json", "own.yaml", "figures")}
    result = run(
        *(bag, "--json", files["out.json"], "--write", files["own.yaml"]),
        *("--figures", files["figures"], "--airframe", "none at all"),
    )
    return result, files


def test_document_has_its_keys(outcome):
    (status, _, _), files = outcome
    assert status == 0
    found = json.loads(files["out.json"].read_text())
    assert found["schema"] == "nmpc_control/identify/1"
    assert found["source"] == "simulation"
    assert {"segments", "tilt_limit_rad", "drag", "yaw_rate", "units"} <= set(found)
    assert {"start", "end", "kind"} <= set(found["segments"][0])
    for axis in ("roll", "pitch"):
        assert set(found["attitude"][axis]) >= RESPONSE
        assert found["attitude"]["first_order"][axis]["time_constant_s"] > 0.0
    assert {"slope", "offset", "dead_time_s", "r2"} <= set(found["thrust"])
    for name in ("omega", "thrust.slope", "drag", "segments"):
        assert name in found["units"]


def test_text_says_the_same(outcome):
    (_, stdout, _), files = outcome
    found = json.loads(files["out.json"].read_text())
    for words in ("source simulation", "tilt limit", "held-back", "roll, first order"):
        assert words in stdout
    assert f"{found['thrust']['slope']:.4g} m/s^2 per %" in stdout


def test_vehicle_file_loads_and_says_where_it_is_from(outcome):
    _, files = outcome
    vehicle = from_dict(Vehicle, load_yaml(files["own.yaml"]), "own.yaml")
    assert vehicle.name == "own"
    assert vehicle.tilt_limit == pytest.approx(0.605, rel=0.03)
    assert vehicle.thrust_map.slope == pytest.approx(0.1732, rel=0.03)
    assert vehicle.thrust_map.measured_on == "uav_sim, none at all"
    # the whole lateness of the response, dead time and lag, is kept
    for lag, late in ((vehicle.roll, 0.085 + 2 * 0.778 / 9.96), (vehicle.yaw_rate, 0.223)):
        assert vehicle.delay + lag.time_constant == pytest.approx(late, abs=0.02)
    assert "not identified" in files["own.yaml"].read_text()


def test_figures_are_drawn(outcome):
    _, files = outcome
    names = {path.name for path in files["figures"].iterdir()}
    expected = ("segments", "attitude", "yaw_rate", "thrust", "drag", "battery")
    assert names == {f"flown_{figure}.{kind}" for figure in expected for kind in ("png", "pdf")}


def test_real_flight_without_words_about_the_airframe_gives_no_usable_map(builder, tmp_path):
    bag = builder.without("ground_truth").write(tmp_path / "real.bag")
    status, _, _ = run(bag, "--quiet", "--write", tmp_path / "real.yaml")
    vehicle = from_dict(Vehicle, load_yaml(tmp_path / "real.yaml"), "real.yaml")
    assert status == 0
    assert vehicle.thrust_map.slope == pytest.approx(0.1732, rel=0.03)
    assert vehicle.thrust_map.measured_on == ""


def test_program_is_the_same_command(tmp_path):
    environment = dict(os.environ, PYTHONPATH=str(REPOSITORY / "src/nmpc_control/src"))
    command = [sys.executable, str(PROGRAM), str(tmp_path / "none.bag")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    complains((done.returncode, done.stdout, done.stderr), "none.bag", "no such file")


@pytest.mark.parametrize("content", [b"", b"scenario: hexagon\n", b"#ROSBAG V2.0\n" + b"\xff" * 99])
def test_what_is_no_bag_is_one_line(content, tmp_path):
    path = tmp_path / "bad.bag"
    path.write_bytes(content)
    complains(run(path, "--json", tmp_path / "out.json"), path)
    assert not (tmp_path / "out.json").exists()


@pytest.mark.parametrize("seed", range(3))
def test_damaged_bytes_and_a_lost_end_give_no_traceback(bag, seed, tmp_path):
    content = bytearray(bag.read_bytes())
    content = content[: len(content) * (seed + 1) // 3]
    for k in range(40):
        content[(seed * 7919 + k * 104729) % len(content)] ^= 0xFF
    path = tmp_path / "damaged.bag"
    path.write_bytes(bytes(content))
    status, _, stderr = run(path, "--quiet", "--json", tmp_path / "out.json")
    assert status in (0, 2)
    assert len(stderr.splitlines()) == (1 if status else 0)


def test_bags_without_commands_attitude_or_time_are_one_line(builder, tmp_path):
    def without(*topics):
        return builder.without(*topics).write(tmp_path / f"{topics[0]}.bag")

    complains(run(without("setpoint_generic")), "no commands", "mav_msgs")
    complains(run(without("imu")), "no attitude")
    short = BagBuilder()
    short.messages = [m for m in builder.messages if m[2] < START + 2.0]
    complains(run(short.write(tmp_path / "short.bag")), "1.9 s", "expected 3")


def test_numbers_that_are_not_finite_are_left_out(builder, tmp_path):
    spoilt = BagBuilder(delay=0.0)
    spoilt.messages = list(builder.messages)
    for k in range(20):
        t = START + 5.0 + 0.01 * k
        spoilt.setpoint(t, np.nan, 0.1, 40.0, 0.0)
        spoilt.setpoint(t, np.inf, 0.1, 40.0, 0.0)
        values = {"header": header(t), "orientation": dict.fromkeys("xyzw", np.nan)}
        spoilt.add("dji_sdk/imu", "sensor_msgs/msg/Imu", t, values)
    path = tmp_path / "out.json"
    status, _, _ = run(spoilt.write(tmp_path / "nan.bag"), "--quiet", "--json", path)
    assert status == 0
    assert json.loads(path.read_text())["attitude"]["roll"]["omega"] == pytest.approx(
        9.96, rel=0.03
    )


def test_flight_that_excites_nothing_gives_reasons_and_no_zeros(tmp_path):
    bag = Flight().build().write(tmp_path / "line.bag")  # constant commands, no attitude
    complains(run(bag), "no attitude")
    hover = fly("dji_hil", 6.0, lambda t: (38.4, 0.0, 0.0, 0.0)).bag()
    path = tmp_path / "out.json"
    bag = hover.write(tmp_path / "hover.bag")
    assert run(bag, "--quiet", "--json", path)[0] == 0
    found = json.loads(path.read_text())
    for part in (found["attitude"]["roll"], found["yaw_rate"], found["thrust"], found["drag"]):
        assert part["reason"]
    assert found["attitude"]["roll"]["gain"] is None
    assert found["thrust"]["slope"] is None
    assert found["tilt_limit_rad"] is None
    status, _, stderr = run(bag, "--quiet", "--write", tmp_path / "own.yaml")
    assert status == 2
    assert len(stderr.splitlines()) == 1
    assert not (tmp_path / "own.yaml").exists()


def test_options_that_make_no_sense_are_one_line(bag, tmp_path):
    complains(run(bag, "--fit", 9, 5), "--fit", "earlier")
    complains(run(bag, "--fit", 8000, 9000), str(bag), "--fit", "expected a part of")
    complains(run(bag, "--fit", 5, 20, "--validate", 8000, 9000), "--validate", "a part of")
    complains(run(bag, "--validate", 5, 9), "--validate", "expected --fit too")
    complains(run(bag, bag), "twice")
    complains(run(bag, tmp_path / "other.bag", "--fit", 1, 9), "one bag")
    complains(run(bag, "--regime", "limited", "--write", tmp_path / "x.yaml"), "--regime limited")
    status, _, stderr = run(bag, "--quiet", "--write", tmp_path / "none" / "x.yaml")
    assert status == 2
    assert "cannot be written" in stderr
    status, _, stderr = run(bag, "--quiet", "--write", tmp_path / "x.yaml", "--vehicle", "nosuch")
    assert status == 2
    assert "nosuch" in stderr


def test_bags_of_different_sources_are_not_one_aircraft(builder, bag, tmp_path):
    other = builder.without("ground_truth").write(tmp_path / "real.bag")
    complains(run(bag, other), "flight, simulation")


def test_names_in_a_bag_cannot_write_into_the_vehicle_file(builder, tmp_path):
    evil = tmp_path / "a\nthrust_map: {slope: 99}\n.bag"
    status, _, _ = run(builder.write(evil), "--quiet", "--write", tmp_path / "own.yaml")
    assert status == 0
    vehicle = from_dict(Vehicle, load_yaml(tmp_path / "own.yaml"), "own.yaml")
    assert vehicle.thrust_map.slope < 1.0
