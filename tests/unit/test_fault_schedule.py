"""Faults by YAML: when they begin and end, how they add up, what is refused; all of it repeats."""

import hashlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_sim.config import config_directory
from uav_sim.disturbance import Disturbance, load_disturbance
from uav_sim.errors import ConfigError
from uav_sim.faults.kinds import KINDS
from uav_sim.faults.schedule import load_fault_file, load_faults
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset
from uav_sim.telemetry import Packet
from uav_sim.world import World

FILE = """
description: a bad day
faults:
  - {fault: topic_dropped, topic: velocity, probability: 0.3, start: 0.2, duration: 1.0}
  - {fault: wind_gust, velocity: [5, -3, 0], start: 0.5, duration: 1.5}
  - {fault: gps_lost, position: drifting, start: 1.0, duration: 0.5}
  - {fault: setpoints_ignored, probability: 0.2, start: 0, id: lossy}
  - {fault: motor_weak, loss: 0.2, start: 1.2}
  - {fault: topic_delayed, topic: attitude, delay: 0.1, start: 1.5, duration: 0.3}
"""


def aircraft(seed=1, level="harsh"):
    preset = load_preset("dji_hil")
    disturbance = Disturbance(load_disturbance(level), seed)
    sim = SimulatedM100(preset, World((), preset.radius), disturbance)
    sim.place((0.0, 0.0, 10.0), authority=True)
    return sim


def flight_hash(tmp_path, seed):
    """Return the sum of every packet and of the truth of 2.5 s with setpoints, wind and faults."""
    path = tmp_path / "faults.yaml"
    path.write_text(FILE)
    sim, digest = aircraft(seed), hashlib.sha256()
    for line in load_fault_file(str(path)):
        line.apply(sim.faults)
    for k in range(125):
        sim.setpoint("generic", (0.1 * math.sin(k), 0.05, 38.0, 0.2, 43.0))
        digest.update(repr([tuple(packet) for packet in sim.run(0.02)]).encode())
        digest.update(repr(sim.truth).encode())
    return digest.hexdigest()


def test_two_runs_are_identical_bit_for_bit_and_another_seed_is_not(tmp_path):
    first = flight_hash(tmp_path, seed=1)
    assert first == flight_hash(tmp_path, seed=1)
    assert first != flight_hash(tmp_path, seed=2)


def test_a_line_begins_and_ends_on_time():
    sim = aircraft(level="none")
    lines = load_faults([{"fault": "rc_mode", "mode": "P", "start": 0.1, "duration": 0.2}], "file")
    lines[0].apply(sim.faults)
    modes = []
    for _ in range(80):
        sim.step()
        modes.append((round(sim.t, 3), sim.rc.mode))
    assert [t for t, mode in modes if mode == "P"] == pytest.approx(
        [0.105 + 0.005 * k for k in range(40)]
    )


def test_each_change_is_told():
    told, sim = [], aircraft(level="none")
    sim.faults.on_change = told.append
    sim.faults.apply("rc_off", duration=0.05)
    sim.run(0.1)
    assert [line.split(" at ")[0] for line in told] == ["fault begins", "fault ends"]
    assert "rc_off_1" in told[0] and "rc_off_1" in told[1]


FACTORS = st.lists(st.floats(0.5, 2.0), min_size=1, max_size=4)


@settings(max_examples=25, deadline=None)
@given(FACTORS, st.randoms(use_true_random=False))
def test_faults_of_one_value_add_up_and_end_in_any_order(factors, order):
    sim = aircraft(level="none")
    ids = [sim.faults.apply("thrust_gain", factor=factor) for factor in factors]
    assert sim.plant.thrust_gain == pytest.approx(math.prod(factors))
    order.shuffle(ids)
    for id in ids:
        sim.faults.clear(id)
    assert sim.plant.thrust_gain == 1.0


def test_late_messages_come_at_once_when_the_delay_ends():
    sim = aircraft(level="none")
    sim.run(0.5)
    sim.faults.apply("topic_delayed", topic="all", delay=5.0)
    assert sim.run(0.5) == []
    sim.faults.clear()
    first = sim.step()
    assert len([p for p in first if p.topic == "attitude"]) >= 50


def test_what_is_sensed_is_no_part_of_the_link_and_keeps_its_time():
    sim = aircraft(level="none")
    sim.faults.apply("topic_dropped", topic="all")
    seen = [Packet("obstacles", 0.0, ()), Packet("vicon", 0.0, ()), Packet("imu", 0.0, ())]
    assert [p.topic for p in sim.faults.filter(0.0, seen)] == ["obstacles", "vicon"]
    sim.faults.apply("topic_delayed", topic="obstacles", delay=0.3)
    assert [p.topic for p in sim.faults.filter(0.0, seen)] == ["vicon"]
    assert sim.faults.filter(0.29, []) == []
    assert sim.faults.filter(0.3, []) == [Packet("obstacles", 0.0, ())]


def test_a_gust_rises_and_falls_like_a_cosine():
    sim = aircraft(level="none")
    sim.faults.apply("wind_gust", velocity=[4, 0, 0], rise=0.2, duration=1.0)
    winds = []
    for _ in range(240):
        sim.step()
        winds.append(sim.plant.gust[0])
    assert winds[20] == pytest.approx(2.0) and winds[100] == 4.0  # begun steps: 0.1 s, 0.5 s
    assert winds[180] == pytest.approx(2.0) and winds[-1] == 0.0


def test_a_drifting_position_drifts_as_fast_as_it_says():
    sim = aircraft(level="none")
    sim.run(0.5)
    sim.faults.apply("gps_lost", position="drifting", drift=2.0, velocity_drift=0.0)
    seen = [p.value for p in sim.run(1.0) if p.topic == "local_position"]
    assert math.dist(seen[-1], sim.truth.position) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ({"fault": "frozen"}, "faults[0]: fault: got 'frozen', expected one of topic_frozen"),
        ({"fault": "topic_nan", "topic": "gps_health"}, "topic_nan: topic: got 'gps_health'"),
        ({"fault": "topic_frozen"}, "topic_frozen: topic: got None, expected a value"),
        ({"fault": "rc_mode", "mode": "P", "start": -1}, "start: got -1, expected a finite number"),
        ({"fault": "rc_off", "duration": 0}, "duration: got 0, expected"),
        ({"fault": "rc_off", "id": ""}, "id: got '', expected a name"),
        ({"fault": "wind_gust", "velocity": [1, 2]}, "velocity: got [1, 2], expected a list of 3"),
        ({"fault": "thrust_gain", "factor": math.nan}, "factor: got nan"),
        ({"start": 3}, "faults[0]: got {'start': 3}, expected a mapping with fault"),
    ],
)
def test_a_wrong_line_is_refused_in_words(line, words):
    with pytest.raises(ConfigError) as error:
        load_faults([line], "faults.yaml")
    assert str(error.value).startswith("faults.yaml: faults[0]") and words in str(error.value)


def test_an_id_is_used_once():
    sim = aircraft(level="none")
    sim.faults.inject("rc_off", {}, id="x")
    with pytest.raises(ConfigError, match="an id that no other fault has"):
        sim.faults.inject("rc_mode", {"mode": "P"}, start=5.0, id="x")


def test_every_shipped_schedule_loads():
    paths = sorted((config_directory() / "faults").glob("*.yaml"))
    kinds = {line.kind for path in paths for line in load_fault_file(str(path))}
    assert kinds == set(KINDS)
