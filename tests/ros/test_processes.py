# SPDX-License-Identifier: MIT
"""Processes end and topics fall silent in one launched flight, which goes on or ends as described.

``nmpc_control/doc/modes.md`` describes it; ``process_client.py`` does it.
"""

import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.alone]
GAP, ABOVE_BARE = 40.0, 15.0  # [ms]
ATTITUDE, VELOCITY = 43.0, 73.0  # control bytes
BRAKE = 3


class Flight:
    """Simulator apart, as the aircraft is; control and markers launched as users launch them."""

    def __init__(self, ros, *more):
        self.ros = ros
        ros.launch("uav_sim", "simulator.launch")
        ros.wait_for_node("/uav_sim")
        self.launch()
        for package, file, arguments in more:
            ros.launch(package, file, **arguments)
        ros.start(sys.executable, str(Path(__file__).parent / "bare_stream.py"))

    def launch(self):
        self.control = self.ros.launch(
            "nmpc_control", "control.launch", vehicle="dji_hil", simulated=True, others="/dji2"
        )

    def launch_again(self):
        """A guard that has ended takes its roslaunch with it; a person launches anew."""
        self.control.wait(40)
        self.launch()

    def restart_controller(self):
        self.ros.start("rosrun", "nmpc_control", "nmpc_controller", "_vehicle:=dji_hil")

    def sees(self, *situations, timeout=120):
        return self.ros.run_json("process_client.py", *situations, timeout=timeout)


def steady(seen):
    """Whether commands came as evenly as those of a bare process, and were finite."""
    return seen["gap_ms"] <= max(GAP, seen["bare_gap_ms"] + ABOVE_BARE) and not seen["not_finite"]


def check_controller_ended(seen):
    assert seen["modes"][-1] == "BRAKING", seen
    assert "no_plan" in seen["codes"]
    assert seen["reason"].startswith("the plan is 0.5")
    assert steady(seen), seen
    assert not seen["back"] and seen["mode"] == "BRAKING"


def check_told_to_end(seen):
    """Ctrl-C or SIGTERM: it brakes until authority is given back, then is silent."""
    assert seen["modes"][-2:] == ["BRAKING", "RELEASED"], seen
    assert "leaving" in seen["codes"] and seen["codes"][-1] == "asked"
    assert seen["setpoints"][-1] == VELOCITY and seen["brakes"] == [BRAKE]
    assert seen["task"] == 1, "authority was not given back"
    assert seen["silent"] and not seen["back"]
    assert seen["not_finite"] == []
    assert seen["drift"] < 0.5


def test_a_crash_a_silence_and_ctrl_c(ros):
    flight = Flight(ros)
    seen = flight.sees("position_silent", "node_ends:nmpc_controller:SIGSEGV")
    silent = seen["position_silent"]
    assert silent["modes"] == ["HOVERING", "BRAKING"], silent
    assert silent["then"][-1] == "HOVERING"
    assert "position_stale" in silent["codes"]
    assert steady(silent), silent
    check_controller_ended(seen["node_ends:nmpc_controller:SIGSEGV"])
    flight.restart_controller()
    check_told_to_end(flight.sees("guard_ends:SIGINT")["guard_ends:SIGINT"])
    log = ros.output_of_all()
    assert "shutting down: release authority: done" in log
    assert "Traceback" not in log


@pytest.mark.long
@pytest.mark.timeout(600)
def test_every_process_every_way(ros):
    flight = Flight(ros, ("nmpc_control", "monitor.launch", {"rviz": False}))
    quiet = (
        "position_silent",
        "attitude_silent",
        "rc_silent",
        "authority_taken",
        "app_takes_authority",
        "solver_stalls",
    )
    seen = flight.sees(*quiet, timeout=180)
    expected = {
        "position_silent": (["HOVERING", "BRAKING"], "position_stale"),
        "attitude_silent": (["HOVERING", "RELEASED"], "attitude_stale"),
        "rc_silent": (["HOVERING", "MANUAL"], "pilot"),
        "authority_taken": (["HOVERING", "MANUAL"], "pilot"),
        # held at rest it seems to obey; the second time in a flight it is not believed any more
        "app_takes_authority": (
            ["FLYING", "BRAKING", "HOVERING", "FLYING", "RELEASED"],
            "authority_lost",
        ),
        "solver_stalls": (["HOVERING", "BRAKING"], "no_plan"),
    }
    for name, (modes, code) in expected.items():
        assert seen[name]["modes"] == modes, seen[name]
        assert code in seen[name]["codes"], seen[name]
        assert seen[name]["then"][-1] == "HOVERING"
        assert seen[name]["not_finite"] == []
    assert steady(seen["solver_stalls"])
    assert seen["solver_stalls"]["misses"] >= 25

    for node in ("nmpc_visualizer", "nmpc_traffic"):
        end = f"node_ends:{node}:SIGKILL"
        seen = flight.sees(end)[end]
        assert seen["modes"] in (["FLYING"], ["FLYING", "HOVERING"]), seen
        assert steady(seen) and not seen["back"]
    assert "/nmpc_traffic reported obstacles and is silent" in seen["held_back"]
    assert seen["forgotten"]

    for number in ("SIGINT", "SIGSEGV", "SIGKILL"):
        end = f"node_ends:nmpc_controller:{number}"
        check_controller_ended(flight.sees(end)[end])
        flight.restart_controller()

    seen = flight.sees("guard_is_stopped")["guard_is_stopped"]
    assert seen["modes"][-1] in ("HOVERING", "BRAKING") and seen["not_finite"] == [], seen

    for number in ("SIGINT", "SIGTERM"):
        check_told_to_end(flight.sees(f"guard_ends:{number}")[f"guard_ends:{number}"])
        flight.launch_again()

    for number in ("SIGSEGV", "SIGKILL"):
        seen = flight.sees(f"guard_ends:{number}")[f"guard_ends:{number}"]
        assert seen["modes"] in ([], ["FLYING"]) and seen["silent"] and not seen["back"], seen
        assert seen["stream_ms"] < 100.0 + seen["bare_gap_ms"]
        assert seen["setpoints"][-1] == ATTITUDE
        assert seen["moved"] < 8.0, "the flight controller did not brake"
        assert seen["drift"] < 0.5, "the flight controller does not hold"
        flight.launch_again()

    seen = flight.sees("master_ends")["master_ends"]
    assert seen["modes"][0] == "FLYING" and set(seen["modes"]) <= {"FLYING", "HOVERING"}, seen
    assert steady(seen), seen
    assert seen["land"] == [True, "landing"]
    assert seen["authority"] is False
    assert seen["start"] == [True, "taking off"]
    assert "guard_failed" not in seen["codes"]
