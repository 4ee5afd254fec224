import dataclasses
import math
from collections import Counter

import pytest

from uav_sim.m100 import SimulatedM100
from uav_sim.preset import Drag, load_preset
from uav_sim.telemetry import LocalFrame, body_rates, quaternion, to_body

PRESET = load_preset("dji_hil")
RATES = {
    "attitude": 100,
    "imu": 100,
    "rc": 50,
    "gps_health": 50,
    "gps_position": 50,
    "local_position": 50,
    "height_above_takeoff": 50,
    "velocity": 50,
    "flight_status": 50,
    "gimbal_angle": 50,
    "battery_state": 10,
}


def hovering(**place):
    sim = SimulatedM100(PRESET)
    sim.place((0.0, 0.0, 5.0), **place)
    return sim


def latest(packets, topic):
    return [p.value for p in packets if p.topic == topic][-1]


def test_rates():
    sim = hovering()
    sim.run(0.1)
    counts = Counter(p.topic for p in sim.run(10.0))
    assert {topic: counts[topic] / 10 for topic in counts} == RATES


def test_order_within_a_packet():
    sim = hovering()
    by_stamp = {}
    for packet in sim.run(1.0):
        by_stamp.setdefault(packet.t, []).append(packet.topic)
    order = list(max(by_stamp.values(), key=len))
    assert order == [
        *("local_frame_ref",) * ("local_frame_ref" in order),
        *("rc", "attitude", "imu", "gps_health", "gps_position", "local_position"),
        *("height_above_takeoff", "velocity", "battery_state", "flight_status", "gimbal_angle"),
    ]


def test_values_are_late_by_the_dead_time_and_stamped_on_receipt():
    sim = hovering(velocity=(1.0, 0.0, 0.0))
    sim.run(1.0)
    before = {}
    for _ in range(40):
        before[round(sim.t, 6)] = sim.truth
        for packet in sim.step():
            assert packet.t == pytest.approx(sim.t, abs=1e-9)
            if packet.topic == "velocity" and round(sim.t - 0.025, 6) in before:
                assert packet.value == before[round(sim.t - 0.025, 6)].velocity
                before["seen"] = True
    assert before["seen"]


def test_dead_time_off_the_grid_is_exact_in_the_stamp():
    delay = dataclasses.replace(PRESET.delay, telemetry=0.0271)
    sim = SimulatedM100(dataclasses.replace(PRESET, delay=delay))
    assert sim.run(0.03) == []
    packets = sim.run(0.01)
    assert packets[0].t == pytest.approx(0.0371)


def test_level_facing_north():
    sim = hovering(yaw=math.pi / 2)
    half = math.sqrt(0.5)
    packets = sim.run(0.2)
    assert latest(packets, "attitude") == pytest.approx((0.0, 0.0, half, half))
    assert latest(packets, "gimbal_angle") == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_imu_at_rest_feels_gravity_upwards():
    sim = SimulatedM100(PRESET)
    imu = latest(sim.run(0.2), "imu")
    assert imu.linear_acceleration == pytest.approx((0.0, 0.0, 9.801))
    assert imu.angular_velocity == (0.0, 0.0, 0.0)


def test_imu_in_flight_feels_thrust_along_body_z_only():
    sim = SimulatedM100(dataclasses.replace(PRESET, drag=Drag("world", 0.0, 0.0, 0.0)))
    sim.place((0.0, 0.0, 50.0), authority=True)
    for _ in range(100):
        sim.setpoint("generic", (0.1, 0.15, 45.0, 0.3, 43.0))
        packets = sim.run(0.02)
    force = latest(packets, "imu").linear_acceleration
    thrust = 9.801 / 9.81 * (0.1732 * 45.0 + 3.167)
    assert force == pytest.approx((0.0, 0.0, thrust), abs=0.01)


def test_attitude_and_rates_agree():
    rpy, rates, h = (0.3, -0.4, 1.2), (0.5, 0.2, -0.7), 1e-6
    q0 = quaternion(*rpy)
    q1 = quaternion(*(a + h * r for a, r in zip(rpy, rates)))
    x, y, z, w = q0
    dx, dy, dz, dw = ((b - a) / h for a, b in zip(q0, q1))
    # omega_body = 2 conj(q) dq/dt
    expected = (
        2 * (w * dx - x * dw - y * dz + z * dy),
        2 * (w * dy - y * dw - z * dx + x * dz),
        2 * (w * dz - z * dw - x * dy + y * dx),
    )
    assert body_rates(rpy, rates) == pytest.approx(expected, abs=1e-5)


def test_world_vectors_in_body_axes():
    assert to_body((0.0, 0.0, math.pi / 2), (0.0, 2.0, 0.0)) == pytest.approx((2.0, 0.0, 0.0))
    down_ahead = to_body((0.0, 0.1, 0.0), (0.0, 0.0, 1.0))
    assert down_ahead == pytest.approx((-math.sin(0.1), 0.0, math.cos(0.1)))
    right_down = to_body((0.1, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert right_down == pytest.approx((0.0, math.sin(0.1), math.cos(0.1)))


def test_local_position_returns_the_world_position():
    frame = LocalFrame(PRESET.home)
    frame.reference = PRESET.home
    position = (123.0, -45.0, 6.0)
    assert frame.to_local(frame.to_earth(position)) == pytest.approx(position, abs=1e-6)
    north = frame.to_earth((0.0, 1000.0, 0.0))
    assert north.latitude - PRESET.home.latitude == pytest.approx(math.degrees(1000.0 / 6378137.0))


def test_local_position_only_after_its_reference():
    sim = SimulatedM100(PRESET)
    assert sim.set_local_position_reference() is False, "nothing received yet"
    packets = sim.run(1.0)
    assert "local_position" not in {p.topic for p in packets}
    assert sim.set_local_position_reference() is True
    packets = sim.run(0.1)
    assert [p.topic for p in packets].count("local_frame_ref") == 1
    assert latest(packets, "local_position") == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_reference_needs_gps_health_above_3_and_failure_clears_it():
    sim = hovering()
    sim.run(0.1)
    sim.autopilot.gps_health = 3
    sim.run(0.1)
    assert sim.set_local_position_reference() is False
    sim.run(0.1)
    assert "local_position" not in {p.topic for p in sim.run(0.1)}


def test_rc_axes():
    sim = SimulatedM100(PRESET)
    sim.rc.roll, sim.rc.throttle = 0.5, -1.0
    assert latest(sim.run(0.1), "rc") == (0.5, 0.0, 0.0, -1.0, 8000.0, -10000.0)
    sim.rc.mode, sim.rc.gear = "P", "down"
    assert latest(sim.run(0.1), "rc")[4:] == (-8000.0, -4545.0)
    sim.rc.connected = False
    assert latest(sim.run(0.1), "rc")[5] == 0.0


def test_battery_discharges_in_percent_with_motors_on():
    sim = hovering()
    assert latest(sim.run(0.2), "battery_state") == 100.0
    sim.run(PRESET.battery.flight_time / 50)
    assert latest(sim.run(0.2), "battery_state") == 98.0
    standing = SimulatedM100(PRESET)
    standing.run(5.0)
    assert standing.battery == 100.0


def test_height_counts_from_take_off():
    assert latest(hovering().run(0.2), "height_above_takeoff") == pytest.approx(5.0, abs=1e-3)


def test_two_runs_are_identical():
    def flight():
        sim = SimulatedM100(PRESET)
        sim.run(0.1)
        sim.control_authority(True)
        sim.task(4)
        return sim.run(6.0)

    assert flight() == flight()
