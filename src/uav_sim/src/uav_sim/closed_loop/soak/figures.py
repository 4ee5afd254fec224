# SPDX-License-Identifier: MIT
"""Figures of a soak from what was noted, and the bars that they have to keep."""

import math
from typing import Any, Dict, List, Mapping, NamedTuple

import numpy as np

from nmpc_control.mode_inputs import STREAMING, Mode

PERIOD = 20.0  # [ms] of both streams
WARM_UP = 60.0  # [s] at most, a fifth of the flight else
JITTER_ABOVE, GAP_ABOVE = 5.0, 15.0  # [ms] above the bare process
GROWTH = 5.0  # [MB]
TICK_P50_ABOVE, TICK_P99_ABOVE = 2.0, 8.0  # [ms] above the bare process
SCHEDULING = {0: "shared time", 2: "real time, round robin"}
PARTS = ("age", "solved", "carried", "guarded")  # of `whole`


class Row(NamedTuple):
    """One figure beside its bar."""

    name: str
    unit: str
    value: float
    bar: float
    passed: bool


def figures(noted: Mapping[str, np.ndarray], quiet: Mapping[str, np.ndarray]) -> Dict[str, Any]:
    """Return all figures [ms, MB, 1].

    Args:
        noted: of the flight on a machine that is kept busy, as ``ros/soak_node.py`` has it.
        quiet: of the one without; the time of a tick is taken from it.
    """
    return {
        **_busy_figures(noted),
        **_tick_figures(quiet),
        "busy_tick": _tick_figures(noted),
        "quiet": {"aborted": int(quiet["aborted"]), "modes": _modes(quiet)},
    }


def _modes(noted: Mapping[str, np.ndarray]) -> Dict[str, int]:
    return {Mode(int(mode)).name: int(count) for mode, count in noted["modes"]}


def _tick_figures(noted: Mapping[str, np.ndarray]) -> Dict[str, Any]:
    age = 1e3 * noted["bare_age"][np.isfinite(noted["bare_age"])]
    whole, flown = 1e3 * noted["whole"], 1e3 * noted["flown"]
    return {
        "tick_p50_ms": {"whole": _at(whole, 50), "bare": _at(age, 50), "flown": _at(flown, 50)},
        "tick_p99_ms": {"whole": _at(whole, 99), "bare": _at(age, 99), "flown": _at(flown, 99)},
        "parts_p50_ms": {name: _at(1e3 * noted[name], 50) for name in PARTS},
        "parts_p99_ms": {name: _at(1e3 * noted[name], 99) for name in PARTS},
    }


def _busy_figures(noted: Mapping[str, np.ndarray]) -> Dict[str, Any]:
    commands, bare = _intervals(noted["commands"]), _intervals(noted["bare"])
    begin, end = noted["time"]
    silent = 1e3 * max(noted["commands"][0] - begin, end - noted["commands"][-1])
    names = [key[7:] for key in noted if key.startswith("memory_") and key != "memory_t"]
    return {
        "minutes": float((end - begin) / 60.0),
        "flights": int(noted["flights"]),
        "aborted": int(noted["aborted"]),
        "modes": _modes(noted),
        "guard_scheduling": SCHEDULING.get(int(noted["scheduling"]), "unknown"),
        "jitter_p99_ms": {"commands": _jitter(commands), "bare": _jitter(bare)},
        "gap_max_ms": {"commands": float(max(commands.max(), silent)), "bare": float(bare.max())},
        "memory_growth_mb": {n: _growth(noted["memory_t"], noted[f"memory_{n}"]) for n in names},
        "memory_mb": {n: float(noted[f"memory_{n}"][-1]) for n in names},
        "markers": {
            "least": int(_settled(noted)[0].min()),
            "most": int(_settled(noted)[0].max()),
            "growth": _rise(_settled(noted)[0]),
            "points_growth": _rise(_settled(noted)[1]),
        },
    }


def rows(found: Mapping[str, Any]) -> List[Row]:
    """Return the figures that have a bar, with it."""
    kept = [
        ("jitter p99 above the bare process", "ms", _above(found["jitter_p99_ms"]), JITTER_ABOVE),
        ("longest gap above the bare process", "ms", _above(found["gap_max_ms"]), GAP_ABOVE),
        (
            "newest state to Joy, p50 above it",
            "ms",
            _above(found["tick_p50_ms"], "whole"),
            TICK_P50_ABOVE,
        ),
        (
            "newest state to Joy, p99 above it",
            "ms",
            _above(found["tick_p99_ms"], "whole"),
            TICK_P99_ABOVE,
        ),
        ("flights that did not arrive", "1", found["aborted"] + found["quiet"]["aborted"], 0.0),
        ("statuses of no automatic flight", "1", _not_flown(found), 0.0),
        ("markers more than before", "1", found["markers"]["growth"], 0.0),
    ]
    kept += [
        (f"memory growth of {name}", "MB", growth, GROWTH)
        for name, growth in found["memory_growth_mb"].items()
    ]
    return [Row(name, unit, value, bar, bool(value <= bar)) for name, unit, value, bar in kept]


def table(found: Mapping[str, Any]) -> str:
    """Return the rows for people."""
    jitter, gap = found["jitter_p99_ms"], found["gap_max_ms"]
    head = (
        f"{found['minutes']:.1f} busy minutes, {found['flights']} flights; p99 jitter"
        f" {jitter['commands']:.1f} ms (bare {jitter['bare']:.1f}), longest gap"
        f" {gap['commands']:.1f} ms (bare {gap['bare']:.1f}); without load newest state to Joy p50"
        f" {found['tick_p50_ms']['whole']:.1f} ms (bare {found['tick_p50_ms']['bare']:.1f}),"
        f" with the wait for the next tick {found['tick_p50_ms']['flown']:.1f}; of it "
        + ", ".join(f"{name} {ms:.1f}" for name, ms in found["parts_p50_ms"].items())
        + f"; the guard runs in {found['guard_scheduling']}"
    )
    lines = [
        f"{'passed' if row.passed else 'FAILED':8}{row.name:38}{row.value:9.2f} {row.unit:3}"
        f" (at most {row.bar:g})"
        for row in rows(found)
    ]
    return "\n".join([head, *lines])


def _not_flown(found: Mapping[str, Any]) -> int:
    modes = [*found["modes"].items(), *found["quiet"]["modes"].items()]
    return sum(count for name, count in modes if Mode[name] not in STREAMING)


def _intervals(came: np.ndarray) -> np.ndarray:
    """Return intervals [ms] between receipts [s]."""
    return 1e3 * np.diff(came)


def _jitter(intervals: np.ndarray) -> float:
    return _at(np.abs(intervals - PERIOD), 99)


def _at(values: np.ndarray, percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else math.nan


def _above(pair: Mapping[str, float], name: str = "commands") -> float:
    return pair[name] - pair["bare"]


def _warm(t: np.ndarray) -> np.ndarray:
    """Return which of the times [s] come after the warm-up."""
    return t - t[0] >= min(WARM_UP, 0.2 * float(np.ptp(t)))


def _growth(t: np.ndarray, memory: np.ndarray) -> float:
    """Return the growth [MB] from after the warm-up to the end; NaN where a node has ended."""
    count = min(len(t), len(memory))
    memory = memory[:count][_warm(t[:count])]
    tenth = max(1, len(memory) // 10)
    return float(np.median(memory[-tenth:]) - np.median(memory[:tenth]))


def _settled(noted: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return (2, n): markers and their points after the warm-up."""
    count = min(len(noted[name]) for name in ("markers_t", "markers", "marker_points"))
    warm = _warm(noted["markers_t"][:count])
    return np.array([noted["markers"][:count][warm], noted["marker_points"][:count][warm]])


def _rise(counts: np.ndarray) -> int:
    """Return by how much the most of the second half is more than the most of the first."""
    half = len(counts) // 2
    return int(counts[half:].max() - counts[:half].max()) if half else 0
