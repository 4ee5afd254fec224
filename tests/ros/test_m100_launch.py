# SPDX-License-Identifier: MIT
"""The launch file of a real flight, against the simulator in its place, in a namespace."""

import os
import signal
import subprocess
from xmlrpc.client import ServerProxy

import pytest
import yaml
from ros_session import workspace_environment

from nmpc_control.analysis.bag import read_flight

pytestmark = pytest.mark.ros
NODES = {"flight_guard", "nmpc_controller", "nmpc_settings", "record"}


def listed(environment, *arguments):
    """Return the nodes that a launch file would start."""
    command = ["roslaunch", "--nodes", *arguments]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    return set(done.stdout.split())


def test_the_nodes_of_the_launch_files_do_not_clash():
    try:
        here = {**workspace_environment(), "ROS_HOSTNAME": "localhost"}
    except RuntimeError as error:
        pytest.skip(str(error))
    arguments = ("nmpc_control", "m100.launch", "vehicle:=eth")
    aircraft = listed(here, *arguments)
    assert aircraft == {f"/{name}" for name in NODES}
    below = listed(here, *arguments, "namespace:=/dji1", "markers:=true")
    assert below == {f"/dji1/{name}" for name in NODES | {"nmpc_visualizer"}}
    flown = listed(here, "uav_sim", "fly.launch", "scenario_file:=x", "bag:=x", "rviz:=true")
    attached = listed(here, "nmpc_control", "monitor.launch")
    assert len(attached) == 2
    assert not attached & (aircraft | flown)


@pytest.mark.long
def test_first_flight_from_missing_everything_to_landed(ros):
    """Wall time, as on the aircraft; then the recorder is killed, and the bag is read."""
    bags = ros.directory / "bags"
    ros.launch(
        *("nmpc_control", "m100.launch"),
        vehicle="eth", profile="first_flight", namespace="/dji1", bags=bags,
    )  # fmt: skip
    ros.wait_for_node("/dji1/flight_guard")
    ros.environment["ROS_NAMESPACE"] = "/dji1"
    granted, words = ros.run_json("m100_client.py", "asks", timeout=120)["start"]
    assert not granted
    for missing in ("attitude is missing", "RC is missing", "the battery's state is missing"):
        assert missing in words

    vehicles = "[{name: dji1}]"
    del ros.environment["ROS_NAMESPACE"]
    ros.launch("uav_sim", "simulator.launch", vehicles=vehicles, publish_clock=False)
    ros.wait_for_node("/uav_sim")
    ros.environment["ROS_NAMESPACE"] = "/dji1"
    seen = ros.run_json("m100_client.py", "flies", timeout=240)
    assert seen["refused"][0] is False and "take it away and back" in seen["refused"][1]
    assert "thrust" not in seen["before"], "the profile needs no map"
    assert seen["start"] == [True, "taking off"]
    assert "got 3, expected 1 at most: the launch's" in seen["faster"]
    assert seen["weights"] == "in force: Q_x 6"
    assert "outside of the fence" in seen["outside"]
    assert "speed [m/s]: got" in seen["fast"]
    assert seen["good"] == "command/trajectory: flying to its start, then 8.0 s along it"
    assert seen["land"] == [True, "landing"]
    assert "FLYING" in seen["modes"] and "BRAKING" not in seen["modes"]
    assert set(seen["flags"]) <= {11.0, 73.0}, "0x0B and 0x49: no thrust"

    master = ServerProxy(ros.environment["ROS_MASTER_URI"])
    recorder = ServerProxy(master.lookupNode("/test", "/dji1/record")[2])
    os.kill(recorder.getPid("/test")[2], signal.SIGKILL)
    (bag,) = bags.glob("*.active")
    recorded = yaml.safe_load(read_flight(bag).parameters)
    assert recorded["parameters"]["flight_guard"]["profile"] == "first_flight"
    assert recorded["files"]["profiles/first_flight.yaml"]["guard"]
    assert master.lookupNode("/test", "/dji1/flight_guard")[0] == 1, "the guard lives on"


@pytest.mark.long
def test_thrust_commands_need_a_map_of_this_airframe(ros):
    ros.launch("nmpc_control", "m100.launch", vehicle="eth", record=False)
    ros.wait_for_node("/flight_guard")
    granted, words = ros.run_json("m100_client.py", "asks", timeout=120)["start"]
    assert not granted
    assert "vehicles/eth.yaml: thrust_map.measured_on is a simulator's" in words
    assert "fly with vertical_command: velocity" in words
