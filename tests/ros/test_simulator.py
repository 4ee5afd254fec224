import subprocess

import pytest

pytestmark = pytest.mark.ros

RATES = {
    "attitude": 100,
    "imu": 100,
    "velocity": 50,
    "gps_position": 50,
    "gps_health": 50,
    "height_above_takeoff": 50,
    "local_position": 50,
    "rc": 50,
    "flight_status": 50,
    "battery_state": 10,
    "gimbal_angle": 50,
}
FRAMES = {
    "attitude": "body_FLU",
    "imu": "body_FLU",
    "velocity": "ground_ENU",
    "gps_position": "gps",
    "local_position": "/local",
    "rc": "rc",
    "battery_state": "",
    "gimbal_angle": "ground_ENU",
}
ABSENT_ON_M100 = (
    "display_mode",
    "angular_velocity_fused",
    "acceleration_ground_fused",
    "rtk_position",
)


@pytest.mark.alone
def test_topics_as_a_foreign_client_sees_them(ros):
    ros.launch("uav_sim", "simulator.launch")
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("foreign_client.py", "observe")
    assert seen["rates"] == pytest.approx(RATES, rel=0.02)
    assert seen["speed"] < 1.02, "simulated seconds per second; less on a busy machine"
    assert seen["frames"] == FRAMES
    assert 0.0 <= seen["stamp_age"] < 0.1
    published = [name.rsplit("/", 1)[1] for name in seen["published"]]
    assert {*RATES, "local_frame_ref", "vo_position", "from_mobile_data"} <= set(published)
    assert not set(ABSENT_ON_M100) & set(published)
    assert seen["version"] == [50399744, "M100"]
    assert seen["reference"] and seen["latched_latitude"] == seen["gps_latitude"]
    assert seen["acceleration"] == pytest.approx(9.801)
    assert seen["covariance"] == [0.0] * 9
    assert seen["battery"] == [100.0, 0.0, True, False]
    assert seen["rc"] == [0.0, 0.0, 0.0, 0.0, 8000.0, -10000.0]
    assert seen["flight_status"] == 1


def test_a_foreign_client_takes_off_flies_and_lands(ros):
    ros.launch("uav_sim", "simulator.launch", speed_factor=2)
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("foreign_client.py", "fly", timeout=90)
    assert seen["task_without_authority"] == 1 and seen["arm_without_authority"] == 1
    assert seen["reference"] is True
    assert seen["authority"] == [True, 1, 0, 2]
    assert seen["take_off"] == [True, 1, 1, 2]
    assert seen["velocity"] == pytest.approx([0.5, 1.0, 0.5], abs=0.1)
    assert seen["after_pitch"][0] > 1.0, "nose down facing east flies east"
    assert seen["after_silence"] == pytest.approx([0.0, 0.0, 0.0], abs=0.05)
    assert seen["local_position"][1] > 2.5
    assert seen["height"] == pytest.approx(seen["local_position"][2], abs=0.1)
    assert seen["land"] == 2 and seen["release"] == 1
    assert seen["statuses"] == [1, 2, 3, 4, 5, 1]
    log = ros.output()
    assert "setpoint generic ignored: no control authority" in log
    assert "setpoint generic ignored: 4 axes instead of 5" in log
    assert "setpoint generic clamped: thrust 900" in log
    assert "Traceback" not in log


def test_obstacles_are_published_and_a_collision_is_latched(ros, tmp_path):
    scenario = tmp_path / "tree.yaml"
    scenario.write_text(
        "spawn: [0.0, 0.0, 5.0]\n"
        "reference: not the simulator's matter\n"
        "obstacles:\n"
        "  - {id: tree, position: [0.0, 0.0, 4.2], radius: 0.5, velocity: [0.0, 0.0, 0.1]}\n"
    )
    ros.launch("uav_sim", "simulator.launch", scenario_file=scenario)
    ros.wait_for_node("/uav_sim")
    words = echo(ros, "/uav_sim/collision")
    assert "id=tree" in words and "clearance=-0.2" in words
    obstacles = echo(ros, "/obstacles")
    assert 'id: "tree"' in obstacles and 'frame_id: "world"' in obstacles


def test_a_wrong_parameter_ends_in_one_line(ros):
    for arguments, words in (
        ({"preset": "m600"}, "preset: name: got 'm600', expected one of dji_hil, eth, paper"),
        ({"scenario_file": "/nowhere.yaml"}, "/nowhere.yaml: file: got 'No such file"),
        ({"speed_factor": -1}, "speed_factor: got -1"),
    ):
        ros.launch("uav_sim", "simulator.launch", **arguments).wait(30)
        assert words in ros.output()
    log = ros.output()
    assert log.count("exit code 2") == 3 and "Traceback" not in log


def echo(ros, topic):
    """Return one message of a topic as text."""
    command = ["rostopic", "echo", "-n", "1", topic]
    done = subprocess.run(
        command, env=ros.environment, capture_output=True, text=True, timeout=30, check=True
    )
    return done.stdout
