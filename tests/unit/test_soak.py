# SPDX-License-Identifier: MIT
"""Figures of a soak, from streams whose figures are known."""

import numpy as np
import pytest

from uav_sim.closed_loop.soak.cli import main
from uav_sim.closed_loop.soak.figures import figures, rows, table

DURATION = 300.0  # [s]


def noted(**changes):
    """Return a flight without fault, with changes."""
    t = np.arange(0.0, DURATION, 0.02)
    seconds = np.arange(0.0, DURATION, 1.0)
    drawn = np.arange(0.0, DURATION, 0.1)
    good = {
        "time": np.array([0.0, DURATION]),
        "commands": t,
        "bare": t + 0.003,
        "bare_age": np.full(len(t), 0.005),
        "age": np.full(1000, 0.001),
        "solved": np.full(1000, 0.002),
        "carried": np.full(1000, 0.001),
        "guarded": np.full(1000, 0.002),
        "whole": np.full(1000, 0.006),
        "flown": np.full(1000, 0.018),
        "memory_t": seconds,
        "memory_flight_guard": np.full(len(seconds), 80.0),
        "markers_t": drawn,
        "markers": np.full(len(drawn), 12),
        "marker_points": np.full(len(drawn), 900),
        "flights": np.array(5),
        "aborted": np.array(0),
        "modes": np.array([[3, 900], [4, 100]]),
        "scheduling": np.array(2),
    }
    return {**good, **changes}


def failed(**changes):
    flight = noted(**changes)
    return [row.name for row in rows(figures(flight, flight)) if not row.passed]


def test_a_flight_without_fault_keeps_every_bar():
    found = figures(noted(), noted())
    assert failed() == []
    assert found["jitter_p99_ms"]["commands"] == pytest.approx(0.0, abs=1e-6)
    assert found["tick_p50_ms"] == pytest.approx({"whole": 6.0, "bare": 5.0, "flown": 18.0})
    assert found["modes"] == {"FLYING": 900, "HOVERING": 100}
    assert "passed" in table(found) and "FAILED" not in table(found)


def test_what_the_machine_does_to_any_process_does_not_count():
    late = np.arange(0.0, DURATION, 0.02)
    late[5000:] += 0.1
    assert failed(commands=late) == ["longest gap above the bare process"]
    assert failed(commands=late, bare=late) == []


def test_a_flight_that_ended_early_is_no_flight():
    """A released guard publishes no command, so that none of them is late."""
    released = {"commands": np.arange(0.0, 61.0, 0.02), "modes": np.array([[3, 3000], [8, 12000]])}
    assert failed(**released) == [
        "longest gap above the bare process",
        "statuses of no automatic flight",
    ]
    assert failed(aborted=np.array(1)) == ["flights that did not arrive"]


def test_jitter_counts_in_both_directions():
    uneven = np.arange(0.0, DURATION, 0.02)
    uneven[::40] += 0.008  # too long, then too short: one interval in twenty
    assert failed(commands=uneven) == ["jitter p99 above the bare process"]


def test_slow_ticks_are_seen():
    assert failed(whole=np.full(1000, 0.0075)) == ["newest state to Joy, p50 above it"]
    rare = np.full(1000, 0.006)
    rare[::50] = 0.030
    assert failed(whole=rare) == ["newest state to Joy, p99 above it"]


def test_the_time_of_a_tick_is_that_of_the_flight_without_load():
    slow = noted(whole=np.full(1000, 0.030))
    assert all(row.passed for row in rows(figures(slow, noted())))
    assert not all(row.passed for row in rows(figures(noted(), slow)))
    braked = noted(aborted=np.array(2))
    assert not all(row.passed for row in rows(figures(noted(), braked)))


def test_memory_counts_after_the_warm_up():
    seconds = np.arange(0.0, DURATION, 1.0)
    warm = 80.0 + 20.0 * (seconds > 40.0)
    assert failed(memory_flight_guard=warm) == []
    leak = 80.0 + 0.03 * seconds
    assert failed(memory_flight_guard=leak) == ["memory growth of flight_guard"]
    gone = np.where(seconds > 200.0, np.nan, 80.0)
    assert failed(memory_flight_guard=gone) == ["memory growth of flight_guard"]


def test_more_and_more_markers_are_seen():
    drawn = len(np.arange(0.0, DURATION, 0.1))
    assert failed(markers=np.arange(drawn)) == ["markers more than before"]


@pytest.mark.parametrize(
    "arguments", [["--minutes", "0"], ["--scenario", "nowhere"], ["--plant", "nothing"]]
)
def test_bad_input_ends_in_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert capsys.readouterr().err
