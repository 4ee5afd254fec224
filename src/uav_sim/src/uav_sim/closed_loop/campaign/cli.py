# SPDX-License-Identifier: MIT
"""Fly many drawn flights among obstacles, in parallel, faster than real time.

Flight number i of a seed is the same flight however many are flown, by however many workers. With
--json FILE finished flights are kept beside it in FILE.jsonl, and --resume goes on from there after
Ctrl-C. Exit status 0: all gates of the suite are passed; 1: not; 2: bad input.
"""

import argparse
import json
import os
import sys
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, Dict, List, Optional

from rich.console import Console

from uav_sim.closed_loop.bench.machine import machine, versions
from uav_sim.closed_loop.campaign.flying import Row
from uav_sim.closed_loop.campaign.ledger import Ledger
from uav_sim.closed_loop.campaign.runner import run
from uav_sim.closed_loop.campaign.settings import SPREAD, Settings
from uav_sim.closed_loop.campaign.suites import SUITES
from uav_sim.closed_loop.campaign.summary import summary, table
from uav_sim.closed_loop.command import INTERRUPTED, fail, failing_in_one_line, progress_bar
from uav_sim.closed_loop.options import count, seed
from uav_sim.disturbance import disturbance_names, load_disturbance
from uav_sim.preset import preset_names
from uav_sim.spread import any_preset

_PROGRAM = "campaign"


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``campaign``."""
    options = _parser().parse_args(argv)
    with failing_in_one_line(_PROGRAM):
        settings = _settings(options)
        path = None if options.json is None else Path(f"{options.json}l")
        ledger = Ledger(path, settings, options.resume)
        try:
            _fly(options, settings, ledger)
        except KeyboardInterrupt:
            kept = f"; --resume goes on from {path}" if path is not None else ""
            flown = f"{len(ledger.rows)} of {options.flights} flights"
            fail(_PROGRAM, f"interrupted after {flown}{kept}", INTERRUPTED)
        except BrokenProcessPool:
            fail(_PROGRAM, "a worker died; --resume goes on from the finished flights", status=1)
        finally:
            ledger.close()
        figures = {**_summary(settings, ledger, options), "machine": machine()}
        figures["versions"] = versions()
        if options.json is not None:
            text = json.dumps(figures, indent=1, allow_nan=False)
            options.json.write_text(text + "\n", encoding="utf-8")
    if not options.quiet:
        Console().print(table(figures))
    sys.exit(0 if figures["passed"] else 1)


def _fly(options: argparse.Namespace, settings: Settings, ledger: Ledger) -> None:
    indices = [i for i in _indices(options) if i not in ledger.rows]
    with progress_bar(options.quiet) as bar:
        task = bar.add_task(
            settings.suite,
            total=options.flights,
            completed=options.flights - len(indices),
            news="",
        )

        def on_row(row: Row) -> None:
            ledger.add(row)
            bar.update(task, advance=1, news=_news(list(ledger.rows.values())))

        run(settings, indices, options.workers, on_row)


def _news(rows: List[Row]) -> str:
    hits = sum(bool(row.get("collisions")) for row in rows)
    entered = sum(bool(row.get("margin_entered")) for row in rows)
    missing = sum(not row.get("arrived") for row in rows)
    return f"{hits} collided, {entered} in the margin, {missing} not arrived"


def _summary(settings: Settings, ledger: Ledger, options: argparse.Namespace) -> Dict[str, Any]:
    return summary(settings, [ledger.rows[i] for i in _indices(options)])


def _indices(options: argparse.Namespace) -> range:
    return range(options.first, options.first + options.flights)


def _settings(options: argparse.Namespace) -> Settings:
    """Return the settings, checked before anything is flown."""
    settings = Settings(
        options.suite,
        options.seed,
        options.plant,
        options.disturbance,
        options.avoidance == "on",
        (options.check or options.avoidance) == "on",
        tuple(options.set),
    )
    any_preset(settings.preset(0))
    load_disturbance(settings.disturbance)
    settings.parameters()
    return settings


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--suite", required=True, choices=sorted(SUITES), help="what is drawn")
    parser.add_argument("--flights", type=count, default=20, help="how many (default: 20)")
    parser.add_argument("--seed", type=seed, default=0, help="of the campaign (default: 0)")
    parser.add_argument("--first", type=seed, default=0, help="number of the first flight")
    parser.add_argument(
        "--plant",
        default="dji_hil",
        choices=[*preset_names(), SPREAD],
        help="simulated aircraft and the controller's model of it; with spread every flight has\n"
        "a random aircraft and the model is dji_hil (default: %(default)s)",
    )
    parser.add_argument(
        "--disturbance",
        default="none",
        metavar="LEVEL",
        help=f"{', '.join(disturbance_names())}, or path of a YAML file (default: %(default)s)",
    )
    parser.add_argument(
        "--avoidance", default="on", choices=["on", "off"], help="off: obstacles are not known"
    )
    parser.add_argument(
        "--check",
        choices=["on", "off"],
        help="whether failed flights had a way (default: as --avoidance)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="another value of a parameter, like avoidance.eta=2000; may be repeated",
    )
    parser.add_argument(
        "--workers", type=count, default=os.cpu_count() or 1, help="processes (default: all)"
    )
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    parser.add_argument("--resume", action="store_true", help="keep flights that are finished")
    parser.add_argument("--quiet", action="store_true", help="no progress, no table")
    return parser
