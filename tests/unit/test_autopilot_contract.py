# SPDX-License-Identifier: MIT
"""What M100 and dji_sdk do around a flight: authority, tasks, take-over, and the open questions."""

import dataclasses
import math

import pytest

from uav_sim.autopilot import Ack, Phase
from uav_sim.errors import ConfigError
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset


def simulator(**undocumented):
    return SimulatedM100(
        load_preset("dji_hil", {"flight_controller": {"undocumented": undocumented}})
    )


def hovering(height=30.0, yaw=0.0, **undocumented):
    sim = simulator(**undocumented)
    sim.place((0.0, 0.0, height), yaw=yaw, authority=True)
    return sim


def stream(sim, duration, suffix, axes):
    for _ in range(round(duration / 0.02)):
        receipt = sim.setpoint(suffix, axes)
        sim.run(0.02)
    return receipt


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, -2.5])
@pytest.mark.parametrize(
    ("suffix", "axes", "heading_axes", "moved"),
    [
        ("generic", (0.1, 0.0, 27.0, 0.0, 43.0), True, (0.0, -1.0)),  # right
        ("generic", (0.0, 0.1, 27.0, 0.0, 43.0), True, (1.0, 0.0)),  # forward
        ("ENUvelocity_yawrate", (1.0, 0.0, 0.0, 0.0), False, (1.0, 0.0)),  # east
        ("ENUposition_yaw", (0.0, 2.0, 5.0, 0.0), False, (0.0, 1.0)),  # north
        ("generic", (1.0, 1.0, 0.0, 0.0, float(0x4B)), True, (0.5**0.5, 0.5**0.5)),  # ahead left
    ],
)
def test_vectors_of_section_9_move_the_aircraft_the_stated_way(
    suffix, axes, heading_axes, moved, yaw
):
    sim = hovering(yaw=yaw)
    stream(sim, 1.0, suffix, axes)
    vx, vy, vz = sim.truth.velocity
    if heading_axes:
        cos_yaw, sin_yaw = math.cos(yaw), math.sin(yaw)
        vx, vy = cos_yaw * vx + sin_yaw * vy, cos_yaw * vy - sin_yaw * vx
    speed = math.hypot(vx, vy)
    assert speed > 0.3
    # Turning to the commanded heading, the tilt's lag bends the way a little.
    turns = suffix == "ENUposition_yaw" and yaw != 0.0
    assert (vx / speed, vy / speed) == pytest.approx(moved, abs=0.3 if turns else 0.05)
    assert (vz < -1.0) == (axes[2] == 27.0 or suffix == "ENUposition_yaw"), "27 % does not carry"


def test_nose_down_reads_as_positive_pitch_and_yaw_rate_turns_left():
    sim = hovering()
    stream(sim, 1.5, "generic", (0.0, 0.1, 38.4, 0.5, 43.0))
    packets = {packet.topic: packet.value for packet in sim.run(0.05)}
    x, y, z, w = packets["attitude"]
    assert math.asin(2.0 * (w * y - z * x)) == pytest.approx(0.1, abs=0.01)
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    assert yaw == pytest.approx(0.5 * 1.5, abs=0.2)
    assert packets["imu"].angular_velocity[2] > 0.4


def test_authority_under_way_is_answered_3_and_4_until_it_is_done():
    sim = simulator(authority_time=0.5)
    assert sim.control_authority(True) == Ack(False, 1, 0, 3)
    sim.run(0.3)
    assert sim.control_authority(True) == Ack(False, 1, 0, 3)
    sim.run(0.3)
    assert sim.control_authority(True) == Ack(True, 1, 0, 2)
    assert sim.control_authority(False) == Ack(False, 1, 0, 4)
    sim.run(0.6)
    assert sim.control_authority(False) == Ack(True, 1, 0, 1)


def test_the_reply_out_of_f_is_0_or_6():
    for ack in (0, 6):
        sim = simulator(wrong_mode_ack=ack)
        sim.rc.mode = "A"
        assert sim.control_authority(True) == Ack(False, 1, 0, ack)


@pytest.mark.parametrize("survives", [False, True])
def test_authority_after_a_short_visit_to_p(survives):
    sim = hovering(authority_survives_toggle=survives)
    sim.rc.mode = "P"
    sim.run(0.1)
    assert not sim.autopilot.authority
    sim.rc.mode = "F"
    sim.run(0.1)
    assert sim.autopilot.authority is survives


def test_released_authority_does_not_come_back_with_the_switch():
    sim = hovering(authority_survives_toggle=True)
    sim.rc.mode = "P"
    sim.run(0.1)
    sim.control_authority(False)
    sim.rc.mode = "F"
    sim.run(0.1)
    assert not sim.autopilot.authority


def test_taken_authority_ends_the_setpoint_at_once():
    sim = hovering()
    stream(sim, 1.0, "generic", (0.0, 0.3, 40.0, 0.0, 43.0))
    sim.autopilot.authority = False
    sim.run(0.4)
    assert sim.truth.rpy[1] < 0.15, "brakes before the command timeout"


@pytest.mark.parametrize("needed", [True, False])
def test_tasks_without_authority(needed):
    sim = simulator(tasks_need_authority=needed)
    assert sim.task(4).ack_data == (1 if needed else 2)
    assert ("authority" in sim.autopilot.refusal) is needed


def test_refusals_have_words():
    sim = simulator()
    sim.control_authority(True)
    for number, words in ((99, "no such task"), (6, "on the ground"), (1, "on the ground")):
        assert sim.task(number) == Ack(False, 1, 1, 1) and words in sim.autopilot.refusal
    sim.rc.mode = "A"
    sim.run(0.01)
    assert sim.task(4).ack_data == 1 and "the RC is in A" in sim.autopilot.refusal
    sim.rc.mode = "F"
    sim.run(0.01)
    assert sim.arm(True) == Ack(False, 1, 5, 1) and "authority" in sim.autopilot.refusal
    sim = hovering()
    sim.autopilot.gps_health = 2
    assert sim.task(1).ack_data == 1 and "gps_health is 2" in sim.autopilot.refusal
    assert sim.arm(False) == Ack(False, 1, 5, 3) and "in the air" in sim.autopilot.refusal


@pytest.mark.parametrize("task", [1, 6])
def test_leaving_f_ends_a_task_and_gives_the_sticks_to_the_pilot(task):
    sim = hovering()
    sim.task(task)
    sim.run(1.0)
    sim.rc.mode, sim.rc.throttle = "P", 0.25
    sim.run(3.0)
    assert sim.phase is Phase.FLYING and sim.truth.velocity[2] == pytest.approx(1.0, abs=0.05)
    assert any("ended: the RC's switch is in P" in words for words in sim.autopilot.take_events())


def test_leaving_f_before_lift_off_stops_the_motors():
    sim = simulator()
    sim.control_authority(True)
    sim.task(4)
    sim.run(0.5)
    sim.rc.mode = "P"
    sim.run(5.0)
    assert sim.phase is Phase.STANDBY and not sim.plant.motors_on


@pytest.mark.parametrize("mode", ["P", "A", "F"])
def test_a_pilot_takes_off_by_the_sticks_and_a_controller_takes_over(mode):
    sim = simulator()
    sim.rc.mode = mode
    sim.rc.roll, sim.rc.pitch, sim.rc.yaw, sim.rc.throttle = 1.0, -1.0, -1.0, -1.0
    sim.run(0.8)
    assert not sim.plant.motors_on
    sim.run(0.4)
    assert sim.plant.motors_on and sim.autopilot.flight_status == 1
    sim.rc.roll = sim.rc.pitch = sim.rc.yaw = sim.rc.throttle = 0.0
    sim.run(1.0)
    assert sim.plant.on_ground
    sim.rc.throttle = 0.3
    sim.run(3.0)
    sim.rc.throttle = 0.0
    assert sim.autopilot.flight_status == 3 and sim.truth.position[2] > 1.0
    sim.rc.mode = "F"
    sim.run(0.1)
    assert sim.control_authority(True).result
    stream(sim, 2.0, "ENUvelocity_yawrate", (1.0, 0.0, 0.0, 0.0))
    assert sim.truth.velocity[0] > 0.7
    sim.rc.mode, sim.rc.throttle = "P", -0.4
    sim.run(8.0)
    assert sim.phase is Phase.STANDBY and not sim.plant.motors_on


def test_rc_that_comes_back_takes_over_from_return_home():
    sim = hovering()
    sim.plant.place((60.0, 0.0, 30.0))
    sim.rc.connected = False
    sim.run(4.0)
    assert sim.phase is Phase.GOING_HOME
    sim.rc.connected, sim.rc.mode = True, "P"
    sim.run(0.1)
    assert sim.phase is Phase.FLYING


def test_events_tell_what_no_topic_shows():
    sim = hovering()
    stream(sim, 0.1, "ENUvelocity_yawrate", (0.0, 0.0, 0.0, 0.0))
    sim.run(1.0)
    stream(sim, 0.1, "generic", (0.0, 0.0, 38.4, 0.0, 43.0))
    sim.rc.mode = "P"
    sim.run(0.1)
    events = "; ".join(sim.autopilot.take_events())
    assert (
        "following setpoints: horizontal velocity, vertical velocity, yaw rate, ground, stable"
        in events
    )
    assert "no setpoint for 0.5" in events and "brake and hover" in events
    assert "horizontal angle, vertical thrust, yaw rate, body, stable" in events
    assert "control authority lost: the RC's switch is in P" in events
    assert sim.autopilot.take_events() == []


@pytest.mark.parametrize(("silence", "stops"), [("hover", True), ("level", False)])
def test_what_silence_flies_is_a_parameter(silence, stops):
    sim = hovering(silence=silence)
    sim.plant.place((0.0, 0.0, 30.0), velocity=(4.0, 0.0, 0.0))
    sim.run(6.0)
    vx, _, vz = sim.truth.velocity
    assert (abs(vx) < 0.1) is stops and abs(vz) < 0.1


@pytest.mark.parametrize("holds", [False, True])
def test_stable_bit_of_an_attitude_setpoint_is_a_parameter(holds):
    sim = hovering(stable_angle_holds=holds)
    sim.plant.wind = (5.0, 0.0, 0.0)
    stream(sim, 12.0, "generic", (0.0, 0.0, 0.0, 0.0, float(0x0B)))
    assert (abs(sim.truth.velocity[0]) < 0.2) is holds


@pytest.mark.parametrize("status", [1, 2])
def test_flight_status_of_idling_motors_is_a_parameter(status):
    sim = simulator(idle_flight_status=status)
    sim.control_authority(True)
    sim.arm(True)
    assert sim.autopilot.flight_status == status
    sim.arm(False)
    assert sim.autopilot.flight_status == 1


def test_sign_of_vertical_velocity_is_a_parameter():
    sim = hovering(velocity_z_sign=-1.0)
    sim.plant.place((0.0, 0.0, 30.0), velocity=(0.0, 0.0, 2.0))
    value = next(packet.value for packet in sim.run(0.05) if packet.topic == "velocity")
    assert value[2] == pytest.approx(-2.0, abs=0.1)


def test_body_velocity_follows_the_heading_between_two_setpoints():
    sim = hovering()
    stream(sim, 6.0, "generic", (2.0, 0.0, 0.0, 1.0, float(0x4B)))
    yaw, (vx, vy, _) = sim.truth.rpy[2], sim.truth.velocity
    left = math.cos(yaw) * vy - math.sin(yaw) * vx
    sim.plant.yaw += math.pi / 2
    before = left
    sim.run(0.4)
    yaw, (vx, vy, _) = sim.truth.rpy[2], sim.truth.velocity
    assert math.cos(yaw) * vy - math.sin(yaw) * vx > before - 2.5
    assert abs(sim.plant.rpy[0]) > 0.05, "leans into the new heading without a new setpoint"


def test_gps_gate_is_3_for_velocity_and_position_and_none_for_angles():
    for health, accepted in ((2, False), (3, True)):
        sim = hovering()
        sim.autopilot.gps_health = health
        assert sim.setpoint("ENUvelocity_yawrate", (0, 0, 0, 0)).accepted is accepted
        assert sim.setpoint("ENUposition_yaw", (0, 0, 5, 0)).accepted is accepted
        assert sim.setpoint("generic", (0, 0, 38, 0, 43)).accepted


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wrong_mode_ack": 7}, r"wrong_mode_ack: got 7, expected a whole number in \[0, 6\]"),
        ({"idle_flight_status": True}, "idle_flight_status: got True"),
        ({"silence": "fall"}, "silence: got 'fall', expected one of hover, level"),
        ({"silence_": "hover"}, "silence_: got 'hover', expected one of"),
    ],
)
def test_wrong_settings_name_file_key_value_and_expectation(changes, words):
    with pytest.raises(ConfigError, match=words):
        simulator(**changes)


def test_changes_win_over_both_files_and_leave_the_rest():
    preset = load_preset("eth", {"mass": 3.1, "flight_controller": {"clamp": False}})
    other = load_preset("eth")
    assert preset.mass == 3.1 and preset.flight_controller.clamp is False
    settings = dataclasses.replace(preset.flight_controller, clamp=True)
    assert dataclasses.replace(preset, mass=other.mass, flight_controller=settings) == other
