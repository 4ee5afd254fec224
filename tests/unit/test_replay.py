import dataclasses
import functools
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from analysis_bags import BagBuilder, header, xyz

from nmpc_control.analysis.record import Series
from uav_sim.closed_loop.replay.cli import main
from uav_sim.closed_loop.replay.recorded import Recorded
from uav_sim.closed_loop.replay.scores import fit_percent, r_squared
from uav_sim.closed_loop.replay.segments import airborne_segments
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset

REPOSITORY = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("M100_BAGS", REPOSITORY.parent / "shared" / "data"))
FLOWN = 12.0  # [s]
BIAS = 0.25  # [m/s^2]


def command(t):
    """Return roll, pitch, thrust, yaw rate of a lively flight that neither falls nor climbs far."""
    roll = 0.5 * math.sin(2.1 * t) if t % 5.0 < 3.0 else 0.0
    pitch = 0.4 * math.copysign(1.0, math.sin(1.7 * t))
    return roll, pitch, 42.0 + 6.0 * math.sin(1.3 * t), 0.3 * math.sin(0.5 * t)


@functools.lru_cache(maxsize=None)
def simulated_flight(scale=1.0):
    """Return what a simulated aircraft with a biased thrust map did; its angles are scaled."""
    preset = load_preset("dji_hil")
    thrust = dataclasses.replace(preset.thrust, offset=preset.thrust.offset + BIAS)
    sim = SimulatedM100(dataclasses.replace(preset, thrust=thrust))
    sim.place((0.0, 0.0, 50.0), authority=True)
    bag, start = BagBuilder(), 100.0
    for _ in range(round(FLOWN * 50)):
        axes = command(sim.t)
        sim.setpoint("generic", (scale * axes[0], scale * axes[1], *axes[2:], 43.0))
        bag.setpoint(start + sim.t, *axes)
        for packet in sim.run(0.02):
            values = {"header": header(start + packet.t)}
            if packet.topic == "attitude":
                values["quaternion"] = dict(zip("xyzw", packet.value))
                kind = "geometry_msgs/msg/QuaternionStamped"
            elif packet.topic == "velocity":
                values["vector"] = xyz(packet.value)
                kind = "geometry_msgs/msg/Vector3Stamped"
            else:
                continue
            bag.add(f"dji_sdk/{packet.topic}", kind, start + packet.t, values)
    return bag


def replayed(bag, tmp_path, *options):
    main([str(bag), "--json", str(tmp_path / "out.json"), "--quiet", *map(str, options)])
    assert (tmp_path / "out.png").stat().st_size > 10_000
    return json.loads((tmp_path / "out.json").read_text())


def test_a_simulated_flight_replays_as_it_was(tmp_path):
    figures = replayed(simulated_flight().write(tmp_path / "own.bag"), tmp_path)
    assert figures["roll"]["fit_percent"] > 97.0 and figures["pitch"]["fit_percent"] > 97.0
    assert figures["vertical_velocity"]["r2"] > 0.999
    assert figures["thrust_bias_mps2"] == pytest.approx(BIAS, abs=0.01)
    assert figures["attitude_scale"] == 1.0 and figures["plant"] == "dji_hil"
    assert [row["duration_s"] > 11.0 for row in figures["segments"]] == [True]


def test_another_plant_fits_worse_and_says_its_name(tmp_path):
    bag = simulated_flight().write(tmp_path / "own.bag")
    figures = replayed(bag, tmp_path, "--plant", "eth", "--start", 2, "--end", 9)
    assert figures["plant"] == "eth"
    assert figures["roll"]["fit_percent"] < 90.0
    assert figures["segments"][0]["start_s"] >= 2.0 and figures["segments"][-1]["end_s"] <= 9.0


def test_angles_that_follow_a_fraction_of_the_command_are_told(tmp_path):
    bag = simulated_flight(0.2).write(tmp_path / "own.bag")
    figures = replayed(bag, tmp_path)
    assert figures["attitude_scale"] == pytest.approx(0.2, abs=0.005)
    assert figures["roll"]["fit_percent"] > 95.0
    assert any("times 0.2" in remark for remark in figures["remarks"])
    as_commanded = replayed(bag, tmp_path, "--attitude-scale", 1)
    assert as_commanded["roll"]["fit_percent"] < 0.0


@pytest.mark.parametrize(
    ("topic", "words"),
    [
        ("setpoint_generic", "no commands"),
        ("velocity", "no velocity"),
        ("attitude", "no attitude"),
    ],
)
def test_what_is_missing_is_named_in_one_line(tmp_path, capsys, topic, words):
    bag = simulated_flight().without(topic).write(tmp_path / "part.bag")
    with pytest.raises(SystemExit) as stop:
        main([str(bag)])
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and str(bag) in error and words in error


def recording(vz, thrust=40.0, status=None):
    """Return a recording at 50 Hz from vertical velocities (n,) and thrusts."""
    times = 0.02 * np.arange(len(vz))
    commands = np.zeros((len(vz), 4))
    commands[:, 0] = thrust
    velocity = np.stack([0.0 * times, 0.0 * times, vz], axis=1)
    flight_status = None if status is None else Series(times, np.full((len(vz), 1), status))
    return Recorded(
        Series(times, commands), Series(times, np.zeros_like(velocity)), Series(times, velocity),
        flight_status, "unknown",
    )  # fmt: skip


def test_touching_the_ground_splits_a_flight():
    sinking = np.r_[np.linspace(1.0, -2.0, 200), np.linspace(0.5, 1.0, 300)]
    segments = airborne_segments(recording(sinking), 38.0)
    assert [(round(s.start, 2), round(s.end, 2)) for s in segments] == [(0.0, 3.98), (4.0, 9.98)]


def test_standing_with_idle_thrust_is_not_flying_but_hovering_is():
    still = np.zeros(300)
    assert airborne_segments(recording(still, thrust=25.0), 38.0) == []
    assert len(airborne_segments(recording(still, thrust=38.0), 38.0)) == 1
    assert airborne_segments(recording(still, thrust=38.0, status=1), 38.0) == []


def test_scores_of_known_arrays():
    y = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(4, 1.5)) == pytest.approx(0.0)
    assert fit_percent(np.ones(4), y) is None
    assert r_squared([y, y], [y, np.full(4, 1.5)]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "window", "regime"), [("m100exp03", (40, 74), 1.0), ("m100exp01", (6, 33), 0.198)]
)
def test_recorded_flights_are_reproduced(tmp_path, name, window, regime):
    bag = DATA / f"{name}.bag"
    if not bag.is_file():
        pytest.skip(f"no recorded flight at {bag}; set M100_BAGS to the folder that has it")
    figures = replayed(bag, tmp_path, "--start", window[0], "--end", window[1])
    assert figures["roll"]["fit_percent"] >= 93.0
    assert figures["pitch"]["fit_percent"] >= 93.0
    long = [row for row in figures["segments"] if row["duration_s"] >= 10.0]
    assert long and all(row["vertical_velocity"]["r2"] >= 0.9 for row in long)
    assert abs(figures["thrust_bias_mps2"]) < 0.1
    assert figures["attitude_scale"] == pytest.approx(regime, abs=0.01)
