import time

import pytest

pytestmark = pytest.mark.ros

SHOWN = (
    "topic_dropped",
    "topic_nan",
    "topic_jump",
    "topic_frozen",
    "authority_refused",
    "rc_mode",
    "rc_off",
    "gps_lost",
    "battery_low",
    "wind_gust",
)
SCENARIO = "spawn: [0.0, 0.0, 5.0]\n"
SCHEDULE = "faults:\n  - {fault: setpoints_ignored, start: 0.5, duration: 0.1, id: hiccup}\n"


@pytest.mark.timeout(90)
def test_faults_and_time_by_service(ros):
    scenario, schedule = ros.directory / "hover.yaml", ros.directory / "faults.yaml"
    scenario.write_text(SCENARIO)
    schedule.write_text(SCHEDULE)
    simulator = ros.launch(
        "uav_sim", "simulator.launch", scenario_file=scenario, fault_file=schedule
    )
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("fault_client.py")

    assert seen["faults"] == {kind: [True] * 4 for kind in SHOWN}
    for words, text in zip(
        (
            "expected one of topic_frozen",
            "valid YAML",
            "one of P, A, F",
            "a finite number",
            "no fault",
        ),
        seen["refused"],
    ):
        assert words in text and "\n" not in text
    passed = seen["time"]
    assert passed["stood"] == 0.0
    assert passed["stepped"] == [True, pytest.approx(0.25), pytest.approx(0.25)]
    assert 1.5 < passed["speed"] < 3.2, "simulated seconds per second; less on a busy machine"
    assert passed["refusals"] == [False, False]

    deadline = time.monotonic() + 20.0
    while simulator.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    assert simulator.poll() is not None, "the process is killed, and roslaunch ends with it"
    log = ros.output_of(simulator)
    assert "hiccup" in log and "killed by a fault" in log
    assert all(f"{kind}_" in log for kind in SHOWN)
