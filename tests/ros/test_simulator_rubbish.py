# SPDX-License-Identifier: MIT
"""Whatever a controller sends, the simulator lives and says what it did with it."""

import pytest

pytestmark = pytest.mark.ros

SAID = [
    "setpoint generic ignored: no control authority",
    "setpoint generic ignored: 4 axes instead of 5",
    "setpoint generic ignored: axes (nan, 0.0",
    "setpoint generic ignored: control byte 300 is not in 0..255",
    "setpoint generic ignored: control byte -1 is not in 0..255",
    "setpoint generic ignored: control byte 0xC0: an M100 follows no angular rates",
    "setpoint generic ignored: control byte 0x30: vertical mode 0x30 does not exist",
    "setpoint generic ignored: control byte 0x06: frame 0x06 does not exist",
    "setpoint generic clamped: thrust 900 percent is not in 10..100",
    "setpoint generic clamped: tilt 729.3 deg is not in 0..34.66",
    "setpoint generic clamped: yaw rate -5672 deg/s is not in -99.98..99.98",
    "setpoint ENUposition_yaw ignored: 1 axes instead of 4",
    "setpoint ENUposition_yaw ignored: axes (nan, nan, nan, nan) are not all finite",
    "setpoint ENUposition_yaw clamped: height 500 m is not in 0..120",
    "setpoint ENUvelocity_yawrate ignored: 3 axes instead of 4",
    "setpoint ENUvelocity_yawrate clamped: horizontal velocity",
    "setpoint rollpitch_yawrate_zposition clamped: height -5 m is not in 0..120",
    "times in the last second)",
    "brake and hover; the sticks are live",
]


def test_rubbish_never_crashes_it_and_the_log_says_what_was_done(ros, tmp_path):
    scenario = tmp_path / "high.yaml"
    scenario.write_text("spawn: [0.0, 0.0, 60.0]\n")
    ros.launch("uav_sim", "simulator.launch", speed_factor=2, scenario_file=scenario)
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("foreign_rubbish.py")
    assert seen["authority"] and seen["calm"] and seen["calm_after_flood"]
    assert seen["flood_speed"] > 3.0, "clamped, but followed"
    assert seen["rate"] == pytest.approx(50.0, rel=0.1)
    assert 20.0 < seen["height"] < 150.0
    log = ros.output_of_all()
    assert [words for words in SAID if words not in log] == []
    assert "Traceback" not in log
