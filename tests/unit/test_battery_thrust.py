# SPDX-License-Identifier: MIT
"""The battery's share of the thrust: curve, bounds, begun anew wherever thrust is not commanded."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from nmpc_control import dji
from nmpc_control.analysis.identification.thrust import Map
from nmpc_control.analysis.identification.thrust_fit import Late
from nmpc_control.analysis.identification.vehicle_file import _battery
from nmpc_control.battery_thrust import LEAST, RATE, BatteryCurve, BatteryThrust
from nmpc_control.config import from_dict
from nmpc_control.errors import ConfigError
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.params import load_vehicle
from uav_sim.battery import Battery
from uav_sim.preset import load_preset

CURVE = BatteryCurve(np.array([0.2, 0.7]), np.array([0.85, 1.0]))
LIMITS = load_guard_parameters().setpoint_limits


def test_the_curve_is_followed_at_once_where_nothing_is_commanded():
    thrust = BatteryThrust(CURVE)
    assert thrust.gain == 1.0
    for charge, gain in ((0.45, 0.925), (0.2, 0.85), (0.0, 0.85), (1.0, 1.0)):
        thrust.update(charge, 0.02, in_force=False)
        assert thrust.gain == pytest.approx(gain)


def test_in_flight_it_never_jumps():
    thrust = BatteryThrust(CURVE)
    thrust.update(1.0, 0.02, in_force=False)
    gains = [1.0]
    for _ in range(1000):
        thrust.update(0.2, 0.02, in_force=True)
        gains.append(thrust.gain)
    assert np.max(np.abs(np.diff(gains))) <= RATE * 0.02 + 1e-12
    assert gains[-1] == pytest.approx(0.85)


@pytest.mark.parametrize("charge", [np.nan, np.inf, -0.1, 1.5])
def test_a_charge_that_is_none_changes_nothing(charge):
    thrust = BatteryThrust(CURVE)
    thrust.update(0.45, 0.02, in_force=False)
    thrust.update(charge, 0.02, in_force=False)
    assert thrust.gain == pytest.approx(0.925)


def test_without_a_curve_the_map_stands():
    thrust = BatteryThrust(None)
    thrust.update(0.1, 0.02, in_force=False)
    assert thrust.gain == 1.0


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"charge": [0.2], "gain": [0.9]}, "charge: got"),
        ({"charge": [0.7, 0.2], "gain": [1.0, 0.9]}, "charge: got"),
        ({"charge": [0.2, 0.7], "gain": [0.9]}, "gain: got"),
        ({"charge": [0.2, 0.7], "gain": [LEAST - 0.1, 1.0]}, "gain[0]: got"),
        ({"charge": [20, 70], "gain": [0.9, 1.0]}, "charge[0]: got 20"),
    ],
)
def test_bad_curves_are_refused_in_words(data, words):
    with pytest.raises(ConfigError) as error:
        from_dict(BatteryCurve, data, "own.yaml")
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["dji_hil", "eth", "paper"])
def test_the_curves_that_ship_are_the_simulators_battery(name):
    vehicle, battery = load_vehicle(name), Battery(load_preset(name).battery)
    for percent in range(5, 101, 5):
        battery.percent = float(percent)
        assert vehicle.battery.at(percent / 100.0) == pytest.approx(battery.thrust_gain, abs=0.01)


def test_what_is_commanded_makes_up_for_the_battery_and_what_is_told_is_what_acts():
    vehicle = load_vehicle("eth")
    full, low = (dji.attitude_thrust_axes([9.81, 0, 0, 0], vehicle, LIMITS, g) for g in (1.0, 0.9))
    assert low[2] > full[2]
    assert 0.9 * vehicle.thrust_map.thrust(low[2]) == pytest.approx(9.81)
    assert dji.input_from_axes(low, vehicle, 0.9)[0] == pytest.approx(9.81)


def test_what_the_motors_cannot_give_is_not_told_as_given():
    vehicle = load_vehicle("dji_hil")
    narrow = dataclasses.replace(vehicle.thrust_map, maximum=40.0)
    vehicle = dataclasses.replace(vehicle, thrust_map=narrow)
    axes = dji.attitude_thrust_axes([12.0, 0, 0, 0], vehicle, LIMITS, 0.9)
    assert axes[2] == 40.0
    applied = dji.input_from_axes(axes, vehicle, 0.9)[0]
    assert applied == pytest.approx(0.9 * narrow.thrust(40.0))


def test_an_identified_slope_becomes_a_curve_of_the_vehicle_file():
    """Hover is at 38 % of thrust at a charge of 60 %, and 0.1 % more for each percent less."""
    thrust_map = Map(0.2, 9.81 - 0.2 * 38.0, 0.0, Late(0.1))
    estimate = SimpleNamespace(values={"charge_percent": 60.0})
    levels = tuple({"battery_percent": c, "samples": 30} for c in (30.0, 60.0, 90.0))
    found = SimpleNamespace(
        thrust=SimpleNamespace(map=thrust_map, estimate=estimate),
        battery=SimpleNamespace(slope=-0.1, levels=levels),
    )
    text = "".join(f"{line}\n" for line, _ in _battery(found))
    curve = from_dict(BatteryCurve, yaml.safe_load(text)["battery"], "own.yaml")
    assert curve.charge == pytest.approx([0.3, 0.5, 0.7, 0.9])
    for charge in (30.0, 50.0, 70.0, 90.0):
        hover = 38.0 - 0.1 * (charge - 60.0)
        assert curve.at(charge / 100.0) * thrust_map.thrust(hover) == pytest.approx(9.81, rel=1e-3)
    found.battery.slope = None
    assert _battery(found) == []
