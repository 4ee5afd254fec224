# SPDX-License-Identifier: MIT
"""Writes ``doc/fault_matrix.md`` from the files of the matrix: ``python -m`` this module."""

import argparse
from pathlib import Path
from typing import Dict, List, Optional

from uav_sim.closed_loop.faults.matrix import (
    AS_BEFORE,
    AT_REST,
    HEIGHT_LOSS,
    SITUATIONS,
    Case,
    Expectation,
    load_cases,
    load_expectations,
)
from uav_sim.config import config_directory

_FAULT_COLUMNS = ("fault", "what goes wrong", *SITUATIONS, "why")
_PAIR_COLUMNS = ("pair", "what goes wrong", "situation", "expected", "why")
HEAD = """# The fault matrix

Written by `python -m uav_sim.closed_loop.faults.page` from `config/fault_matrix/faults.yaml` and `expected.yaml`; do not edit.

    make faults [ONLY=WORD]                                      all rows, or those whose fault/situation contains the word; build/faults.json
    rosrun uav_sim fault_matrix [--only WORD]... [--workers W] [--json FILE] [--quiet]

Controller, guard and simulated M100 (`dji_hil`) on one clock, without ROS; the same row is the same flight. Exit status 0: every row ends as
expected; 1: not; 2: bad input. Through ROS, and for processes that are killed: `tests/ros`.

| situation | |
|---|---|
| `hover` | at rest, a sphere 2.2 m from the hull; the fault comes after 4 s |
| `turn` | a circle of 8 m at 5 m/s, tilt 18 degrees, a sphere 8 m straight on; after 9 s |
| `beside` | at 2.4 m/s on the way round a sphere that stands on the line, 0.8 m before it; after 6.6 s |

In each somebody walks 30 m off, so that obstacles can be too long unseen. What is heard of obstacles goes through the memory that the nodes
have, calls of `dji_sdk` are repeated as they repeat them, an exception ends no loop.

## What makes a row pass

- The first change of mode and reason code and the one at the end are as expected ("as before": there is none).
- Every setpoint that left is finite, all flight long.
- No two setpoints are more than 40 ms apart while a mode streams; where the guard itself stands still, no more than the row says.
- The guard reacts within the time that the row gives, counted from the fault, or from when the pilot's switch is heard: another mode, reason or
  rung, or an order to the controller. Rows without such a time say why. It follows from the parameters: the timeout, one message (20 ms; the battery's
  100 ms), at most 60 ms of transport and ticks.
- Once the pilot's switch is heard to leave F, no setpoint leaves later than one period (20 ms), whatever else there is.
- What ends flying, hovering or braking comes nowhere more than 1 m below where it was; what ends hovering, braking or held back rests then, at
  0.3 m/s or less; both on truth, and unless the row says otherwise, and why.
- What has landed, and what else is expected on the ground, stands there at the end, on truth. No setpoint leaves later than 0.2 s after DJI's
  own landing began.
- Nothing is hit, on truth, between samples. Where something is, the same flight is flown again nineteen times, each time with one setpoint from
  the fault's beginning on: DJI's own brake, full and least thrust, the greatest tilt to eight sides with the thrust that carries it or all there is. Only if each of these collides too is the
  collision unavoidable; rows for which that is expected say so.

`build/faults.json` has `rows` with `fault`, `situation`, `final_mode`, `reason` (of the last change; empty: none), `expected_mode`, `collision`,
`nan_published` (setpoints that were not finite), `command_gap_ms_max`, `reaction_s`, `passed`, and `way` (all changes), `expected`,
`sinks_m`, `end_speed_m_s`, `on_ground`, `takeover_s` (how long setpoints went on after the pilot was heard), `against_landing_s` (how long setpoints went on into DJI's own landing),
`collided_with`, `clearance_m`, `unavoidable`, `failures` in words; beside them `collisions`, `unavoidable`, `failed`, `passed`, machine and versions.

What is expected follows from the ladder ([modes](../../nmpc_control/doc/modes.md)); where a flight contradicted it, the ladder decided. [Faults](faults.md) has the
simulator's own ones.
"""  # noqa: E501


def page() -> str:
    """Return the document."""
    cases, expectations = load_cases(), load_expectations()
    faults = [_row(c, expectations[c.name]) for c in cases.values() if c.name not in _pairs(cases)]
    pairs = [_pair(cases[name], expectations[name]) for name in _pairs(cases)]
    parts = [HEAD, f"\n## {len(faults)} faults, in three situations each\n"]
    parts += [_line(*_FAULT_COLUMNS), _line(*["---"] * len(_FAULT_COLUMNS)), *faults]
    parts += [f"\n## {len(pairs)} pairs\n"]
    parts += [_line(*_PAIR_COLUMNS), _line(*["---"] * len(_PAIR_COLUMNS))]
    return "\n".join([*parts, *pairs]) + "\n"


def _pairs(cases: Dict[str, Case]) -> List[str]:
    return [name for name, case in cases.items() if case.is_pair]


def _row(case: Case, expected: Dict[str, Expectation]) -> str:
    cells = [_words(expected[s]) if s in expected else "" for s in SITUATIONS]
    if len(set(cells)) == 1:
        cells = [cells[0], "the same", "the same"]
    return _line(f"`{case.name}`", case.words, *cells, _why(expected))


def _pair(case: Case, expected: Dict[str, Expectation]) -> str:
    (situation,) = case.situations
    words = _words(expected[situation])
    return _line(f"`{case.name}`", case.words, situation, words, _why(expected))


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _why(expected: Dict[str, Expectation]) -> str:
    texts = [text for e in expected.values() for text in (e.untimed, e.why)]
    reasons = [text for text in texts if text and text != "the same"]
    return "; ".join(dict.fromkeys(reasons))


def _words(expectation: Expectation) -> str:
    """Return an expectation for people."""
    e = expectation
    words = e.end if e.end == AS_BEFORE else _mode(e.end)
    if e.by and e.by != e.end:
        words = f"{_mode(e.by)}, then {words}"
    if e.within < float("inf"):
        words += f"; within {e.within:g} s"
    if e.gap_ms != Expectation(end=AS_BEFORE).gap_ms:
        words += f"; silent for at most {e.gap_ms:g} ms"
    words += f"; sinks by at most {e.sinks:g} m" if HEIGHT_LOSS != e.sinks < float("inf") else ""
    words += f"; at most {e.rests:g} m/s at the end" if AT_REST != e.rests < float("inf") else ""
    words += "; on the ground" if e.lands else ""
    return words + ("; collides, unavoidably" if e.unavoidable else "")


def _mode(text: str) -> str:
    mode, code = text.split()
    return f"{mode.replace('_', ' ')} `{code}`"


def main(argv: Optional[List[str]] = None) -> None:
    """Write the document."""
    parser = argparse.ArgumentParser(prog="page", description=__doc__)
    default = config_directory().parent / "doc" / "fault_matrix.md"
    parser.add_argument("file", nargs="?", type=Path, default=default)
    parser.parse_args(argv).file.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
