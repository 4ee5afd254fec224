# SPDX-License-Identifier: MIT
"""Fly the fault matrix without ROS: what goes wrong, in which situation, what comes of it.

Exit status 0: every row ends as expected; 1: not; 2: bad input.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

from rich.console import Console
from rich.table import Table

from uav_sim.closed_loop.bench.machine import machine, versions
from uav_sim.closed_loop.command import fail, failing_in_one_line, progress_bar
from uav_sim.closed_loop.faults.judgement import Row
from uav_sim.closed_loop.faults.runner import Job, jobs, run
from uav_sim.closed_loop.options import count

_PROGRAM = "fault_matrix"
_WIDTH = 180  # [characters] of a table that goes to a file


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``fault_matrix``."""
    options = _parser().parse_args(argv)
    with failing_in_one_line(_PROGRAM):
        todo = jobs(options.only)
        if not todo:
            words = " or ".join(options.only)
            fail(_PROGRAM, f"no fault or situation is called like {words}")
        rows = _fly(todo, options)
        figures = {**summary(rows), "machine": machine(), "versions": versions()}
        if options.json is not None:
            options.json.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(figures, indent=1, allow_nan=False)
            options.json.write_text(text + "\n", encoding="utf-8")
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    if not options.quiet:
        console.print(table(rows))
    for row in rows:
        if not row["passed"]:
            words = "; ".join(row["failures"])
            console.print(f"{row['fault']}/{row['situation']}: {words}", soft_wrap=True)
    console.print(
        f"{len(rows)} rows, {len(rows) - len(figures['failed'])} as expected, "
        f"{figures['collisions']} collisions, {len(figures['unavoidable'])} of them unavoidable"
    )
    sys.exit(0 if figures["passed"] else 1)


def summary(rows: Sequence[Row]) -> Dict[str, Any]:
    """Return rows with what they come to."""

    def names(chosen: List[Row]) -> List[str]:
        return [f"{row['fault']}/{row['situation']}" for row in chosen]

    return {
        "rows": list(rows),
        "collisions": sum(row["collision"] for row in rows),
        "unavoidable": names([row for row in rows if row["unavoidable"]]),
        "nan_published": sum(row["nan_published"] for row in rows),
        "failed": names([row for row in rows if not row["passed"]]),
        "passed": all(row["passed"] for row in rows),
    }


def table(rows: Sequence[Row]) -> Table:
    """Return the rows for people."""
    result = Table(title="fault matrix")
    for name in ("fault", "situation", "final mode", "reason", "expected"):
        result.add_column(name)
    for name in ("hit", "NaN", "gap [ms]", "reaction [s]"):
        result.add_column(name, justify="right")
    result.add_column("passed")
    for row in rows:
        hit = "unavoidable" if row["unavoidable"] else ", ".join(row["collided_with"])
        late = "" if row["reaction_s"] is None else f"{row['reaction_s']:.3f}"
        result.add_row(
            row["fault"],
            row["situation"],
            row["final_mode"],
            row["reason"],
            row["expected"],
            hit,
            str(row["nan_published"]),
            f"{row['command_gap_ms_max']:.0f}",
            late,
            "yes" if row["passed"] else "NO",
            style="" if row["passed"] else "bold red",
        )
    return result


def _fly(todo: Sequence[Job], options: argparse.Namespace) -> List[Row]:
    rows: Dict[Job, Row] = {}
    with progress_bar(options.quiet) as bar:
        task = bar.add_task("faults", total=len(todo), news="")

        def on_row(row: Row) -> None:
            rows[row["fault"], row["situation"]] = row
            bad = sum(not r["passed"] for r in rows.values())
            bar.update(task, advance=1, news=f"{bad} not as expected")

        run(todo, min(options.workers, len(todo)), on_row)
    return [rows[job] for job in todo]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="WORD",
        help="rows whose fault/situation contains this; may be repeated",
    )
    parser.add_argument("--workers", type=count, default=2, help="processes (default: 2)")
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument("--quiet", action="store_true", help="no progress, no table")
    return parser
