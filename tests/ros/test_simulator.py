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
# Advertised on other aircraft only (doc/dji_sdk.md 1 and 2.2).
ABSENT_ON_M100 = {
    *("display_mode", "angular_velocity_fused", "acceleration_ground_fused", "trigger_time"),
    *("rc_connection_status", "flight_anomaly", "odometry"),
    *("set_hardsyc", "mfio_config", "mfio_set_value"),
    *("setup_camera_stream", "stereo_240p_subscription", "stereo_depth_subscription"),
}
TYPES = {
    "attitude": "geometry_msgs/QuaternionStamped",
    "imu": "sensor_msgs/Imu",
    "velocity": "geometry_msgs/Vector3Stamped",
    "gps_position": "sensor_msgs/NavSatFix",
    "gps_health": "std_msgs/UInt8",
    "height_above_takeoff": "std_msgs/Float32",
    "local_position": "geometry_msgs/PointStamped",
    "local_frame_ref": "sensor_msgs/NavSatFix",
    "rc": "sensor_msgs/Joy",
    "flight_status": "std_msgs/UInt8",
    "battery_state": "sensor_msgs/BatteryState",
    "gimbal_angle": "geometry_msgs/Vector3Stamped",
    "vo_position": "dji_sdk/VOPosition",
    "time_sync_nmea_msg": "nmea_msgs/Sentence",
    "time_sync_gps_utc": "dji_sdk/GPSUTC",
    "time_sync_fc_time_utc": "dji_sdk/FCTimeInUTC",
    "time_sync_pps_source": "std_msgs/String",
    "from_mobile_data": "dji_sdk/MobileData",
    "from_payload_data": "dji_sdk/PayloadData",
}
SUBSCRIBED = {
    "flight_control_setpoint_generic": "sensor_msgs/Joy",
    "flight_control_setpoint_ENUposition_yaw": "sensor_msgs/Joy",
    "flight_control_setpoint_ENUvelocity_yawrate": "sensor_msgs/Joy",
    "flight_control_setpoint_rollpitch_yawrate_zposition": "sensor_msgs/Joy",
    "gimbal_angle_cmd": "dji_sdk/Gimbal",
    "gimbal_speed_cmd": "geometry_msgs/Vector3Stamped",
}
SERVICES = {
    "activation": "Activation",
    "camera_action": "CameraAction",
    "drone_arm_control": "DroneArmControl",
    "drone_task_control": "DroneTaskControl",
    "mission_hotpoint_action": "MissionHpAction",
    "mission_hotpoint_getInfo": "MissionHpGetInfo",
    "mission_hotpoint_resetYaw": "MissionHpResetYaw",
    "mission_hotpoint_updateRadius": "MissionHpUpdateRadius",
    "mission_hotpoint_updateYawRate": "MissionHpUpdateYawRate",
    "mission_hotpoint_upload": "MissionHpUpload",
    "mission_status": "MissionStatus",
    "mission_waypoint_action": "MissionWpAction",
    "mission_waypoint_getInfo": "MissionWpGetInfo",
    "mission_waypoint_getSpeed": "MissionWpGetSpeed",
    "mission_waypoint_setSpeed": "MissionWpSetSpeed",
    "mission_waypoint_upload": "MissionWpUpload",
    "query_drone_version": "QueryDroneVersion",
    "sdk_control_authority": "SDKControlAuthority",
    "send_data_to_mobile": "SendMobileData",
    "send_data_to_payload": "SendPayloadData",
    "set_local_pos_ref": "SetLocalPosRef",
}
FAST = {"attitude", "imu"}
MEDIUM = FAST | {"rc", "gps_position", "local_position", "velocity", "gimbal_angle"}
SLOW = MEDIUM | {"battery_state"}


@pytest.mark.alone
def test_topics_and_services_as_a_foreign_client_sees_them(ros):
    ros.launch("uav_sim", "simulator.launch")
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("foreign_client.py", "observe")
    assert seen["rates"] == pytest.approx(RATES, rel=0.02)
    assert 0.98 < seen["speed"] < 1.02, "simulated seconds per second"
    assert seen["frames"] == FRAMES
    assert {frozenset(names) for names in seen["packets"]} == {
        *map(frozenset, (FAST, MEDIUM, SLOW))
    }
    assert 0.0 <= seen["stamp_age"] < 0.1
    assert seen["published"] == TYPES
    assert seen["subscribed"] == SUBSCRIBED
    assert seen["services"] == {name: f"dji_sdk/{kind}" for name, kind in SERVICES.items()}
    offered = {*seen["published"], *seen["subscribed"], *seen["services"]}
    assert not {name for name in offered if name in ABSENT_ON_M100 or name.startswith("rtk_")}
    assert seen["version"] == [50399744, "M100"]
    latitude, status, covariance = seen["gps"]
    assert seen["reference"] and seen["latched"] == ["", 0.0, latitude]
    assert status == 0 and covariance == 0.0 and seen["gps_health"] == 5
    assert seen["imu"] == pytest.approx([0.0, 0.0, 9.801]) and seen["same_attitude"]
    assert seen["covariances"] == [0.0] * 27
    assert seen["battery"] == [100.0, 0.0, 0.0, 0.0, True, False]
    assert seen["rc"] == [[0.0, 0.0, 0.0, 0.0, 8000.0, -10000.0], []]
    assert seen["flight_status"] == 1

    answers = ros.run_json("foreign_client.py", "ask")
    assert answers["query_drone_version"] == [50399744, "M100"]
    assert answers["activation"] == [True, 0, 1, 0]
    assert answers["sdk_control_authority"] == [True, 1, 0, 1], "an empty request gives it back"
    assert answers["drone_arm_control"] == [False, 1, 5, 1]
    assert answers["drone_task_control"] == [False, 1, 1, 1], "task 0 does not exist"
    assert answers["set_local_pos_ref"] == [True]
    assert answers["mission_status"] == [0, 0]
    assert answers["mission_waypoint_upload"] == [False, 3, 0x10, 0xD1], "no authority"
    assert answers["mission_hotpoint_action"] == [False, 3, 0x20, 0xD1]
    assert answers["mission_waypoint_getSpeed"] == [0.0]
    assert answers["mission_waypoint_setSpeed"] == [False]
    assert answers["mission_hotpoint_getInfo"] == ["", 0, 0, 0]
    assert (
        "unable to" in answers["mission_waypoint_getInfo"]
        or "None" in answers["mission_waypoint_getInfo"]
    )
    assert answers["send_data_to_mobile"] == answers["send_data_to_payload"] == [True]
    assert answers["camera"] == [True, True, True, False]
    log = ros.output_of_all()
    assert "gimbal_angle_cmd ignored: no gimbal is simulated" in log
    assert "mission_waypoint_upload refused: missions are not simulated (ack 0xD1)" in log
    assert "task 0: refused, no such task (ack 1)" in log
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
