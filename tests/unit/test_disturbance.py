"""The levels: what their files say, and what an aircraft makes of them."""

import dataclasses
import math

import numpy as np
import pytest
import yaml

from uav_sim.config import config_directory
from uav_sim.disturbance import Disturbance, disturbance_names, load_disturbance
from uav_sim.errors import ConfigError
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset
from uav_sim.wind import GustSigma

PRESET = load_preset("dji_hil")
LEVELS = ("none", "indoor", "outdoor", "harsh")


def flight(disturbance, duration=2.0):
    """Return packets, poses and truth of a flight under setpoints."""
    sim = SimulatedM100(PRESET, None, disturbance)
    sim.place((0.0, 0.0, 10.0), authority=True)
    packets, poses = [], []
    for k in range(round(duration / PRESET.step)):
        if k % 4 == 0:
            sim.setpoint("generic", (0.02, 0.05, 38.4, 0.1, 43.0))
        packets += sim.step()
        poses += sim.new_poses
    return packets, poses, sim.truth


def drawn(name, seed=1, **changes):
    return Disturbance(dataclasses.replace(load_disturbance(name), **changes), seed)


def test_names():
    assert tuple(disturbance_names()) == LEVELS


@pytest.mark.parametrize(
    ("name", "wind", "gust", "position", "velocity", "degrees", "jitter", "loss", "gain", "mass"),
    [
        ("none", 0, 0, (0, 0), 0, 0, 0, 0, 0, 0),
        ("indoor", 0, 0.1, (0.002, 0), 0.02, 0.3, 0.005, 0, 0.03, 0.02),
        ("outdoor", 6, 1.5, (0.05, 0.5, 60), 0.1, 0.5, 0.02, 0, 0.15, 0.05),
        ("harsh", 10, 3, (0.2, 1.5, 30), 0.2, 1.0, 0.05, 0.02, 0.25, 0.10),
    ],
)
def test_the_table(name, wind, gust, position, velocity, degrees, jitter, loss, gain, mass):
    p = load_disturbance(name)
    assert (p.name, p.wind.speed, p.wind.gusts) == (name, wind, GustSigma(gust))
    drift = p.sensors.position
    assert (drift.white, drift.drift, drift.time_constant)[: len(position)] == position
    assert p.sensors.velocity.white == velocity
    assert p.sensors.attitude.white == pytest.approx(math.radians(degrees), rel=1e-3)
    assert (p.telemetry.jitter, p.telemetry.loss) == (jitter, loss)
    assert (p.command.jitter, p.command.loss) == (jitter, loss)
    assert (p.spread.thrust_gain, p.spread.mass) == (gain, mass)
    assert p.vicon.enabled is (name == "indoor") and p.vicon.dropout_time <= 0.2
    assert p.obstacles_share_drift


def test_none_changes_nothing_bit_for_bit():
    nothing = drawn("none")
    assert [nothing.sensors, nothing.telemetry, nothing.command, nothing.vicon] == [None] * 4
    assert nothing.wind(0.005) is None and nothing.shift is None
    assert (nothing.thrust_gain, nothing.mass_factor) == (1.0, 1.0)
    assert flight(nothing) == flight(None)


@pytest.mark.parametrize("name", LEVELS[1:])
def test_the_seed_decides_bit_for_bit(name):
    first = flight(drawn(name))
    assert first == flight(drawn(name))
    assert first != flight(drawn(name, seed=2))


def test_thrust_and_mass_are_drawn_evenly_within_their_spread():
    level = load_disturbance("harsh")
    many = [Disturbance(level, seed) for seed in range(400)]
    for values, spread in (
        ([d.thrust_gain for d in many], 0.25),
        ([d.mass_factor for d in many], 0.10),
    ):
        assert 1 - spread <= min(values) < 1 - 0.95 * spread
        assert 1 + 0.95 * spread < max(values) <= 1 + spread
        assert np.std(values) == pytest.approx(spread / math.sqrt(3), rel=0.1)
    gains, masses = zip(*((d.thrust_gain, d.mass_factor) for d in many))
    assert abs(np.corrcoef(gains, masses)[0, 1]) < 0.15


def test_the_plant_flies_the_draw():
    disturbance = drawn("harsh")
    sim = SimulatedM100(PRESET, None, disturbance)
    assert sim.plant.thrust_gain == disturbance.thrust_gain
    assert sim.plant.mass_factor == disturbance.mass_factor
    sim.place((0.0, 0.0, 10.0))
    sim.run(1.0)
    assert math.hypot(*sim.plant.wind[:2]) > 2.0


def test_concerns_draw_from_streams_of_their_own():
    """A calm day changes the flight, but not the errors of the sensors."""
    calm = load_disturbance("none").wind
    windy, quiet = drawn("outdoor"), drawn("outdoor", wind=calm)
    zero = (0.0, 0.0, 0.0)
    for _ in range(10):
        assert windy.sensors.navigation(zero, zero, 0.0) == quiet.sensors.navigation(
            zero, zero, 0.0
        )
    assert windy.thrust_gain == quiet.thrust_gain


def test_vehicles_share_the_air_and_nothing_else():
    level = load_disturbance("outdoor")
    first, second = (Disturbance(level, 1, vehicle) for vehicle in ("dji1", "dji2"))
    args = (10.0, (1.0, 0.0, 0.0))
    a, b = first.wind(0.005), second.wind(0.005)
    assert [a.advance(*args) for _ in range(50)] == [b.advance(*args) for _ in range(50)]
    assert first.thrust_gain != second.thrust_gain
    assert first.sensors.drift != second.sensors.drift


def test_indoors_there_is_no_gps_but_there_are_poses():
    packets, poses, truth = flight(drawn("indoor"))
    assert {p.value for p in packets if p.topic == "gps_health"} == {0}
    assert len(poses) > 150
    assert poses[-1].position == pytest.approx(truth.position, abs=0.15)


def edited(tmp_path, change):
    data = yaml.safe_load((config_directory() / "disturbances" / "outdoor.yaml").read_text())
    change(data)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    return str(path)


def test_a_level_of_ones_own(tmp_path):
    def change(data):
        data["wind"]["gusts"] = {"turbulence": "moderate"}
        data["topics"] = {"velocity": dict(data["telemetry"], delay=0.1)}

    p = load_disturbance(edited(tmp_path, change))
    assert p.wind.gusts.turbulence == "moderate"
    assert p.topics["velocity"].delay == 0.1
    assert flight(Disturbance(p, 1), 0.5) != flight(drawn("outdoor"), 0.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["wind"].update(speed=-1.0), "mine.yaml: wind.speed: got -1.0"),
        (lambda d: d["wind"].update(gusts={"turbulence": "wild"}), "wind.gusts.turbulence"),
        (lambda d: d["wind"].update(gusts={"sigma": 1.0, "turbulence": "light"}), "wind.gusts"),
        (lambda d: d["telemetry"].update(loss=1.5), "telemetry.loss: got 1.5"),
        (lambda d: d["telemetry"].update(order=True), "telemetry.order"),
        (lambda d: d["sensors"].pop("velocity"), "sensors.velocity: got None"),
        (lambda d: d["vicon"].update(rate=500.0), "vicon.rate: got 500.0"),
        (lambda d: d["spread"].update(mass=float("nan")), "spread.mass: got nan"),
        (lambda d: d.update(gps_health=6), "gps_health: got 6"),
        (lambda d: d.update(topics={"local_position": {}}), "topics.local_position"),
        (lambda d: d.update(topics=[]), r"topics: got \[\]"),
    ],
)
def test_a_wrong_level_is_named(tmp_path, change, words):
    with pytest.raises(ConfigError, match=words):
        load_disturbance(edited(tmp_path, change))


def test_an_unknown_level_is_named():
    with pytest.raises(ConfigError, match="'stormy', expected .* none, indoor, outdoor, harsh"):
        load_disturbance("stormy")
