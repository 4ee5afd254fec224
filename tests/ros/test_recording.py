# SPDX-License-Identifier: MIT
"""A row of bags: bounded, each with what everything was set to, readable after a kill."""

import os
import signal
import sys
import time
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import yaml

from nmpc_control.analysis.bag_file import BagFile

pytestmark = pytest.mark.ros
SIZE, BAGS = 1, 3  # [MB], [1]


def strings(path, topic):
    """Return the texts of a topic of std_msgs/String."""
    with BagFile(path) as bag:
        wanted = {c.id for c in bag.connections if c.topic == topic}
        return [raw[4:].decode() for _, _, raw in bag.messages(wanted)]


def wait(condition, what):
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline, what()
        time.sleep(0.1)


def test_a_killed_recorder_leaves_a_bounded_row_of_bags_that_can_be_read(ros):
    folder = ros.directory / "bags"  # made by the launch file
    ros.start(
        *("roslaunch", "--wait", "nmpc_control", "record.launch"),
        *(f"folder:={folder}", f"size:={SIZE}", f"bags:={BAGS}"),
    )
    ros.start(sys.executable, str(Path(__file__).parent / "record_source.py"))
    ros.wait_for_node("/record")

    def closed():
        return sorted(folder.glob("*.bag"), key=lambda path: path.stat().st_mtime_ns)

    wait(lambda: any(path.stem.endswith("_4") for path in closed()), ros.output)
    master = ServerProxy(ros.environment["ROS_MASTER_URI"])
    recorder = ServerProxy(master.lookupNode("/test", "/record")[2])
    os.kill(recorder.getPid("/test")[2], signal.SIGKILL)

    assert len(closed()) <= BAGS
    assert max(path.stat().st_size for path in closed()) < 3 * SIZE * 2**20
    cut = list(folder.glob("*.bag.active"))
    assert len(cut) == 1
    for path in closed():
        (text,) = strings(path, "/nmpc/parameters")
        recorded = yaml.safe_load(text)
        assert set(recorded) == {"commit", "parameters", "files"}
        assert "controller.yaml" in recorded["files"] and recorded["commit"]
        assert strings(path, "/nmpc/noise")
    with BagFile(cut[0]) as bag:
        assert "the bag has no index (its recorder did not end): read as it lies" in bag.remarks
