import dataclasses

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_sim.errors import ConfigError
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import FirstOrder, load_preset
from uav_sim.spread import any_preset, spread


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**9))
def test_every_draw_lies_between_or_near_the_presets(seed):
    drawn, presets = spread(seed), [load_preset(n) for n in ("dji_hil", "eth", "paper")]

    def near(read, slack=0.02):
        values = [read(p) for p in presets]
        return min(values) * (1 - slack) - 1e-9 <= read(drawn) <= max(values) * (1 + slack) + 1e-9

    assert near(lambda p: p.mass, 0.11) and near(lambda p: p.hover_percent)
    assert near(lambda p: p.thrust.slope) and near(lambda p: p.rotor_time_constant)
    assert near(lambda p: p.drag.x) and near(lambda p: p.drag.y) and near(lambda p: p.drag.z)
    assert near(lambda p: p.delay.attitude + p.delay.telemetry)
    assert near(lambda p: p.delay.thrust + p.delay.telemetry)
    assert near(lambda p: p.roll.gain) and near(lambda p: p.tilt_limit, 0.14)


def test_a_seed_is_one_aircraft_and_kinds_vary():
    drawn = [spread(seed) for seed in range(12)]
    assert spread(3) == drawn[3]
    assert len({p.hover_percent for p in drawn}) == 12
    assert {type(p.roll) is FirstOrder for p in drawn} == {True, False}
    assert {p.drag.frame for p in drawn} == {"heading", "world"}


@pytest.mark.parametrize("seed", [1, 4])
def test_a_drawn_aircraft_hovers_by_itself(seed):
    sim = SimulatedM100(any_preset(f"spread:{seed}"))
    sim.place((0.0, 0.0, 5.0))
    sim.run(3.0)
    assert sim.truth.position == pytest.approx((0.0, 0.0, 5.0), abs=0.05)


def test_names_and_changes():
    assert any_preset("eth") == load_preset("eth")
    changed = any_preset("spread:5", {"payload": 0.3, "delay": {"telemetry": 0.01}})
    assert changed.payload == 0.3 and changed.delay.telemetry == 0.01
    assert dataclasses.replace(changed, payload=0.0, delay=spread(5).delay) == spread(5)
    with pytest.raises(ConfigError, match="spread:x"):
        any_preset("spread:x")
