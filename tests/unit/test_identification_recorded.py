# SPDX-License-Identifier: MIT
"""Recorded flights of DJI's hardware-in-the-loop simulator, with what is known of them."""

import json

import pytest
from analysis_bags import REPOSITORY

from nmpc_control.analysis.identification.cli import main
from nmpc_control.config import from_dict, load_yaml
from nmpc_control.params import Vehicle

DATA = REPOSITORY.parent / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded flights in {DATA}")


def identified(folder, bags, *options):
    """Return what the command writes as JSON."""
    path = folder / "out.json"
    main([*(str(DATA / bag) for bag in bags), "--quiet", "--json", str(path), *map(str, options)])
    return json.loads(path.read_text())


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Return folder and document of both flights given together."""
    folder = tmp_path_factory.mktemp("both")
    return identified(folder, ["m100exp01.bag", "m100exp03.bag"], "--write", folder / "m100.yaml")


def test_source_is_hil(both):
    assert both["source"] == "hil"


def test_limited_flight_is_recognised_and_left_out(both):
    kinds = {
        bag: {s["kind"] for s in both["segments"] if s["bag"] == bag and s["end"] - s["start"] > 5}
        for bag in both["bags"]
    }
    assert kinds["m100exp01.bag"] == {"ground", "limited"}
    assert kinds["m100exp03.bag"] == {"flight"}
    assert both["limited_regime"]["largest_tilt_rad"] == pytest.approx(0.16, abs=0.02)


def test_flight_is_found_where_it_was(both):
    flown = [s for s in both["segments"] if s["kind"] == "flight"]
    assert flown[0]["start"] == pytest.approx(5.0, abs=1.0)
    assert flown[-1]["end"] == pytest.approx(75.0, abs=2.0)
    assert sum(s["end"] - s["start"] for s in flown) > 69.0


@pytest.mark.parametrize("axis", ["roll", "pitch"])
def test_response_fits_and_is_that_of_the_facts(both, axis):
    found = both["attitude"][axis]
    assert found["fit_percent"] >= 95.0
    assert found["gain"] == pytest.approx(1.033, rel=0.01)
    # the facts' fit has 9.96 rad/s, 0.778 and 0.085 s: as late on the whole, a little worse
    late = found["dead_time_s"] + 2.0 * found["zeta"] / found["omega"]
    assert late == pytest.approx(0.085 + 2.0 * 0.778 / 9.96, abs=0.01)
    first = both["attitude"]["first_order"][axis]
    assert first["time_constant_s"] == pytest.approx(1.0 / 9.6, rel=0.08)
    assert first["dead_time_s"] == pytest.approx(0.14, abs=0.02)
    assert both["attitude"]["cross_validation"][axis] >= 93.0


def test_tilt_limit_thrust_and_drag(both):
    assert both["tilt_limit_rad"] == pytest.approx(0.605, abs=0.01)
    thrust, drag = both["thrust"], both["drag"]
    assert thrust["r2"] >= 0.97
    assert thrust["slope"] == pytest.approx(0.1732, rel=0.03)
    assert thrust["hover_percent"] == pytest.approx(38.3, abs=0.2)
    assert thrust["dead_time_s"] == pytest.approx(0.12, abs=0.015)
    low, high = drag["confidence"]["sideways"]
    assert low < 0.125 < high
    assert drag["forward"] == pytest.approx(0.138, rel=0.15)


def test_what_was_not_flown_is_not_identified(both):
    assert both["yaw_rate"]["omega"] is None
    assert "excitation" in both["yaw_rate"]["reason"]
    assert both["battery"]["levels"] == []
    assert "battery_state" in both["battery"]["reason"]


def test_parameters_of_the_first_half_fit_the_second(tmp_path):
    options = ("--fit", 5, 40, "--validate", 40, 74, "--write", tmp_path / "m100.yaml")
    found = identified(tmp_path, ["m100exp03.bag"], *options)
    assert found["validation"]["roll"] >= 93.0
    assert found["validation"]["pitch"] >= 93.0
    vehicle = from_dict(Vehicle, load_yaml(tmp_path / "m100.yaml"), "m100.yaml")
    assert vehicle.roll.time_constant == pytest.approx(0.1, abs=0.01)
    assert vehicle.thrust_map.measured_on == "DJI HIL simulator"
