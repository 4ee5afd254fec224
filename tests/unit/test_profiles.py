# SPDX-License-Identifier: MIT
"""Profiles are laid over the YAML files as strictly as those are read; launch files are tame."""

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from nmpc_control.config import config_directory
from nmpc_control.errors import ConfigError
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.params import load_parameters

SRC = Path(__file__).resolve().parents[2] / "src"
LAUNCH_FILES = sorted(SRC.glob("*/launch/*.launch"))


@pytest.fixture
def own(tmp_path):
    """Return a function that writes a profile into a copy of the configuration."""
    folder = tmp_path / "config"
    shutil.copytree(config_directory(), folder)

    def write(text):
        (folder / "profiles" / "own.yaml").write_text(text)
        return folder

    return write


def test_a_profile_changes_what_it_names_and_nothing_else(own):
    folder = own("controller: {limits: {speed: 2.5}}\nguard: {modes: {battery_start: 0.4}}\n")
    usual, changed = load_parameters(), load_parameters(directory=folder, profile="own")
    assert (usual.limits.speed, changed.limits.speed) == (8.0, 2.5)
    assert np.array_equal(changed.limits.fence_max, usual.limits.fence_max)
    assert changed.avoidance == usual.avoidance
    guard = load_guard_parameters(folder, "own")
    assert guard.modes.battery_start == 0.4
    assert guard.modes.battery_low == load_guard_parameters().modes.battery_low


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("controller: {limits: {sped: 1.0}}\n", "own.yaml: controller.limits.sped"),
        ("controller: {limits: {speed: -1.0}}\n", "limits.speed: got -1.0"),
        ("controller: {limits: {speed: .nan}}\n", "limits.speed: got nan"),
        ("controller: {limits: 3}\n", "own.yaml: controller.limits: got 3"),
        ("controller: 3\n", "own.yaml: controller: got 3"),
        ("vehicle: {mass: 3.0}\n", "own.yaml: vehicle"),
    ],
)
def test_bad_profiles_are_refused_in_words(own, text, words):
    folder = own(text)
    with pytest.raises(ConfigError) as error:
        load_parameters(directory=folder, profile="own")
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["../vehicles/eth", "/tmp/x", "No", "absent"])
def test_a_profile_is_a_name_of_a_file_that_ships(name):
    for load in (load_guard_parameters, load_parameters):
        with pytest.raises(ConfigError):
            load(profile=name)


def test_the_first_flight_is_tamer_everywhere_and_sends_no_thrust():
    usual, first = load_parameters(), load_parameters(profile="first_flight")
    guard, tame = load_guard_parameters(), load_guard_parameters(profile="first_flight")
    assert tame.vertical_command == "velocity"
    assert np.all(first.limits.input_max[1:] < usual.limits.input_max[1:])
    assert np.all(first.limits.input_min[1:] > usual.limits.input_min[1:])
    assert np.all(first.limits.fence_max < usual.limits.fence_max)
    assert np.all(first.limits.fence_min > usual.limits.fence_min)
    assert first.limits.speed <= 1.0
    assert first.flight.approach_speed < usual.flight.approach_speed
    for name in ("tilt", "yaw_rate", "horizontal_velocity", "vertical_velocity"):
        assert getattr(tame.setpoint_limits, name) < getattr(guard.setpoint_limits, name)
    assert tame.modes.battery_start > guard.modes.battery_start
    assert tame.modes.battery_low > guard.modes.battery_low
    # what the brake asks for fits into the tilt that is sent
    assert np.arctan(tame.brake.deceleration / 9.81) < tame.setpoint_limits.tilt


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda p: p.name)
def test_nothing_respawns(path):
    for node in ElementTree.parse(str(path)).iter("node"):
        assert node.get("respawn", "false") == "false", node.get("name")


def test_on_the_aircraft_no_process_ends_another_and_no_simulator_is_assumed():
    folder = SRC / "nmpc_control" / "launch"
    arguments = ElementTree.parse(str(folder / "m100.launch")).iter("arg")
    given = {node.get("name"): node.get("value") for node in arguments if node.get("value")}
    assert given["guard_required"] == "false"
    assert "simulated" not in given
    required = {
        node.get("name"): node.get("required")
        for name in ("m100", "control", "record", "monitor")
        for node in ElementTree.parse(str(folder / f"{name}.launch")).iter("node")
        if node.get("required")
    }
    assert required == {"flight_guard": "$(arg guard_required)"}
