# SPDX-License-Identifier: MIT
"""The command ``flight_metrics``: figures of recorded flights, without ROS."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any, Iterable, Iterator, List, Optional, Sequence, Tuple

from nmpc_control.analysis.bag import read_flight
from nmpc_control.analysis.metrics import VEHICLE_RADIUS, flight_metrics
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.recording import Progress
from nmpc_control.analysis.tables import as_text, write_csv
from nmpc_control.errors import BagError

PROGRAM = "flight_metrics"
_EPILOG = """\
With several bags the tables have a column and the CSV file a line for each, and the JSON file is a
list. Exit status: 0; 2 if a bag cannot be read (the others are still reported) or a file written.
"""
_LONG_WORK = 100_000  # messages from which on progress is shown

Flight = Tuple[Path, FlightRecord, Metrics]


def main(argv: Optional[Sequence[str]] = None) -> None:
    """Run the command; exits with status 2 on bad input."""
    arguments = _parser().parse_args(argv)
    flights, has_failed = _read(arguments)
    metrics = [figures for _, _, figures in flights]
    if metrics and not arguments.quiet:
        sys.stdout.write(as_text(metrics))
    try:
        _write(arguments, flights, metrics)
    except OSError as error:
        _complain(error.filename or "output", f"cannot be written: {error.strerror or error}")
        has_failed = True
    if has_failed:
        sys.exit(2)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        PROGRAM,
        description="Evaluate recorded flights: the paper's tables and more, from ROS 1 bags.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="a recorded flight")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write all figures as CSV")
    parser.add_argument(
        "--report",
        type=Path,
        metavar="DIR",
        help="write an HTML report, and its figures as PNG and PDF",
    )
    parser.add_argument(
        "--flight",
        type=_positive,
        metavar="N",
        help="which flight of a bag, from 1 (default: the last)",
    )
    parser.add_argument(
        "--namespace", metavar="NAME", help="vehicle, like /dji1 (default: the best recorded one)"
    )
    parser.add_argument(
        "--vehicle-radius",
        type=_radius,
        default=VEHICLE_RADIUS,
        metavar="M",
        help="hull [m] that clearance counts from; 0 is the paper's meaning (default: %(default)s)",
    )
    parser.add_argument("--quiet", action="store_true", help="print no tables")
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {text}, expected a number from 1 on")
    return value


def _radius(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"got {text}, expected metres from 0 to 100")
    return value


def _read(arguments: argparse.Namespace) -> Tuple[List[Flight], bool]:
    """Return the flights that can be evaluated, and whether one could not."""
    flights: List[Flight] = []
    has_failed = False
    for path in arguments.bags:
        try:
            record = read_flight(path, arguments.flight, arguments.namespace, _progress(path))
        except BagError as error:
            _complain(path, str(error))
            has_failed = True
            continue
        flights.append((path, record, flight_metrics(record, arguments.vehicle_radius)))
    return flights, has_failed


def _write(arguments: argparse.Namespace, flights: List[Flight], metrics: List[Metrics]) -> None:
    if not metrics:
        return
    if arguments.json is not None:
        content = metrics[0] if len(arguments.bags) == 1 else metrics
        text = json.dumps(content, indent=2, allow_nan=False) + "\n"
        arguments.json.write_text(text, encoding="utf-8")
    if arguments.csv is not None:
        with arguments.csv.open("w", encoding="utf-8", newline="") as stream:
            write_csv(metrics, stream)
    if arguments.report is not None:
        # matplotlib takes a second to load
        from nmpc_control.analysis.figures import write_figures
        from nmpc_control.analysis.report import html_report

        arguments.report.mkdir(parents=True, exist_ok=True)
        for path, record, figures in flights:
            stem = _stem(path, [other for other, _, _ in flights])
            images = write_figures(record, arguments.report, stem, arguments.vehicle_radius)
            page = arguments.report / f"{stem}.html"
            page.write_text(html_report(figures, images), encoding="utf-8")


def _stem(path: Path, paths: Sequence[Path]) -> str:
    """Return the bag's name for its files, with its folder's where two bags are called the same."""
    is_unique = sum(other.stem == path.stem for other in paths) == 1
    return path.stem if is_unique else f"{path.resolve().parent.name}_{path.stem}"


def _complain(subject: object, sentence: str) -> None:
    sys.stderr.write(f"{PROGRAM}: {subject}: {sentence}\n")


def _progress(path: Path) -> Progress:
    """Return a wrapper of messages that shows on a terminal how far reading is."""

    def show(messages: Iterable[Any], count: int) -> Iterator[Any]:
        is_shown = count >= _LONG_WORK and sys.stderr.isatty()
        for number, message in enumerate(messages):
            if is_shown and number % (count // 100) == 0:
                sys.stderr.write(f"\r{path.name}: {100 * number // count} %")
            yield message
        if is_shown:
            sys.stderr.write("\r\033[K")

    return show
