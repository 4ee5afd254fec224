import dataclasses
import math

import pytest

from uav_sim.autopilot import Ack, Phase
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset

HOVER = (0.0, 0.0, 38.3545, 0.0, 43.0)


def simulator(name="dji_hil", **flight_controller):
    preset = load_preset(name)
    settings = dataclasses.replace(preset.flight_controller, **flight_controller)
    return SimulatedM100(dataclasses.replace(preset, flight_controller=settings))


def hovering(position=(0.0, 0.0, 5.0), yaw=0.0, **flight_controller):
    sim = simulator(**flight_controller)
    sim.place(position, yaw=yaw, authority=True)
    return sim


def stream(sim, duration, axes, suffix="generic"):
    """Send a setpoint at 50 Hz."""
    for k in range(round(duration / sim.preset.step)):
        if k % 4 == 0:
            receipt = sim.setpoint(suffix, axes)
        sim.step()
    return receipt


def status_changes(sim, duration):
    """Return (t, flight_status) at every change."""
    changes = [(sim.t, sim.autopilot.flight_status)]
    for _ in range(round(duration / sim.preset.step)):
        sim.step()
        if sim.autopilot.flight_status != changes[-1][1]:
            changes.append((sim.t, sim.autopilot.flight_status))
    return changes


@pytest.mark.parametrize("name", ["dji_hil", "eth", "paper"])
def test_take_off_and_landing_run_through_the_flight_status(name):
    sim = simulator(name)
    sim.run(0.1)
    assert sim.control_authority(True) == Ack(True, 1, 0, 2)
    assert sim.task(4) == Ack(True, 1, 1, 2)
    assert [status for _, status in status_changes(sim, 10.0)] == [2, 3]
    assert sim.truth.position == pytest.approx((0.0, 0.0, 1.2), abs=0.05)
    assert sim.task(6) == Ack(True, 1, 1, 2)
    changes = status_changes(sim, 15.0)
    assert [status for _, status in changes] == [4, 5, 1]
    assert changes[2][0] - changes[1][0] == pytest.approx(2.0, abs=0.01)
    assert sim.plant.on_ground and not sim.plant.motors_on
    assert sim.plant.impact_speed < 0.7


def test_authority_needs_the_switch_in_f():
    sim = simulator()
    sim.rc.mode = "P"
    assert sim.control_authority(True) == Ack(False, 1, 0, 0)
    sim.rc.mode = "F"
    assert sim.control_authority(True) == Ack(True, 1, 0, 2)
    assert sim.control_authority(True) == Ack(True, 1, 0, 2)
    assert sim.control_authority(False) == Ack(True, 1, 0, 1)
    sim.rc.connected = False
    assert sim.control_authority(True) == Ack(False, 1, 0, 0)


def test_arming_answers():
    sim = simulator()
    assert sim.arm(True) == Ack(False, 1, 5, 1)
    sim.control_authority(True)
    assert sim.arm(True) == Ack(True, 1, 5, 0)
    assert sim.arm(True) == Ack(False, 1, 5, 2)
    assert sim.task(4) == Ack(False, 1, 1, 1), "take-off needs motors off"
    assert sim.arm(False) == Ack(True, 1, 5, 0)
    assert hovering().arm(False) == Ack(False, 1, 5, 3)


def test_refused_tasks_answer_1():
    sim = simulator()
    refused = Ack(False, 1, 1, 1)
    assert sim.task(4) == refused, "no authority"
    sim.control_authority(True)
    assert sim.task(6) == refused, "on the ground"
    assert sim.task(99) == refused, "no such task"
    assert hovering().task(4) == refused, "in the air"


def test_setpoints_are_ignored_until_everything_is_there():
    sim = simulator()
    assert "authority" in sim.setpoint("generic", HOVER).text
    sim.control_authority(True)
    assert "on the ground" in sim.setpoint("generic", HOVER).text
    sim.task(4)
    sim.run(2.5)
    assert sim.autopilot.flight_status == 3 and "taking off" in sim.setpoint("generic", HOVER).text
    sim.run(5.0)
    assert sim.setpoint("generic", HOVER).accepted
    sim.rc.mode = "A"
    assert "the RC is in A" in sim.setpoint("generic", HOVER).text
    sim.rc.mode, sim.rc.connected = "F", False
    assert "off" in sim.setpoint("generic", HOVER).text


def test_leaving_f_takes_authority_for_good():
    sim = hovering()
    assert stream(sim, 0.1, HOVER).accepted
    sim.rc.mode = "P"
    sim.step()
    sim.rc.mode = "F"
    assert "no control authority" in sim.setpoint("generic", HOVER).text


def test_velocity_and_position_need_gps():
    sim = hovering()
    sim.autopilot.gps_health = 2
    assert "gps_health is 2" in sim.setpoint("ENUvelocity_yawrate", (1, 0, 0, 0)).text
    assert "gps_health is 2" in sim.setpoint("ENUposition_yaw", (1, 0, 5, 0)).text
    assert sim.setpoint("rollpitch_yawrate_zposition", (0, 0, 5, 0)).accepted


def test_silence_is_followed_for_half_a_second_then_braked():
    sim = hovering()
    stream(sim, 2.0, (0.0, 0.2, 39.0, 0.0, 43.0))
    start = sim.t
    while sim.plant.rpy[1] > 0.15:
        sim.step()
    # The last setpoint was sent three steps before; then come dead time and the fall of the tilt.
    assert 0.5 - 0.02 + 0.06 < sim.t - start < 0.75
    sim.run(10.0)
    rest = sim.truth
    assert math.dist(rest.velocity, (0, 0, 0)) < 0.02
    sim.run(5.0)
    assert math.dist(sim.truth.position, rest.position) < 0.05


def test_thrust_setpoint_does_not_hold_height():
    sim = hovering()
    stream(sim, 2.0, (0.0, 0.0, 42.0, 0.0, 43.0))
    assert sim.truth.velocity[2] > 0.5


def test_clamping_is_said_and_can_be_rejection():
    receipt = hovering().setpoint("generic", (0.0, 0.0, 150.0, 0.0, 43.0))
    assert receipt.accepted and "thrust 150" in receipt.text
    receipt = hovering(clamp=False).setpoint("generic", (0.0, 0.0, 150.0, 0.0, 43.0))
    assert not receipt.accepted and "thrust 150" in receipt.text


def test_malformed_setpoints_are_ignored_with_a_reason():
    sim = hovering()
    assert "4 axes" in sim.setpoint("generic", (0.0, 0.0, 38.0, 0.0)).text
    assert "finite" in sim.setpoint("generic", (0.0, 0.0, math.nan, 0.0, 43.0)).text


@pytest.mark.parametrize("yaw", [0.0, 1.0])
def test_ground_velocity_is_reached_whatever_the_heading(yaw):
    sim = hovering(yaw=yaw)
    stream(sim, 8.0, (1.0, -0.5, 0.3, 0.0), "ENUvelocity_yawrate")
    assert sim.truth.velocity == pytest.approx((1.0, -0.5, 0.3), abs=0.05)
    assert sim.truth.rpy[2] == pytest.approx(yaw, abs=0.01)


def test_body_velocity_turns_with_the_heading():
    sim = hovering(yaw=math.pi / 2)
    stream(sim, 8.0, (1.0, 0.5, 0.0, 0.0, float(0x4B)))
    assert sim.truth.velocity[:2] == pytest.approx((-0.5, 1.0), abs=0.05)


def test_ground_angles_tilt_towards_north_and_east():
    sim = hovering(yaw=2.0)
    stream(sim, 1.5, (0.0, 0.1, 38.3545, 0.0, float(0x29)))
    vx, vy, _ = sim.truth.velocity
    assert vy > 0.5 and abs(vx) < 0.1 * vy


def test_position_is_an_offset_that_a_constant_command_never_reaches():
    sim = hovering()
    stream(sim, 10.0, (1.0, 0.0, 5.0, 0.0), "ENUposition_yaw")
    assert sim.truth.position[0] > 5.0
    sim = hovering()
    sim.setpoint("ENUposition_yaw", (0.3, 0.0, 5.0, 0.0))
    sim.run(0.5)
    assert 0.0 < sim.truth.position[0] < 0.3


def test_closing_the_loop_over_the_offset_reaches_the_point():
    sim = hovering()
    for _ in range(500):
        x, y, _ = sim.truth.position
        sim.setpoint("ENUposition_yaw", (3.0 - x, 2.0 - y, 7.0, math.pi / 2))
        sim.run(0.02)
    assert sim.truth.position == pytest.approx((3.0, 2.0, 7.0), abs=0.1)
    assert sim.truth.rpy[2] == pytest.approx(math.pi / 2, abs=0.02)


def test_stable_bit_holds_position_in_wind_and_without_it_drifts():
    drift = []
    for flag in (0x49, 0x48):
        sim = hovering()
        sim.plant.wind = (5.0, 0.0, 0.0)
        stream(sim, 20.0, (0.0, 0.0, 0.0, 0.0, float(flag)))
        before = sim.truth.position[0]
        stream(sim, 10.0, (0.0, 0.0, 0.0, 0.0, float(flag)))
        drift.append(sim.truth.position[0] - before)
    assert abs(drift[0]) < 0.05 and drift[1] > 2.0


def test_weak_thrust_still_holds_and_lands():
    sim = hovering()
    sim.plant.thrust_gain = 0.75
    sim.run(10.0)
    assert abs(sim.truth.velocity[2]) < 0.02
    assert sim.task(6).result
    sim.run(20.0)
    assert sim.phase is Phase.STANDBY


def test_sticks_fly_in_p_and_tilt_in_a():
    sim = hovering()
    sim.rc.mode, sim.rc.roll, sim.rc.throttle = "P", 0.2, 0.25
    sim.run(6.0)
    assert sim.truth.velocity == pytest.approx((0.0, -2.0, 1.0), abs=0.05)
    sim.rc.mode = "A"
    sim.run(1.0)
    assert sim.truth.rpy[0] == pytest.approx(0.2 * 0.605 * 1.033, abs=0.01)


def test_lost_rc_flies_home_and_lands():
    sim = hovering(position=(6.0, 0.0, 25.0))
    sim.autopilot.start(sim.t, airborne=True)
    sim.plant.place((0.0, 0.0, 25.0))
    sim.rc.connected = False
    sim.run(2.9)
    assert sim.phase is Phase.FLYING
    sim.run(60.0)
    assert sim.phase is Phase.STANDBY
    assert sim.truth.position[:2] == pytest.approx((6.0, 0.0), abs=0.6)


def test_direct_lift_off_where_that_is_allowed():
    sim = simulator(setpoints_need_air=False)
    sim.control_authority(True)
    sim.arm(True)
    stream(sim, 1.0, (0.0, 0.0, 20.0, 0.0, 43.0))
    assert sim.autopilot.flight_status == 1 and sim.truth.position[2] == 0.0
    stream(sim, 1.0, (0.0, 0.0, 50.0, 0.0, 43.0))
    assert sim.autopilot.flight_status == 3 and sim.truth.position[2] > 0.3


def test_flying_into_the_ground_with_low_thrust_counts_as_landed():
    sim = hovering(position=(0.0, 0.0, 0.6))
    stream(sim, 2.0, (0.0, 0.0, 27.0, 0.0, 43.0))
    assert sim.autopilot.flight_status == 5 and not sim.plant.motors_on
