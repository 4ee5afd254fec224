import csv
import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_sim.battery import Battery, hover_thrust
from uav_sim.m100 import SimulatedM100
from uav_sim.phase import Phase
from uav_sim.preset import load_preset

MEASURED = Path(__file__).resolve().parents[3] / "shared/data/battery_hover_thrust.csv"
PRESET = load_preset("dji_hil")
MODEL = PRESET.battery


def flying(percent, **flight_controller):
    settings = dataclasses.replace(PRESET.flight_controller, **flight_controller)
    sim = SimulatedM100(dataclasses.replace(PRESET, flight_controller=settings))
    sim.place((0.0, 0.0, 5.0), authority=True)
    sim.battery = percent
    return sim


def test_sag_is_that_of_the_recorded_flights():
    if not MEASURED.is_file():
        pytest.skip(f"no measured hover thrust at {MEASURED}")
    with MEASURED.open() as stream:
        rows = [{k: float(v or 0) for k, v in row.items()} for row in csv.DictReader(stream)]
    # Single samples are no measurement; above 80 percent the flights had just begun.
    rows = [r for r in rows if r["samples"] > 1 and r["battery_percent"] < 80.0]
    errors = [
        hover_thrust(MODEL, r["battery_percent"]) - r["hover_thrust_percent_mean"] for r in rows
    ]
    assert len(rows) > 50 and max(map(abs, errors)) < 0.55
    mean_square = sum(e * e * r["samples"] for e, r in zip(errors, rows))
    assert (mean_square / sum(r["samples"] for r in rows)) ** 0.5 < 0.2


@given(st.floats(0.0, 100.0), st.floats(0.0, 100.0))
def test_less_charge_never_gives_more_thrust(a, b):
    low, high = sorted((a, b))
    assert 0.0 < Battery(MODEL, low).thrust_gain <= Battery(MODEL, high).thrust_gain <= 1.0


def test_a_hover_lasts_the_flight_time_and_a_heavy_one_less():
    light, heavy = Battery(MODEL), Battery(MODEL)
    light.discharge(1.0, MODEL.flight_time / 2)
    heavy.discharge(3.355 / 2.855, MODEL.flight_time / 2)
    assert light.percent == pytest.approx(50.0)
    # 17 min with 0.5 kg of payload, 13 min with 1 kg (doc/dji_sdk.md 7.1)
    assert (100.0 - light.percent) / (100.0 - heavy.percent) == pytest.approx(13 / 17, abs=0.03)


def test_charge_never_falls_below_empty():
    battery = Battery(MODEL, 1.0)
    battery.discharge(3.0, 1000.0)
    assert battery.percent == 0.0 and battery.thrust_gain < 0.3


def test_the_same_percentage_lifts_less_on_a_low_battery():
    sim = flying(50.0)
    assert sim.plant.hover_percent == pytest.approx(PRESET.hover_percent)
    sim.run(0.2)
    assert sim.plant.hover_percent > PRESET.hover_percent + 1.0
    for _ in range(50):
        sim.setpoint("generic", (0.0, 0.0, PRESET.hover_percent, 0.0, 43.0))
        sim.run(0.02)
    expected = 1.1 * 9.81 * (MODEL.hover_full / hover_thrust(MODEL, 50.0) - 1.0)  # in 1.1 s
    assert sim.truth.velocity[2] == pytest.approx(expected, rel=0.1)


def test_a_critical_battery_lands_whoever_is_in_control():
    sim = flying(10.0)
    for _ in range(10):
        sim.setpoint("generic", (0.0, 0.0, 45.0, 0.0, 43.0))
        sim.run(0.02)
    assert sim.phase is Phase.LANDING
    assert any("battery at 10 %: landing" in event for event in sim.autopilot.take_events())
    sim.rc.mode = "P"
    sim.run(0.1)
    assert sim.phase is Phase.LANDING
    sim.run(15.0)
    assert sim.phase in (Phase.LANDED, Phase.STANDBY) and not sim.plant.motors_on


def test_go_home_is_off_by_default_and_may_be_ended_by_the_pilot():
    as_in_the_papers_flights = flying(15.0)
    as_in_the_papers_flights.run(0.5)
    assert as_in_the_papers_flights.phase is Phase.FLYING
    sim = flying(25.0, battery_go_home=30.0)
    sim.plant.position = (30.0, 0.0, 5.0)
    sim.run(0.2)
    assert sim.phase is Phase.GOING_HOME
    sim.rc.mode = "P"
    sim.run(0.2)
    assert sim.phase is Phase.FLYING
    sim.run(0.5)
    assert sim.phase is Phase.FLYING


def test_an_empty_battery_does_not_carry():
    sim = flying(0.0)
    sim.run(2.0)
    assert sim.truth.velocity[2] < -2.0 or sim.plant.on_ground


def test_each_flight_is_sent_home_once():
    sim = SimulatedM100(load_preset("dji_hil", {"flight_controller": {"battery_go_home": 30.0}}))
    for _ in range(2):
        sim.place((0.0, 0.0, 10.0), authority=True)
        sim.plant.place((20.0, 0.0, 10.0))
        sim.battery = 25.0
        sim.run(1.0)
        assert sim.phase is Phase.GOING_HOME
