# SPDX-License-Identifier: MIT
"""Simulator with laser, and the tracker node: near truth, whatever else arrives as a scan."""

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.long]

SCENARIO = """\
spawn: [0.0, 0.0, 3.0]
obstacles:
  - id: walker
    shape: cylinder
    position: [8.5, -4.0, 2.0]
    velocity: [0.0, 1.0, 0.0]
    radius: 0.3
    height: 5.0
"""


def test_tracks_are_near_truth_and_rubbish_is_counted(ros):
    scenario = ros.directory / "walker.yaml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    ros.launch("uav_sim", "simulator.launch", scenario_file=scenario, laser="utm_30lx")
    ros.wait_for_node("/uav_sim")
    ros.start("rosrun", "nmpc_control", "laser_tracker")
    ros.wait_for_node("/laser_tracker")
    result = ros.run_json("laser_client.py", timeout=60)
    assert result["compared"] > 20
    assert result["position"] < 0.15 and result["speed"] < 0.3
    assert result["names"] == ["laser_1"] and result["frames"] == ["world"]
    assert 0.0 < result["growth"] <= 0.5
    counted = result["diagnoses"]
    for kind in ("beams", "angles", "stamp"):
        assert int(counted[f"scans not taken: {kind}"]) > 0, counted
    assert int(counted["scans"]) > 30
    assert "Traceback" not in ros.output_of_all()
