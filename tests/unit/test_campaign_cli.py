# SPDX-License-Identifier: MIT
"""The campaign as a program: what it writes, how it goes on, what it refuses; flights are stubs."""

import json

import pytest

from uav_sim.closed_loop.campaign import cli, runner
from uav_sim.closed_loop.campaign.flying import quantiles
from uav_sim.closed_loop.campaign.settings import Settings

KEYS = {
    *("suite", "plant", "disturbance", "seed", "flights", "collisions", "margin_entered"),
    *("worst_margin_m", "arrived", "infeasible", "solve_time_ms", "machine", "versions", "rows"),
}


def row(index, **changes):
    usual = {
        "index": index,
        "seed": 100 + index,
        "closed": False,
        "feasible": True,
        "feasible_by": "flight",
        "arrived": True,
        "held": False,
        "collisions": 0,
        "margin_entered": False,
        "worst_margin_m": 0.1 * index,
        "clearance_m": 0.5 + 0.1 * index,
        "late_s": 0.0,
        "deviation_m": 0.5,
        "solve_times_us": [100 * (index + 1)] * 10,
        "wall_s": 1.0,
        "outcome": "arrived",
    }
    return {**usual, **changes}


@pytest.fixture
def flown(monkeypatch):
    """Stand in for flights; returns the numbers flown, and changes by number."""
    numbers, changes = [], {}

    def fly(settings, index):
        numbers.append(index)
        change = changes.get(index, {})
        if isinstance(change, BaseException):
            raise change
        return row(index, **change)

    monkeypatch.setattr(runner, "fly_number", fly)
    return numbers, changes


def campaign(*arguments, suite="static_fields"):
    """Run the program in this process; returns its exit status."""
    with pytest.raises(SystemExit) as end:
        cli.main(["--suite", suite, "--workers", "1", "--quiet", *arguments])
    return end.value.code


def test_json_has_the_keys_that_others_read(flown, tmp_path):
    file = tmp_path / "c.json"
    assert campaign("--flights", "4", "--json", str(file)) == 0
    data = json.loads(file.read_text())
    assert set(data) >= KEYS
    assert (data["flights"], data["arrived"], data["collisions"]) == (4, 4, 0)
    assert data["worst_margin_m"] == 0.0
    assert data["solve_time_ms"] == {"p50": 0.25, "p95": 0.4, "p99": 0.4, "max": 0.4}
    assert [r["index"] for r in data["rows"]] == [0, 1, 2, 3]
    assert "solve_times_us" not in data["rows"][0]


def test_progress_and_table_are_shown(flown, capsys):
    with pytest.raises(SystemExit):
        cli.main(["--suite", "moving", "--flights", "2", "--workers", "1"])
    assert "collisions_feasible" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("suite", "change", "status"),
    [
        ("static_fields", {"collisions": 1}, 1),
        ("static_fields", {"margin_entered": True}, 1),
        ("static_fields", {"arrived": False}, 1),
        ("moving", {"margin_entered": True}, 0),
        ("moving", {"collisions": 1}, 1),
        ("moving", {"arrived": False}, 1),
        ("appearing", {"arrived": False}, 1),
        ("moving", {"feasible": None, "collisions": 1}, 1),
        ("head_on", {"late_s": 2.9}, 0),
        ("head_on", {"late_s": 3.1}, 1),
        ("head_on", {"late_s": None, "arrived": False}, 1),
        ("no_way", {"arrived": False}, 1),
    ],
)
def test_gates_decide_the_exit_status(flown, suite, change, status):
    flown[1][1] = change
    closed = {"arrived": False, "held": True, "closed": True} if suite == "no_way" else {}
    for i in range(4):
        flown[1][i] = {**closed, **flown[1].get(i, {})}
    if suite == "no_way":
        assert campaign("--flights", "1", suite=suite) == 0
        flown[1][1]["held"] = False
    assert campaign("--flights", "4", suite=suite) == status


@pytest.mark.parametrize("suite", ["static_fields", "appearing", "head_on"])
def test_blind_flights_must_collide_or_the_obstacles_prove_nothing(flown, suite):
    for i in range(4):
        flown[1][i] = {"collisions": 1, "feasible": None, "arrived": False}
    flown[1][3] = {}
    assert campaign("--flights", "4", "--avoidance", "off", suite=suite) == 0
    flown[1][2] = {}
    assert campaign("--flights", "4", "--avoidance", "off", suite=suite) == 1


def test_what_has_no_way_is_listed_and_does_not_count(flown, tmp_path):
    file = tmp_path / "c.json"
    flown[1][7] = {"feasible": False, "arrived": False, "collisions": 1}
    assert campaign("--flights", "20", "--json", str(file)) == 0
    data = json.loads(file.read_text())
    assert data["infeasible_flights"] == [{"index": 7, "seed": 107}]
    assert (data["collisions"], data["collisions_feasible"]) == (1, 0)
    flown[1][8] = flown[1][7]
    assert campaign("--flights", "20") == 1, "more than 5 % without a way"


def test_interrupted_it_goes_on(flown, tmp_path, capsys):
    file = tmp_path / "c.json"
    flown[1][3] = KeyboardInterrupt()
    assert campaign("--flights", "5", "--json", str(file)) == 130
    assert "3 of 5" in capsys.readouterr().err
    assert not file.exists()
    with open(f"{file}l", "a") as ledger:
        ledger.write('{"index": 3, "arr')  # cut off while it was written
    flown[0].clear()
    del flown[1][3]
    assert campaign("--flights", "5", "--json", str(file), "--resume") == 0
    assert flown[0] == [3, 4]
    assert len(json.loads(file.read_text())["rows"]) == 5
    flown[0].clear()
    assert campaign("--flights", "7", "--json", str(file), "--resume") == 0
    assert flown[0] == [5, 6], "more flights of the same campaign"
    flown[0].clear()
    assert campaign("--flights", "2", "--json", str(file)) == 0
    assert flown[0] == [0, 1], "anew"


@pytest.mark.parametrize("other", [["--seed", "1"], ["--plant", "eth"], ["--avoidance", "off"]])
def test_another_campaign_is_not_gone_on_with(flown, tmp_path, capsys, other):
    file = tmp_path / "c.json"
    campaign("--flights", "1", "--json", str(file))
    capsys.readouterr()  # a progress bar may leave an empty line
    assert campaign("--flights", "2", "--json", str(file), "--resume", *other) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert flown[0] == [0]


def test_part_of_a_campaign(flown):
    campaign("--flights", "2", "--first", "40")
    assert flown[0] == [40, 41]


def test_one_flight_that_raises_is_a_row(monkeypatch, tmp_path):
    def explode(flight, settings):
        raise FloatingPointError("what a bug does")

    monkeypatch.setattr(runner, "fly_row", explode)
    file = tmp_path / "c.json"
    assert campaign("--flights", "2", "--json", str(file)) == 1
    data = json.loads(file.read_text())
    assert data["errors"] == 2
    assert data["rows"][0]["outcome"] == "FloatingPointError: what a bug does"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flights", "0"], "--flights"),
        (["--flights", "many"], "--flights"),
        (["--seed", "-1"], "--seed"),
        (["--workers", "0"], "--workers"),
        (["--plant", "nothing"], "nothing"),
        (["--disturbance", "storm"], "storm"),
        (["--set", "avoidance.eta"], "avoidance.eta"),
        (["--set", "avoidance.nothing=1"], "avoidance.nothing"),
        (["--set", "avoidance.eta=-1"], "avoidance.eta"),
        (["--set", "avoidance.eta=[1"], "avoidance.eta"),
        (["--json", "/nowhere/c.json"], "/nowhere/c.json"),
    ],
)
def test_bad_input_ends_with_status_two(flown, capsys, arguments, words):
    assert campaign(*arguments) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error
    assert error.splitlines()[-1].startswith("campaign: ")
    assert flown[0] == []


def test_unknown_suite_is_refused(capsys):
    assert campaign(suite="nothing") == 2
    assert "static_fields" in capsys.readouterr().err


def test_parameters_can_be_changed():
    parameters = Settings(
        "moving", 0, changes=("avoidance.eta=7", "solver.horizon=30")
    ).parameters()
    assert parameters.avoidance.eta == 7.0
    assert parameters.solver.horizon == 30
    assert parameters.solver.budget.time_budget >= 1.0, "a busy machine changes no flight"
    assert not Settings("moving", 0, avoidance=False).parameters().avoidance.enabled


def test_quantiles_of_nothing():
    assert quantiles([]) == {"p50": None, "p95": None, "p99": None, "max": None}
