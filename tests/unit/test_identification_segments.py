# SPDX-License-Identifier: MIT
"""What counts as flight, and what is kept out: ground, pilot, other limits, contact, silence."""

import dataclasses

import numpy as np
import pytest
from identification_flights import excite, fly, series

from nmpc_control.analysis.identification import segments as parts
from nmpc_control.analysis.identification.attitude import identify_attitude
from nmpc_control.analysis.identification.identify import identify
from nmpc_control.analysis.identification.passages import attitude_passages
from nmpc_control.analysis.identification.regimes import classify
from nmpc_control.analysis.identification.segments import labels
from nmpc_control.analysis.record import Series
from uav_sim.preset import load_preset

DURATION = 24.0


@pytest.fixture(scope="module")
def flown():
    return fly("dji_hil", DURATION, excite(DURATION, hover=45.0, yaw_rate=0.0))


def kind_at(log, kinds, t):
    return kinds[np.searchsorted(log.attitude.times, t)]


def share(kinds, kind):
    return np.mean(kinds == kind)


def test_all_of_an_obedient_flight_counts(flown):
    (kinds,) = classify([flown.log()])
    assert share(kinds, "flight") > 0.99


def test_commands_that_nobody_follows_are_found_by_the_response(flown):
    ignored = fly(
        "dji_hil", DURATION, excite(DURATION, hover=45.0), obeys=lambda t: not 8.0 < t < 15.0
    )
    log = ignored.log()
    (kinds,) = classify([log])
    for t in (9.5, 11.0, 13.0):
        assert kind_at(log, kinds, t) in ("not_following", "short")
    for t in (2.0, 5.0, 18.0, 22.0):
        assert kind_at(log, kinds, t) == "flight"
    found = identify_attitude(attitude_passages(parts.stretches(log, kinds, "flight")))
    assert found.second["roll"].values["omega"] == pytest.approx(9.96, rel=0.03)


def limited_preset():
    preset = load_preset("dji_hil")
    lower = dataclasses.replace(preset.roll, gain=0.2)
    return dataclasses.replace(preset, roll=lower, pitch=lower)


def test_limited_regime_is_recognised_and_not_mixed_in(flown):
    log = fly(limited_preset(), DURATION, excite(DURATION, hover=38.0, seed=5)).log(bag="low.bag")
    (kinds,) = classify([log])
    assert share(kinds, "limited") > 0.99
    alone = identify([log])
    assert alone.attitude.best is None
    assert any("--regime limited" in remark for remark in alone.remarks)
    together, normal = identify([log, flown.log()]), identify([flown.log()])
    assert together.other_regime["roll"]["gain"] == pytest.approx(0.2, rel=0.03)
    for axis in ("roll", "pitch"):
        assert together.attitude.second[axis].values == normal.attitude.second[axis].values
    assert together.thrust.estimate.values == normal.thrust.estimate.values


def test_lower_tilt_limit_is_a_limited_regime_too():
    preset = dataclasses.replace(load_preset("dji_hil"), tilt_limit=0.16)
    (kinds,) = classify([fly(preset, DURATION, excite(DURATION, hover=38.0)).log()])
    assert share(kinds, "limited") > 0.99


def test_both_regimes_in_one_bag(flown):
    other = fly(limited_preset(), DURATION, excite(DURATION, hover=38.0, seed=5)).log()
    log, gap = flown.log(), DURATION + 1.0
    joined = dataclasses.replace(
        log,
        **{
            name: Series(
                np.concatenate([getattr(log, name).times, getattr(other, name).times + gap]),
                np.concatenate([getattr(log, name).values, getattr(other, name).values]),
            )
            for name in ("commands", "attitude", "velocity")
        },
        battery=None,
        flight_status=None,
    )
    (kinds,) = classify([joined])
    assert kind_at(joined, kinds, 12.0) == "flight"
    assert kind_at(joined, kinds, gap + 12.0) == "limited"


def test_rc_out_of_f_and_ground_and_other_setpoints(flown):
    def rc(t):
        return (0.0, 0.0, 0.0, 0.0, 8000.0 if t < 10.0 else -8000.0, -4545.0)

    times = np.arange(0.0, DURATION, 0.02)
    log = flown.log(
        rc=series([(t, rc(t)) for t in times]),
        flight_status=series([(t, (1.0 if t < 4.0 else 3.0,)) for t in times]),
    )
    commands = log.commands.values.copy()
    commands[(times > 6.0) & (times < 8.0), 1:3] = np.nan  # a velocity setpoint was in effect
    kinds = labels(dataclasses.replace(log, commands=Series(times, commands)))
    expected = {2.0: "ground", 5.0: "flight", 7.0: "no_command", 9.0: "flight", 12.0: "manual"}
    assert {t: kind_at(log, kinds, t) for t in expected} == expected


def test_silence_and_impact(flown):
    log = flown.log()
    keep = (log.commands.times < 6.0) | (log.commands.times > 8.0)
    quiet = dataclasses.replace(
        log, commands=Series(log.commands.times[keep], log.commands.values[keep])
    )
    assert kind_at(quiet, labels(quiet), 7.0) == "no_command"
    velocity = log.velocity.values.copy()
    velocity[log.velocity.times > 12.0] -= (3.0, 0.0, 0.0)
    bumped = dataclasses.replace(log, velocity=Series(log.velocity.times, velocity))
    kinds = labels(bumped)
    assert kind_at(bumped, kinds, 12.0) == "impact"
    assert share(kinds, "impact") < 0.05


def test_ground_is_where_nothing_moves_if_nothing_else_tells(flown):
    log = flown.log(flight_status=None)
    velocity = log.velocity.values.copy()
    velocity[(log.velocity.times < 5.0) | (log.velocity.times > 20.0)] = 0.0
    still = dataclasses.replace(log, velocity=Series(log.velocity.times, velocity))
    kinds = labels(still)
    assert {kind_at(still, kinds, t) for t in (1.0, 4.5, 20.5, 23.0)} == {"ground"}


def test_segments_tile_the_bag_in_order(flown):
    log = flown.log()
    found = parts.segments(log, labels(log))
    assert found[0].start == log.attitude.times[0]
    assert found[-1].end == log.attitude.times[-1]
    for before, after in zip(found, found[1:]):
        assert before.start <= before.end < after.start
        assert before.kind != after.kind
