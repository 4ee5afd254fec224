# SPDX-License-Identifier: MIT
"""The simulator's own parameters come back from its flights, and intervals hold what they say."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identification_flights import excite, fly

from nmpc_control.analysis.identification.battery import identify_battery
from nmpc_control.analysis.identification.cli import main
from nmpc_control.analysis.identification.drag import identify_drag
from nmpc_control.analysis.identification.identify import identify
from nmpc_control.analysis.identification.passages import Stretch
from nmpc_control.analysis.identification.thrust import identify_thrust
from nmpc_control.analysis.identification.translation import motions
from nmpc_control.analysis.identification.vehicle_file import vehicle_yaml
from nmpc_control.analysis.record import Series
from nmpc_control.params import load_vehicle
from uav_sim.preset import load_preset

TOLERANCE = 0.03
DEAD_TIME = 0.01  # [s]


def close(value, expected, tolerance=TOLERANCE):
    assert value == pytest.approx(expected, rel=tolerance)


@pytest.fixture(scope="module")
def hil():
    return fly("dji_hil", 25.0, excite(25.0, hover=45.0))


@pytest.fixture(scope="module")
def document(hil, tmp_path_factory):
    """Return what the command writes about a bag of that flight."""
    folder = tmp_path_factory.mktemp("recovery")
    bag = hil.bag().write(folder / "simulated.bag")
    main([str(bag), "--quiet", "--json", str(folder / "out.json")])
    return json.loads((folder / "out.json").read_text())


def test_source_and_segment(document):
    assert document["source"] == "simulation"
    flown = [s for s in document["segments"] if s["kind"] == "flight"]
    assert sum(s["end"] - s["start"] for s in flown) > 24.0


@pytest.mark.parametrize("axis", ["roll", "pitch"])
def test_attitude(document, axis):
    preset, found = load_preset("dji_hil"), document["attitude"][axis]
    true = getattr(preset, axis)
    for name in ("gain", "omega", "zeta"):
        close(found[name], getattr(true, name))
        low, high = found["confidence"][name]
        assert low <= found[name] <= high
    delay = preset.delay.attitude + preset.delay.telemetry
    assert found["dead_time_s"] == pytest.approx(delay, abs=DEAD_TIME)
    assert found["fit_percent"] > 99.0


def test_tilt_limit(document):
    close(document["tilt_limit_rad"], load_preset("dji_hil").tilt_limit)


def test_yaw_rate(document):
    preset, found = load_preset("dji_hil"), document["yaw_rate"]
    for name in ("gain", "omega", "zeta"):
        close(found[name], getattr(preset.yaw_rate, name))
    delay = preset.delay.yaw_rate + preset.delay.telemetry
    assert found["dead_time_s"] == pytest.approx(delay, abs=DEAD_TIME)


def test_thrust_and_drag(document):
    preset, thrust, drag = load_preset("dji_hil"), document["thrust"], document["drag"]
    close(thrust["slope"], preset.thrust.slope)
    close(thrust["offset"], preset.thrust.offset)
    close(thrust["hover_percent"], preset.hover_percent)
    delay = preset.delay.thrust + preset.delay.telemetry
    assert thrust["dead_time_s"] == pytest.approx(delay, abs=DEAD_TIME)
    assert thrust["r2"] > 0.99
    assert thrust["lag_s"] is None
    assert "without a lag" in thrust["reason"]
    close(thrust["offset"], preset.thrust.offset, 0.001)  # velocity's interpolation is modelled
    for name, true in zip(("forward", "sideways", "vertical"), "xyz"):
        close(drag[name], getattr(preset.drag, true))


def test_plant_of_first_order():
    preset = load_preset("eth")
    found = identify([fly(preset, 16.0, excite(16.0, hover=33.0)).log()])
    for axis in ("roll", "pitch"):
        values = found.attitude.first[axis].values
        close(values["gain"], getattr(preset, axis).gain)
        close(values["time_constant_s"], getattr(preset, axis).time_constant)
        assert values["dead_time_s"] == pytest.approx(0.0, abs=DEAD_TIME)
        second = found.attitude.second[axis]
        assert second.values["omega"] is None
        assert "first-order" in second.reason
    close(found.thrust.map.slope, preset.thrust.slope)
    close(found.thrust.map.offset, preset.thrust.offset)
    close(found.drag.estimate.values["forward"], preset.drag.x)
    close(found.thrust.vertical_drag.values["vertical"], preset.drag.z)
    thrust = found.thrust.estimate
    close(thrust.values["lag_s"], preset.rotor_time_constant)
    assert thrust.values["dead_time_s"] == pytest.approx(0.0, abs=DEAD_TIME)
    low, high = thrust.confidence["lag_s"]
    assert 0.0 < low <= thrust.values["lag_s"] <= high
    text, _ = vehicle_yaml(found, "own", load_vehicle("eth"), None)
    assert "a lag of 0.050" in text


def thrust_of(log, end):
    return identify_thrust(motions([Stretch(log, 0.0, end)], -np.inf, np.inf))


def test_plant_without_lag_or_dead_time():
    preset = load_preset("paper")
    thrust = thrust_of(fly(preset, 10.0, excite(10.0, hover=40.0)).log(), 10.0)
    close(thrust.map.slope, preset.thrust.slope)
    close(thrust.estimate.values["hover_percent"], preset.hover_percent)
    close(thrust.map.vertical_drag, preset.drag.z)
    assert thrust.map.offset == pytest.approx(0.0, abs=TOLERANCE)
    assert thrust.estimate.values["lag_s"] is None
    assert thrust.estimate.values["dead_time_s"] == pytest.approx(0.0, abs=DEAD_TIME)


def test_lag_and_dead_time_are_told_apart_and_with_noise_their_sum_is():
    preset = replace(load_preset("dji_hil"), rotor_time_constant=0.05)
    recorded = fly(preset, 20.0, excite(20.0, hover=45.0))
    dead_time = preset.delay.thrust + preset.delay.telemetry
    thrust = thrust_of(recorded.log(), 20.0)
    close(thrust.estimate.values["lag_s"], 0.05)
    assert thrust.estimate.values["dead_time_s"] == pytest.approx(dead_time, abs=DEAD_TIME)
    close(thrust.map.slope, preset.thrust.slope)
    close(thrust.map.offset, preset.thrust.offset)
    for seed in range(3):
        late = thrust_of(noisy(recorded, seed), 20.0).map.late
        assert sum(late) == pytest.approx(dead_time + 0.05, abs=DEAD_TIME)


def noisy(recorded, seed):
    """Return the flight's log with white noise on attitude and velocity."""
    generator, log = np.random.default_rng(seed), recorded.log()

    def disturbed(series, deviation):
        return Series(
            series.times, series.values + generator.normal(0.0, deviation, series.values.shape)
        )

    return recorded.log(
        attitude=disturbed(log.attitude, 0.01), velocity=disturbed(log.velocity, 0.05)
    )


def test_noise_widens_the_intervals_and_is_itself_identified(hil):
    found = identify([noisy(hil, 1)])
    preset = load_preset("dji_hil")
    for axis in ("roll", "pitch"):
        estimate = found.attitude.second[axis]
        for name in ("gain", "omega", "zeta"):
            close(estimate.values[name], getattr(preset.roll, name))
            low, high = estimate.confidence[name]
            assert 0.0005 < (high - low) / estimate.values[name] < 0.1
    close(found.thrust.map.slope, preset.thrust.slope)
    thrust = found.thrust.estimate
    assert (thrust.values["lag_s"], thrust.confidence["lag_s"]) == (None, None)
    assert "cannot be told apart" in thrust.reason
    delay = preset.delay.thrust + preset.delay.telemetry
    assert thrust.values["dead_time_s"] == pytest.approx(delay, abs=DEAD_TIME)
    assert found.noise["attitude"][0] == pytest.approx(0.01, rel=0.1)
    assert found.noise["velocity"][0] == pytest.approx(0.05, rel=0.1)


def test_hover_thrust_follows_the_battery():
    """An aircraft that loses thrust with its charge: the curve is that of its hover thrust."""

    def charge(t):
        return 90.0 - 2.0 * t  # [percent] a fast discharge, for a short test

    def gain(t):
        return 0.85 + 0.002 * (charge(t) - 65.0)

    recorded = fly("dji_hil", 25.0, excite(25.0, hover=46.0, seed=3), thrust_gain=gain)
    times = np.arange(0.0, 25.0, 0.1)
    log = recorded.log(battery=Series(times, np.round(charge(times))[:, None]))
    thrust = identify_thrust(motions([Stretch(log, 0.0, 25.0)], -np.inf, np.inf))
    battery, preset = identify_battery(thrust), load_preset("dji_hil")
    assert len(battery.levels) > 30
    for level in battery.levels:
        lift = preset.gravity / (0.85 + 0.002 * (level["battery_percent"] - 65.0))
        close(level["hover_percent"], preset.thrust.percent(lift), 0.02)
    assert battery.slope < 0.0 < thrust.estimate.values["offset_per_charge"]


def test_hover_alone_gives_hover_thrust_and_no_map():
    preset = load_preset("dji_hil")
    log = fly(preset, 8.0, lambda t: (preset.hover_percent, 0.0, 0.0, 0.0)).log()
    thrust = identify_thrust(motions([Stretch(log, 0.0, 8.0)], -np.inf, np.inf))
    assert thrust.map is None
    assert thrust.estimate.values["slope"] is None
    assert "no excitation" in thrust.estimate.reason
    close(thrust.estimate.values["hover_percent"], preset.hover_percent, 0.001)


def test_velocity_that_comes_late_does_not_bias_the_drag(hil):
    log, preset = hil.log(), load_preset("dji_hil")
    late = Series(log.velocity.times + 0.13, log.velocity.values)
    thrust = identify_thrust(motions([Stretch(hil.log(velocity=late), 0.2, 24.0)], -np.inf, np.inf))
    drag = identify_drag(thrust).estimate.values
    assert drag["velocity_lag_s"] == pytest.approx(0.13, abs=0.005)
    close(drag["forward"], preset.drag.x)
    close(drag["sideways"], preset.drag.y)
