import pytest

pytestmark = pytest.mark.ros

SCENARIO = (
    "obstacles:\n  - {id: tower, shape: cylinder, radius: 1, height: 20, position: [0, 30, 10]}\n"
)
VEHICLES = "[{name: dji1, spawn: [0, 0, 5]}, {name: dji2, spawn: [3, 0, 5], preset: eth}]"


@pytest.mark.timeout(90)
def test_two_vehicles_meet_in_one_world(ros):
    scenario = ros.directory / "world.yaml"
    scenario.write_text(SCENARIO)
    ros.launch("uav_sim", "simulator.launch", scenario_file=scenario, vehicles=VEHICLES)
    ros.wait_for_node("/uav_sim")
    seen = ros.run_json("fleet_client.py")

    assert seen["authority"] == [True, True]
    assert seen["around"] == [
        ["tower", [1.0, 20.0], [0.0, 30.0]],
        ["dji2", [0.5], pytest.approx([3.0, 0.0], abs=0.05)],
    ]
    assert seen["seen_speed"] > 1.0, "dji2 sees dji1 come at 2 m/s"
    assert [text.split()[0] for text in seen["collisions"]] == ["id=dji2", "id=dji1"]
    assert seen["still"] < 0.05, "dji2 does not follow the setpoints of dji1"
    assert seen["killed"] and seen["services"] == []
    first, second = seen["after"]["dji_sdk/velocity"]
    assert first > 15 and second == 0
    assert min(seen["after"]["uav_sim/ground_truth"]) > 30, "the aircraft flies on without dji_sdk"
    assert seen["cleared"] and seen["lives"], "dji_sdk is started again when the fault ends"
