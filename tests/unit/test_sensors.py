"""Errors of the sensors and of the links, by themselves and in what an aircraft reports."""

import dataclasses
import math

import numpy as np
import pytest

from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.link import Channel, Link, LinkParameters, TelemetryLink
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset
from uav_sim.sensors import ErrorParameters, ErrorProcess
from uav_sim.world import World

PRESET = load_preset("dji_hil")
OUTDOOR = load_disturbance("outdoor")
CALM = dataclasses.replace(
    OUTDOOR,
    wind=load_disturbance("none").wind,
    spread=load_disturbance("none").spread,
    telemetry=load_disturbance("none").telemetry,
)
HERE = (3.0, -2.0, 10.0)


def hovering(level, seed=1, duration=10.0):
    """Return the packets of an aircraft held still in the air."""
    sim = SimulatedM100(PRESET, None, Disturbance(level, seed))
    sim.place(HERE)
    packets = []
    for _ in range(round(duration / PRESET.step)):
        packets += sim.step()
        sim.plant.place(HERE)
    return packets


def values(packets, topic):
    return np.array([p.value for p in packets if p.topic == topic])


@pytest.mark.parametrize("period", [0.5, 2.0])
def test_drift_has_its_sigma_and_its_time_constant(period):
    process = ErrorProcess(ErrorParameters(0.0, 0.5, 10.0), period, "1")
    drift = np.array([process.added((0.0, 0.0, 0.0)) for _ in range(20000)])
    assert drift.std(axis=0) == pytest.approx([0.5] * 3, rel=0.1)
    for seconds in (2, 10):
        lag = round(seconds / period)
        measured = np.mean(drift[lag:] * drift[:-lag]) / np.mean(drift * drift)
        assert measured == pytest.approx(math.exp(-seconds / 10.0), abs=0.05)


def test_drift_begins_as_after_a_long_time():
    first = [ErrorProcess(ErrorParameters(0.0, 0.5, 60.0), 0.02, str(k)).drift for k in range(1000)]
    assert np.std(first) == pytest.approx(0.5, rel=0.06)


def test_white_noise_is_independent_from_sample_to_sample():
    process = ErrorProcess(ErrorParameters(0.2, 0.0, 60.0), 0.02, "1")
    noise = np.array([process.added((1.0, 2.0, 3.0)) for _ in range(20000)]) - (1.0, 2.0, 3.0)
    assert noise.std(axis=0) == pytest.approx([0.2] * 3, rel=0.03)
    assert abs(np.mean(noise[1:] * noise[:-1])) / 0.04 < 0.02
    assert abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.03, "axes are independent"


def test_every_quantity_has_the_sigma_of_the_level():
    packets = hovering(CALM, duration=20.0)
    sensors = OUTDOOR.sensors
    position = values(packets, "local_position")
    assert np.diff(position, axis=0).std() / math.sqrt(2) == pytest.approx(0.05, rel=0.1)
    assert values(packets, "velocity").std() == pytest.approx(0.1, rel=0.05)
    x, y, z, w = values(packets, "attitude").T
    assert (2 * x).std() == pytest.approx(math.radians(0.5), rel=0.06)
    assert (2 * z).std() == pytest.approx(math.radians(0.5), rel=0.06)
    imu = [p.value for p in packets if p.topic == "imu"]
    gyroscope = np.diff([v.angular_velocity for v in imu], axis=0).std() / math.sqrt(2)
    assert gyroscope == pytest.approx(sensors.gyroscope.white, rel=0.05)
    force = np.diff([v.linear_acceleration for v in imu], axis=0).std() / math.sqrt(2)
    assert force == pytest.approx(sensors.accelerometer.white, rel=0.05)


def test_attitude_and_imu_orientation_are_one_measurement():
    packets = hovering(CALM, duration=0.5)
    imu = [p.value.orientation for p in packets if p.topic == "imu"]
    assert imu == [p.value for p in packets if p.topic == "attitude"]


def test_the_barometers_offset_stays_and_differs_between_flights():
    level = dataclasses.replace(
        CALM, sensors=dataclasses.replace(CALM.sensors, height=ErrorParameters(0.0, 0.0, 1.0))
    )
    offsets = []
    for seed in range(60):
        heights = values(hovering(level, seed, duration=0.1), "height_above_takeoff")
        assert np.ptp(heights) < 1e-9
        offsets.append(heights[0] - 10.0)
    assert np.std(offsets) == pytest.approx(0.3, rel=0.3)


def test_obstacles_share_the_slow_error_of_the_position_also_that_of_its_reference():
    ball = {"id": "ball", "position": [8.0, 0.0, 0.0], "radius": 1.0}
    drift = dataclasses.replace(CALM.sensors.position, white=0.0)
    level = dataclasses.replace(CALM, sensors=dataclasses.replace(CALM.sensors, position=drift))
    sim = SimulatedM100(PRESET, World.from_list([ball], 0.5), Disturbance(level, 5))
    sim.run(0.5)
    assert sim.set_local_position_reference()
    packets = sim.run(15.0)
    reported = [p.value for p in packets if p.topic == "local_position"][-1]
    (seen,) = sim.sensed_obstacles
    (true,) = sim.world.states()
    assert true.position == (8.0, 0.0, 0.0)
    error = np.subtract(reported, sim.truth.position)
    assert np.linalg.norm(error) > 0.1, "or the test shows nothing"
    assert np.subtract(seen.position, true.position) == pytest.approx(error, abs=0.03)
    relative = np.subtract(seen.position, reported)
    assert relative == pytest.approx((8.0, 0.0, 0.0), abs=0.03)
    apart = Disturbance(dataclasses.replace(level, obstacles_share_drift=False), 5)
    assert apart.shift is None


@pytest.mark.parametrize("level", ["indoor", "outdoor", "harsh"])
def test_stamps_grow_within_each_topic_and_arrive_with_their_step(level):
    sim = SimulatedM100(PRESET, None, Disturbance(load_disturbance(level), 2))
    sim.place(HERE)
    last, late = {}, []
    for _ in range(2000):
        for packet in sim.step():
            assert packet.t <= sim.t + 1e-9
            assert packet.t > last.get(packet.topic, -1.0)
            last[packet.topic] = packet.t
            if packet.topic == "attitude":
                late.append(packet.t)
    assert len(last) == 12


def test_jitter_is_added_to_the_dead_time_of_the_preset():
    link = Link(LinkParameters(0.0, 0.02, 0.0, 0.0, True), np.random.default_rng(1))
    extra = [link.arrival(0.1 * k) - 0.1 * k for k in range(2000)]
    assert 0.0 <= min(extra) < 0.001 and 0.019 < max(extra) <= 0.02
    assert np.mean(extra) == pytest.approx(0.01, rel=0.05)


def test_a_serial_line_keeps_the_order_and_its_spacing():
    link = Link(LinkParameters(0.0, 0.05, 0.0, 0.005, False), np.random.default_rng(1))
    arrivals = np.array([link.arrival(0.01 * k) for k in range(5000)])
    assert np.diff(arrivals).min() == pytest.approx(0.005)
    assert (arrivals - 0.01 * np.arange(5000)).max() < 0.1, "no queue builds up"


def test_reordering_only_when_told():
    def arrivals(reorder):
        link = Link(LinkParameters(0.0, 0.05, 0.0, 0.0, reorder), np.random.default_rng(1))
        return np.diff([link.arrival(0.01 * k) for k in range(500)])

    assert arrivals(False).min() >= 0.0
    assert arrivals(True).min() < 0.0


def test_loss_is_a_share_of_whole_packets():
    packets = hovering(dataclasses.replace(CALM, telemetry=load_disturbance("harsh").telemetry), 1)
    counts = {t: len(values(packets, t)) for t in ("velocity", "gps_health", "flight_status")}
    assert len(set(counts.values())) == 1
    attitudes = sum(p.topic == "attitude" for p in packets)
    assert attitudes == pytest.approx(0.98 * 993, abs=15) and attitudes < 990


def test_a_topic_may_have_a_link_of_its_own():
    slow = LinkParameters(0.1, 0.0, 0.5, 0.0, False)
    packets = LinkParameters(0.0, 0.0, 0.0, 0.0, False)
    link = TelemetryLink(packets, {"velocity": slow}, "1")
    got = [link.arrivals(1.0 * k, [("attitude", 0), ("velocity", 1)]) for k in range(1000)]
    assert all(parts[0] == (1.0 * k, "attitude", 0) for k, parts in enumerate(got))
    late = [parts[1][0] - 1.0 * k for k, parts in enumerate(got) if len(parts) > 1]
    assert len(late) == pytest.approx(500, abs=60)
    assert late == pytest.approx([0.1] * len(late))


def test_a_slow_topic_is_stamped_when_it_comes():
    topics = {"velocity": LinkParameters(0.1, 0.0, 0.0, 0.0, False)}
    sim = SimulatedM100(PRESET, None, Disturbance(dataclasses.replace(CALM, topics=topics)))
    stamps = {"velocity": [], "flight_status": []}
    for packet in sim.run(1.0):
        if packet.topic in stamps:
            stamps[packet.topic].append(packet.t)
    assert stamps["velocity"][0] - stamps["flight_status"][0] == pytest.approx(0.1)
    assert len(stamps["flight_status"]) - len(stamps["velocity"]) == 5


def test_commands_come_late_in_order_or_not_at_all():
    rng = np.random.default_rng(1)
    channel = Channel(LinkParameters(0.0, 0.05, 0.1, 0.0, False), rng)
    got = []
    for k in range(1000):
        channel.send(0.02 * k, k)
        got += channel.receive(0.02 * k)
    assert got == sorted(got)
    assert len(got) == pytest.approx(900, abs=40)


def test_a_command_acts_when_it_arrives():
    command = LinkParameters(0.2, 0.0, 0.0, 0.0, False)
    none = load_disturbance("none")
    times = {}
    for name, level in (("now", none), ("late", dataclasses.replace(none, command=command))):
        sim = SimulatedM100(PRESET, None, Disturbance(level))
        sim.place((0.0, 0.0, 10.0), authority=True)
        while sim.truth.rpy[1] < 0.02:
            assert sim.setpoint("generic", (0.0, 0.1, 38.4, 0.0, 43.0)).accepted
            sim.step()
        times[name] = sim.t
    assert times["late"] - times["now"] == pytest.approx(0.2, abs=0.006)


def test_what_becomes_of_a_late_command_is_said():
    level = dataclasses.replace(
        load_disturbance("none"), command=LinkParameters(0.1, 0.0, 0.0, 0.0, False)
    )
    sim = SimulatedM100(PRESET, None, Disturbance(level))
    sim.place((0.0, 0.0, 10.0))
    assert sim.setpoint("generic", (0.0, 0.1, 38.4, 0.0, 43.0)).accepted
    receipts = []
    for _ in range(40):
        sim.step()
        receipts += sim.late_receipts
    assert [r.accepted for r in receipts] == [False]
    assert "authority" in receipts[0].text


def test_dji_holds_the_position_that_it_measures():
    """Under drift the aircraft wanders, so that the reported place stands still."""
    perfect = ErrorParameters(0.0, 0.0, 1.0)
    sensors = dataclasses.replace(
        CALM.sensors, position=ErrorParameters(0.0, 0.5, 60.0), velocity=perfect
    )
    level = dataclasses.replace(CALM, sensors=sensors, command=load_disturbance("none").command)
    sim = SimulatedM100(PRESET, None, Disturbance(level, 3))
    sim.place(HERE)
    sim.run(5.0)
    start, felt = sim.truth.position, []
    wandered = 0.0
    for _ in range(60):
        packets = sim.run(0.5)
        felt.append([p.value for p in packets if p.topic == "local_position"][-1])
        wandered = max(wandered, math.dist(start[:2], sim.truth.position[:2]))
    assert wandered > 0.15
    assert np.std(felt, axis=0)[:2].max() < 0.5 * wandered
    assert sim.truth.position[2] == pytest.approx(10.0, abs=0.05), "height comes from elsewhere"
