# SPDX-License-Identifier: MIT
"""Nobody outside of this computer can command a simulated flight: what listens where."""

import os
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros
LISTEN = "0A"
LOOPBACK = ("0100007F", "00000000000000000000000001000000")  # as /proc/net writes 127.0.0.1, ::1
ROSCPP = {"rosout"}  # its XML-RPC port is on all addresses whatever is set: doc/network.md


def sockets():
    """Return the inodes of the TCP sockets that listen, and whether on loopback alone."""
    found = {}
    for name in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == LISTEN:
                found[columns[9]] = columns[1].split(":")[0] in LOOPBACK
    return found


def listening(ros):
    """Return {program: set of whether on loopback} of all that knows this test's master."""
    inodes, found = sockets(), {}
    mark = f"ROS_MASTER_URI={ros.environment['ROS_MASTER_URI']}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark not in (process / "environ").read_bytes().split(b"\0"):
                continue
            name = (process / "comm").read_text().strip()
            links = [os.readlink(link) for link in (process / "fd").iterdir()]
        except OSError:
            continue  # it ended meanwhile
        for link in links:
            if link.startswith("socket:[") and link[8:-1] in inodes:
                found.setdefault(name, set()).add(inodes[link[8:-1]])
    return found


def test_simulator_and_tests_listen_on_loopback_alone(ros):
    ros.launch("uav_sim", "simulator.launch")
    ros.wait_for_node("/uav_sim")
    seen = listening(ros)
    assert {"rosmaster", "roslaunch", "simulator"} <= set(seen)
    assert {name for name, where in seen.items() if where != {True}} <= ROSCPP


@pytest.mark.long
@pytest.mark.parametrize("reachable", [False, True], ids=["as it is", "twin"])
def test_a_user_who_set_nothing_has_a_simulator_that_only_this_computer_reaches(ros, reachable):
    for name in ("ROS_HOSTNAME", "ROS_IP"):
        ros.environment.pop(name, None)
    ros.launch("uav_sim", "simulator.launch", reachable=reachable)
    ros.wait_for_node("/uav_sim")
    assert listening(ros)["simulator"] == {not reachable}
