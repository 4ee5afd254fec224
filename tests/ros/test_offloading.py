# SPDX-License-Identifier: MIT
"""The controller on a workstation, over a link that becomes slow, is cut, and has another time."""

import re
import sys
from pathlib import Path

import pytest

pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")

from link_relay import DOWN, UP

pytestmark = [pytest.mark.ros, pytest.mark.alone, pytest.mark.long]


def test_the_ladder_covers_the_link(ros):
    ros.launch("uav_sim", "simulator.launch")
    ros.wait_for_node("/uav_sim")
    ros.start(sys.executable, str(Path(__file__).parent / "link_relay.py"))
    ros.start(sys.executable, str(Path(__file__).parent / "bare_stream.py"))
    ros.launch(
        "nmpc_control", "control.launch", vehicle="dji_hil", simulated=True, controller=False
    )
    names = [f"{name}:=ground/{name}" for name in (*DOWN, *UP)]
    controller = ["rosrun", "nmpc_control", "nmpc_controller", "_vehicle:=dji_hil"]
    ros.start(*controller, "/clock:=/ground/clock", *names)
    situations = ("link_slow", "link_cut", "link_skewed:0.3", "link_skewed:-0.3")
    seen = ros.run_json("process_client.py", *situations, timeout=150)
    for name in situations:
        assert seen[name]["then"][-1] == "HOVERING", seen[name]
        assert seen[name]["not_finite"] == []
    for name in ("link_slow", "link_cut", "link_skewed:0.3", "link_skewed:-0.3"):
        assert seen[name]["modes"] == ["HOVERING", "BRAKING"], seen[name]
    assert "old" in seen["link_slow"]["reason"]
    assert "the plan is" in seen["link_cut"]["reason"]
    told = re.search(
        r"the controller's clock is (\S+) s ahead of the guard's", seen["link_skewed:0.3"]["reason"]
    )
    assert told and abs(float(told.group(1)) - 0.3) < 0.03
    assert "behind the guard's" in seen["link_skewed:-0.3"]["reason"]
