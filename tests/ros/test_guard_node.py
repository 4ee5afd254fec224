# SPDX-License-Identifier: MIT
import os
import signal
import sys
from pathlib import Path

import pytest
from simulator_load import pid_of

pytestmark = pytest.mark.ros

BRAKE, VELOCITY = 3, 73.0


@pytest.fixture
def flight(ros):
    """Simulator, controller and guard; the guard ends only when a test ends it."""
    return started(ros, "")


@pytest.fixture
def flight_without_terminal(ros):
    """The same, and whatever controller and guard print fails: nobody reads it any more."""
    return started(ros, " 2>&1 | true")


def started(ros, output):
    ros.launch("uav_sim", "simulator.launch")
    ros.wait_for_node("/uav_sim")
    nodes = ("flight_guard", "nmpc_controller")
    for name in nodes:
        command = f"rosrun nmpc_control {name} _vehicle:=dji_hil _simulated:=true"
        ros.start("bash", "-c", f"exec {command}" if not output else command + output)
    for name in nodes:
        ros.wait_for_node(f"/{name}")
    return ros


@pytest.mark.alone
def test_a_dead_controller_leaves_a_held_aircraft_that_still_lands(flight):
    bare = flight.start(sys.executable, str(Path(__file__).parent / "bare_stream.py"))
    seen = flight.run_json("guard_client.py", "controller_dies", timeout=120)
    bare.send_signal(signal.SIGINT)
    bare.wait(20)
    machine = float(flight.output_of(bare).split()[-1]) / 1e3  # [s] its longest gap just now
    assert seen["start"] == [True, "taking off"]
    assert seen["second_start"] == [False, "automatic flight is under way: hovering"]
    assert seen["hover"] == [True, "hovering"]
    assert 0.3 < seen["stopped_at"] < 7.0  # on the way to 10
    assert 0.3 < seen["takeover"] < 0.7 + machine  # the last verified plan is flown for 0.5 s
    assert seen["status"][0] == BRAKE
    assert seen["status"][1].startswith("the plan is 0.5")
    assert seen["flag"] == VELOCITY
    assert seen["drift"] < 0.3
    assert seen["gap"] <= max(0.040, machine + 0.015)  # the stream goes on through the change
    assert seen["land"] == [True, "landing"]
    assert seen["height"] < 0.05
    flown = ["TAKING_OFF", "HOVERING", "FLYING", "HOVERING", "BRAKING", "LANDING", "WAITING"]
    assert seen["modes"][-7:] == flown
    assert seen["authority"] is False
    granted, words = seen["start_without_plans"]
    assert not granted
    assert "0 of 10 plans verified in a row (the plan is" in words
    assert "Traceback" not in flight.output()
    ranks = ranks_of_threads(pid_of(flight, "/flight_guard"))
    assert len(ranks) == 1, "a thread of lower rank that holds Python's lock holds up the stream"
    if may_run_in_real_time():
        assert ranks == {(os.SCHED_RR, 0)}


def ranks_of_threads(pid):
    """Return policy and niceness, as a set, of all threads that live throughout."""
    ranks = set()
    for task in Path(f"/proc/{pid}/task").iterdir():
        thread = int(task.name)
        try:
            ranks.add((os.sched_getscheduler(thread), os.getpriority(os.PRIO_PROCESS, thread)))
        except ProcessLookupError:
            continue  # a connection's thread that ended meanwhile
    return ranks


def may_run_in_real_time():
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except OSError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def test_the_pilot_silences_the_stream_and_only_a_new_start_resumes(flight_without_terminal):
    seen = flight_without_terminal.run_json("guard_client.py", "pilot_takes_over", timeout=120)
    assert seen["task"] == 1, "authority was not given back"
    assert seen["last_setpoint_after"] < 0.0
    assert seen["start"] == [True, "braking to hover"]
    modes = seen["modes"]
    assert modes.index("MANUAL") == modes.index("FLYING") + 1
    assert modes[-4:] == ["WAITING", "READY", "BRAKING", "HOVERING"]
    assert seen["resume"] == [True, "flying to where it was left"]
    assert abs(seen["arrived_at"] - 5.0) < 0.5
    assert seen["resume_again"] == [False, "nothing waits to be resumed"]
    assert {"pilot", "pilot_gave_back", "asked", "recovered", "goal"} <= set(seen["codes"])


def test_nobody_takes_off_who_was_told_of_no_answer():
    pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")
    from nmpc_control.mode_inputs import Request
    from nmpc_control.ros.question import Question

    late = Question(Request.START)
    assert late.give_up() and not late.take_up()
    assert late.answer == (False, "the guard did not answer: nothing is done")
    in_time = Question(Request.START)
    assert in_time.take_up() and not in_time.give_up()
    for harmless in (Request.HOVER, Request.RELEASE):
        late = Question(harmless)
        assert late.give_up() and late.take_up()
        assert late.answer == (False, "the guard did not answer: it acts as soon as it runs")


def test_thrust_is_not_commanded_through_a_map_of_no_airframe(monkeypatch):
    pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")
    from nmpc_control.ros import guard_node

    ros_parameters = {"~vehicle": "eth"}
    monkeypatch.setattr(guard_node.rospy, "get_param", ros_parameters.get)
    said = []
    monkeypatch.setattr(guard_node.rospy, "logerr", said.append)
    refusal = guard_node._guard().situation.refusal
    assert "vehicles/eth.yaml: thrust_map.measured_on is a simulator's" in refusal
    assert said == [f"start will be refused: {refusal}"]

    ros_parameters["~simulated"] = True
    assert guard_node._guard().situation.refusal == ""

    ros_parameters["~profile"] = "first_flight"
    ros_parameters["~simulated"] = False
    assert guard_node._guard().situation.refusal == ""  # the first flights' profile needs no map
    assert guard_node._guard().params.vertical_command == "velocity"
    assert guard_node._guard().params.modes.needs_switch


def test_an_unknown_vehicle_ends_in_one_line(ros):
    guard = ros.start("rosrun", "nmpc_control", "flight_guard", "_vehicle:=m600")
    assert guard.wait(30) == 2
    log = ros.output()
    assert "m600.yaml: file: got 'No such file or directory', expected a readable file" in log
    assert "Traceback" not in log


@pytest.mark.parametrize("node", ["flight_guard", "nmpc_controller"])
def test_no_vehicle_is_assumed(ros, node):
    process = ros.start("rosrun", "nmpc_control", node)
    assert process.wait(60) == 2
    assert "parameter: ~vehicle: got ''" in ros.output()
