# SPDX-License-Identifier: MIT
"""Three controllers that were written for the aircraft, not for this simulator, fly in it."""

import pytest

pytestmark = pytest.mark.ros

SPEED = 4  # simulated seconds per second


def simulate(ros, **arguments):
    """Start a simulator: one may fly after the other, each leaves the aircraft on the ground."""
    ros.launch("uav_sim", "simulator.launch", speed_factor=SPEED, **arguments)
    ros.wait_for_node("/uav_sim")


def assert_quiet(log):
    """Nothing went wrong, and nothing was ignored before a controller noticed its landing."""
    assert "Traceback" not in log
    ignored = [line for line in log.splitlines() if " ignored: " in line]
    assert all("the aircraft is just landed" in line for line in ignored), ignored


def test_controllers_written_for_the_aircraft_fly_unmodified_by_default(ros):
    simulate(ros)
    demo = ros.run_json("foreign_demo.py")
    assert demo.pop("gained") == pytest.approx(1.2, abs=0.1)
    corners = [(2.0, 0.0, 3.0), (2.0, 2.0, 3.0), (0.0, 2.0, 3.0), (0.0, 0.0, 3.0)]
    assert demo.pop("reached") == [pytest.approx(corner, abs=0.2) for corner in corners]
    assert demo.pop("statuses") == [1, 2, 3, 4, 5, 1]
    assert demo.pop("landed_for") == pytest.approx(2.0, abs=0.15)
    assert all(demo.values()), demo

    attitude = ros.run_json("foreign_attitude.py")
    assert attitude.pop("errors") == pytest.approx([0.0, 0.0, 0.0], abs=0.15)
    assert attitude.pop("errors_later") == pytest.approx([0.0, 0.0, -1.0], abs=0.15)
    assert 0.05 < attitude.pop("largest_rate") < 3.0
    assert all(attitude.values()), attitude
    log = ros.output_of_all()
    assert "following setpoints: horizontal angle, vertical velocity, yaw rate, body" in log
    assert "following setpoints: horizontal angle, vertical position, yaw rate, body" in log
    assert_quiet(log)


def test_one_that_lifts_off_by_setpoints_flies_where_that_is_allowed(ros, tmp_path):
    """Whether an M100 does is open: ``setpoints_need_air`` is the switch for it."""
    settings = tmp_path / "lift_off.yaml"
    settings.write_text("flight_controller: {setpoints_need_air: false}\n")
    simulate(ros, settings_file=settings)
    velocity = ros.run_json("foreign_velocity.py")
    assert velocity.pop("errors") == pytest.approx([0.0, 0.0, 0.0], abs=0.1)
    assert velocity.pop("yaw") == pytest.approx(1.0, abs=0.05)
    assert velocity == {
        "arm_first": 1,
        "authority": 2,
        "arm": 0,
        "arm_again": 2,
        "up": True,
        "disarm_in_air": 3,
        "arrived": True,
        "down": True,
        "disarm": 2,
        "release": 1,
        "statuses": [1, 3, 5, 1],
    }
    assert_quiet(ros.output_of_all())
