# SPDX-License-Identifier: MIT
"""Measure the solver: all backends on problems recorded from closed loops, in one run.

Wall times on a busy machine mean something only as ratios within one run; so the backends take
turns on every problem, and each keeps its fastest repeat. Writes bench.json and figures.
"""

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any, Dict, List, Optional

from rich.console import Console
from rich.progress import Progress

from uav_sim.closed_loop.bench.effort import FULL, QUICK
from uav_sim.closed_loop.bench.figures import draw
from uav_sim.closed_loop.bench.machine import machine, versions
from uav_sim.closed_loop.bench.sections import ORDER, SECTIONS
from uav_sim.closed_loop.bench.tables import tables
from uav_sim.closed_loop.command import failing_in_one_line

_PROGRAM = "bench"
_NOT_IN_JSON = ("samples_ms",)  # only for the figure


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``bench``."""
    options = _parser().parse_args(argv)
    console = Console()
    with failing_in_one_line(_PROGRAM):
        options.out.mkdir(parents=True, exist_ok=True)
        results = run(options, console)
        data = {key: value for key, value in results.items() if key not in _NOT_IN_JSON}
        text = json.dumps(data, indent=1, allow_nan=False)
        (options.out / "bench.json").write_text(text + "\n", encoding="utf-8")
        files = draw(results, options.out)
    for table in tables(results):
        console.print(table)
    console.print(*(str(file) for file in [options.out / "bench.json", *files]), sep="\n")


def run(options: argparse.Namespace, console: Console) -> Dict[str, Any]:
    """Return the results of the chosen sections, in order."""
    effort = QUICK if options.quick else FULL
    results: Dict[str, Any] = {"machine": machine(), "versions": versions(), "seed": options.seed}
    seconds: Dict[str, float] = {}
    with Progress(console=console, transient=True, disable=options.quiet) as bar:
        for name in options.only or ORDER:
            begin = time.perf_counter()
            results.update(SECTIONS[name](effort, options.seed, bar))
            seconds[name] = round(time.perf_counter() - begin, 1)
    results["machine"]["load_average_after"] = list(os.getloadavg())
    results["section_s"] = seconds
    return results


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few problems, to see that it works")
    parser.add_argument("--seed", type=_seed, default=0, help="of whatever is drawn (default: 0)")
    parser.add_argument(
        "--only", nargs="+", choices=ORDER, metavar="SECTION", help=", ".join(ORDER)
    )
    parser.add_argument(
        "--out", type=Path, default=Path("build"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--quiet", action="store_true", help="no progress")
    return parser


def _seed(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"got {text}, expected 0 or more")
    return value
