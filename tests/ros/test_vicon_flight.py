# SPDX-License-Identifier: MIT
"""Indoors through ROS: Vicon over /tf, another source in flight, and Vicon silent."""

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.long]
HOVERING = 4


def test_a_flight_indoors_follows_vicon_changes_its_source_and_ends_where_vicon_ends(ros):
    ros.launch("uav_sim", "simulator.launch", disturbance="indoor", seed=3, speed_factor=1.5)
    ros.wait_for_node("/uav_sim")
    sources = {"position_source": "vicon", "standby": "world_position"}
    ros.launch("nmpc_control", "control.launch", vehicle="dji_hil", simulated=True, **sources)
    for node in ("nmpc_controller", "flight_guard"):
        ros.wait_for_node(f"/{node}")
    seen = ros.run_json("vicon_client.py", timeout=120)
    granted, words = seen["start_silent"]
    assert not granted
    assert "position is " in words
    assert seen["start"] == [True, "taking off"], "no GPS is needed"
    assert seen["flown"][0], seen["flown"]
    assert seen["off"] < 0.15
    assert seen["select_unheard"] == [
        False,
        "'gps' is not listened to, only vicon, world_position",
    ]
    assert seen["select"][0], seen["select"]
    assert seen["select"][1].startswith("position comes from world_position; 0.")
    assert seen["source_beside"] == "world_position"
    assert 0.2 < seen["off_beside"] < 0.45  # it holds where the new source says
    assert seen["back"][0], seen["back"]
    assert seen["off_back"] < 0.15
    assert seen["modes_switching"] == [HOVERING]
    assert 0.2 < seen["brake_after"] < 2.0
    assert "position" in seen["reason"]
    assert seen["modes"][-2:] in (["BRAKING", "RELEASED"], ["HOVERING", "RELEASED"])
    assert seen["start_again"] == [True, "braking to hover"]
    assert seen["land"] == [True, "landing"]
    assert seen["height"] < 0.05
    assert seen["collisions"] == 0
    assert "Traceback" not in ros.output_of_all()
