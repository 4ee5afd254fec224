# SPDX-License-Identifier: MIT
"""The fault matrix as data: complete, refused where it is wrong, and the page made of it."""

import json
from dataclasses import replace
from math import inf
from types import SimpleNamespace

import pytest

from nmpc_control.guard_data import Action, GuardOutput
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import Mode
from uav_sim.closed_loop.faults import cli, matrix, runner
from uav_sim.closed_loop.faults.judgement import (
    end_speed,
    failures,
    longest_gap,
    reaction,
    sinks,
    takeover,
    way,
)
from uav_sim.closed_loop.faults.kinds import TROUBLES
from uav_sim.closed_loop.faults.matrix import (
    SITUATIONS,
    Expectation,
    load_cases,
    load_expectations,
)
from uav_sim.closed_loop.faults.page import page
from uav_sim.closed_loop.faults.service_calls import ServiceCalls
from uav_sim.config import config_directory, load_yaml
from uav_sim.errors import ConfigError
from uav_sim.faults.kinds import KINDS

BEFORE = GuardOutput(Mode.FLYING, Rung.NEW_PLAN, "", "goal", (0.0,) * 5)


def test_every_fault_and_pair_has_an_expectation_in_each_of_its_situations():
    cases, expected = load_cases(), load_expectations()
    assert list(expected) == list(cases)
    for name, case in cases.items():
        assert set(expected[name]) == set(case.situations)


def test_the_matrix_is_as_large_as_it_should_be():
    cases = load_cases().values()
    faults = [case for case in cases if not case.is_pair]
    assert len(faults) >= 30
    assert all(case.situations == SITUATIONS for case in faults)
    assert len([case for case in cases if case.is_pair]) >= 40


def test_every_kind_of_trouble_and_most_faults_of_the_simulator_are_in_it():
    parts = [part for case in load_cases().values() for part in case.parts]
    assert {part.kind for part in parts if part.is_trouble} == set(TROUBLES)
    assert set(KINDS) - {part.kind for part in parts} == {"battery_empty"}


def test_what_nobody_notices_by_itself_is_part_of_pairs_only():
    data = load_yaml(matrix.folder() / "faults.yaml")
    for name in data["ingredients"]:
        assert name not in load_cases()
        assert any(name in pair["of"] for pair in data["pairs"].values())


def test_what_holds_must_rest_and_what_flies_must_not_sink_unless_a_row_says_why():
    expected = load_expectations()
    motion = {
        name: {s: (e.rests, e.sinks) for s, e in expected[name].items()}
        for name in ("controller_dead", "solver_stalls_2", "obstacles_old", "rc_off", "rc_frozen")
    }
    free, flies, holds = (inf, inf), (inf, 1.0), (0.3, 1.0)
    assert motion["controller_dead"] == dict.fromkeys(SITUATIONS, holds)
    assert motion["solver_stalls_2"] == {"hover": holds, "turn": flies, "beside": flies}
    assert motion["obstacles_old"] == dict.fromkeys(SITUATIONS, holds)
    assert motion["rc_off"] == dict.fromkeys(SITUATIONS, free)
    assert motion["rc_frozen"] == {"hover": holds, "turn": flies, "beside": flies}


def test_motion_on_truth():
    heights = [(0.9, 14.0), (1.0, 12.0), (1.5, 11.2), (2.0, 12.5)]
    truths = [SimpleNamespace(t=t, position=(0.0, 0.0, z)) for t, z in heights]
    aircraft = SimpleNamespace(truth=SimpleNamespace(velocity=(0.3, 0.0, -0.4)))
    loop = SimpleNamespace(log=SimpleNamespace(truths=truths), aircraft=aircraft)
    flight = SimpleNamespace(loop=loop, t0=1.0)
    assert sinks(flight) == pytest.approx(0.8)
    assert end_speed(flight) == pytest.approx(0.5)


def test_how_long_setpoints_go_on_after_the_pilot_was_heard():
    sent = [(round(0.02 * k, 2), AXES) for k in range(10)] + [(2.0, AXES)]
    flight = SimpleNamespace(loop=SimpleNamespace(sent=sent, pilot_heard=0.1))
    assert takeover(flight) == pytest.approx(0.08)
    flight.loop.pilot_heard = 0.18
    assert takeover(flight) == 0.0
    flight.loop.pilot_heard = None
    assert takeover(flight) == 0.0


def test_the_page_says_what_the_files_say():
    document = config_directory().parent / "doc" / "fault_matrix.md"
    command = "run python -m uav_sim.closed_loop.faults.page"
    assert document.read_text(encoding="utf-8") == page(), command


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("faults", "faults: {a: {words: x, parts: [{fault: rain}]}}", "one of topic_frozen"),
        ("faults", "faults: {a: {words: x, parts: [{trouble: rain}]}}", "one of solver_raises"),
        ("faults", "faults: {a: {words: x}}", "a mapping with"),
        ("faults", "faults: {}\npairs: {p: {of: [x, y], situation: hover}}", "name of a fault"),
        ("expected", "rain: {all: {end: as before}}", "name of a fault"),
        ("expected", "rc_off: {all: {end: flies on}}", "a mode and a reason code"),
        ("expected", "rc_off: {all: {by: manual pilot, end: manual pilot}}", "within: got inf"),
        ("expected", "rc_off: {all: {end: manual pilot, within: 0.1}}", "by: got ''"),
        (
            "expected",
            "rc_frozen: {all: {end: as before, sinks: 2.0}}",
            "why sinks is not at most 1",
        ),
        ("expected", "no_landing: {all: {end: as before}}", "name of a fault"),
        ("expected", "rc_off: {fog: {end: as before}}", "one of all"),
    ],
)
def test_what_is_wrong_is_refused_by_name(monkeypatch, tmp_path, file, text, words):
    for name in ("faults", "expected"):
        good = (matrix.folder() / f"{name}.yaml").read_text(encoding="utf-8")
        (tmp_path / f"{name}.yaml").write_text(text if name == file else good, encoding="utf-8")
    monkeypatch.setattr(matrix, "folder", lambda: tmp_path)
    with pytest.raises(ConfigError, match=words):
        load_expectations()


def outputs(*items):
    """Return (time, output) 20 ms apart of (mode, code, axes or None)."""
    return [
        (0.02 * k, GuardOutput(mode, Rung.BRAKE if code else Rung.LAST_PLAN, "", code, axes))
        for k, (mode, code, axes) in enumerate(items, 1)
    ]


def flown(*items, t=None):
    log = SimpleNamespace(outputs=outputs(*items))
    end = log.outputs[-1][0] if t is None else t
    return SimpleNamespace(t0=0.0, before=BEFORE, loop=SimpleNamespace(log=log, t=end))


AXES = (0.0,) * 5
SENT, SILENT = (Mode.FLYING, "goal", AXES), (Mode.FLYING, "goal", None)
MANUAL = (Mode.MANUAL, "pilot", None)


@pytest.mark.parametrize(
    ("flight", "gap"),
    [
        (flown(SENT, SENT, SENT), 0.02),
        (flown(SENT, SILENT, SILENT, SENT), 0.06),
        (flown(SENT, SENT, t=0.5), 0.46),
        (flown(SENT, MANUAL, MANUAL, MANUAL), 0.0),
        (flown(SENT, MANUAL, MANUAL, SENT, SENT), 0.02),
        (flown(SENT, (Mode.LANDING, "asked", None), (Mode.LANDING, "asked", None)), 0.0),
    ],
)
def test_a_gap_is_silence_that_no_mode_has_chosen(flight, gap):
    assert longest_gap(flight) == pytest.approx(gap)


def test_way_and_reaction():
    log = outputs(SENT, (Mode.BRAKING, "no_plan", AXES), (Mode.BRAKING, "no_plan", AXES), MANUAL)
    assert way(BEFORE, log) == ["braking no_plan", "manual pilot"]
    assert way(BEFORE, outputs(SENT, SENT)) == []
    assert reaction(BEFORE, log) == pytest.approx(0.02)
    log = [(t, replace(o, rung=BEFORE.rung)) for t, o in outputs(SENT, SENT, SENT)]
    assert reaction(BEFORE, log) is None
    told = replace(log[1][1], actions=(Action.RETURN,))
    assert reaction(BEFORE, [log[0], (0.04, told), log[2]]) == pytest.approx(0.04)


GOOD_ROW = {
    "before": "flying goal",
    "way": ["braking no_plan"],
    "nan_published": 0,
    "command_gap_ms_max": 20.0,
    "reaction_s": 0.5,
    "collision": False,
    "collided_with": [],
    "takeover_s": 0.0,
    "sinks_m": 0.2,
    "end_speed_m_s": 0.5,
    "on_ground": False,
    "against_landing_s": 0.0,
}
LANDS = Expectation("braking no_plan", lands=True)
LANDED = Expectation("waiting landed")
BRAKES = Expectation("braking no_plan", "braking no_plan", within=0.6)


@pytest.mark.parametrize(
    ("change", "expected", "words"),
    [
        ({}, BRAKES, None),
        ({}, Expectation("as before"), "no change"),
        ({"way": []}, BRAKES, "got no change"),
        ({"way": []}, Expectation("as before"), None),
        ({}, Expectation("hovering recovered"), "hovering recovered at last"),
        ({"way": []}, Expectation("flying goal"), None),
        ({"way": ["flying held_back", "flying goal"]}, Expectation("flying goal"), None),
        ({}, Expectation("braking no_plan", "braking alarm"), "braking alarm at first"),
        ({"nan_published": 1}, BRAKES, "not finite"),
        ({"command_gap_ms_max": 60.0}, BRAKES, "for 60 ms"),
        ({"reaction_s": 0.62}, BRAKES, "0.6 s are allowed"),
        ({"reaction_s": None}, BRAKES, "0.6 s are allowed"),
        ({}, replace(BRAKES, rests=0.3), "moves at 0.5 m/s"),
        ({}, replace(BRAKES, rests=0.6), None),
        ({}, replace(BRAKES, sinks=0.1), "sinks by 0.2 m, 0.1 m are allowed"),
        ({}, replace(BRAKES, sinks=0.3), None),
        ({"takeover_s": 0.02}, BRAKES, None),
        ({"takeover_s": 0.04}, BRAKES, "after the pilot was heard"),
        ({}, LANDS, "not on the ground"),
        ({"on_ground": True}, LANDS, None),
        ({"way": ["landing asked", "waiting landed"]}, LANDED, "not on the ground"),
        ({"way": ["landing asked", "waiting landed"], "on_ground": True}, LANDED, None),
        ({"against_landing_s": 0.1}, BRAKES, None),
        ({"against_landing_s": 0.4}, BRAKES, "landing for 0.4 s"),
        ({"collision": True, "collided_with": ["pillar"]}, BRAKES, "collided with pillar"),
    ],
)
def test_a_row_fails_for_each_of_its_reasons(change, expected, words):
    found = failures({**GOOD_ROW, **change}, expected)
    assert not found if words is None else words in "; ".join(found)


def test_a_call_is_repeated_and_a_newer_order_makes_it_obsolete():
    made, told = [], []
    grants = {Action.LAND: False, Action.RELEASE_AUTHORITY: True}
    calls = ServiceCalls(
        lambda action: made.append(action) or grants[action],
        lambda action: 0.5 if action is Action.LAND else 0.0,
        lambda held: told.append(held),
        lambda sentence: told.append(sentence),
        lambda: told.append("lands"),
    )
    calls.order([Action.LAND])
    for k in range(500):
        calls.step(0.01 * k)
    assert made == [Action.LAND] * 3
    assert told == ["land was refused"]
    calls.order([Action.LAND])
    calls.step(6.0)
    calls.order([Action.RELEASE_AUTHORITY])
    calls.step(6.4)
    assert told == ["land was refused"]  # the first still blocks
    calls.step(6.5)
    assert told == ["land was refused", False]
    assert made[3:] == [Action.LAND, Action.RELEASE_AUTHORITY]


def stub_row(job, **changes):
    return {**runner.failed_row(job, ""), "failures": [], "passed": True, **changes}


@pytest.mark.parametrize(
    ("changes", "status"),
    [({}, 0), ({"passed": False, "failures": ["collided with pillar"]}, 1)],
)
def test_the_program_writes_rows_and_tells_whether_they_passed(
    monkeypatch, tmp_path, capsys, changes, status
):
    monkeypatch.setattr(runner, "fly_row", lambda job: stub_row(job, **changes))
    file = tmp_path / "build" / "faults.json"
    with pytest.raises(SystemExit) as end:
        cli.main(["--only", "rc_off", "--workers", "1", "--json", str(file)])
    assert end.value.code == status
    rows = json.loads(file.read_text())["rows"]
    assert [row["situation"] for row in rows] == list(SITUATIONS)
    assert set(rows[0]) >= {
        *("fault", "situation", "final_mode", "reason", "expected_mode", "collision"),
        *("nan_published", "command_gap_ms_max", "reaction_s", "passed"),
    }
    assert "rc_off" in capsys.readouterr().out


def test_a_row_that_raises_fails_and_a_word_that_fits_nothing_is_refused(monkeypatch, capsys):
    def raises(job):
        raise ValueError("odd")

    monkeypatch.setattr(runner, "fly_row", raises)
    with pytest.raises(SystemExit) as end:
        cli.main(["--only", "rc_off/hover", "--workers", "1", "--quiet"])
    assert end.value.code == 1
    assert "ValueError: odd" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        cli.main(["--only", "rain"])
    assert end.value.code == 2
