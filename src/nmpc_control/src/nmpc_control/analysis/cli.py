# SPDX-License-Identifier: MIT
"""The command ``flight_metrics``: figures of recorded flights, without ROS."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import List, Optional, Sequence, Tuple

from nmpc_control.analysis import compare
from nmpc_control.analysis.bag import read_flights
from nmpc_control.analysis.inputs import controller_limits
from nmpc_control.analysis.metrics import flight_metrics
from nmpc_control.analysis.options import PROGRAM, parser
from nmpc_control.analysis.outputs import Files, Flight, write
from nmpc_control.analysis.progress import progress_of
from nmpc_control.analysis.tables import as_text, name_of, segments_as_text
from nmpc_control.errors import BagError, ConfigError


def main(argv: Optional[Sequence[str]] = None) -> None:
    """Run the command; exits with status 2 on bad input."""
    options = parser()
    arguments = options.parse_args(argv)
    if arguments.between and not arguments.between[0] < arguments.between[1]:
        options.error("argument --between: expected START before END")
    try:
        limits = arguments.vehicle and controller_limits(arguments.vehicle)
    except ConfigError as error:
        _complain(str(error))
        sys.exit(2)
    arguments.limits = limits
    baseline, has_failed = _read(arguments, arguments.baseline)
    flights, also_failed = _read(arguments, arguments.bags)
    has_failed |= also_failed
    everything = baseline + flights
    if everything:
        comparisons = _comparison(baseline, flights, arguments.vehicle_radius)
        if not arguments.quiet:
            _print(everything, comparisons, len(baseline))
        has_failed |= not _write(arguments, everything, comparisons)
    if has_failed:
        sys.exit(2)


def _read(arguments: argparse.Namespace, paths: Sequence[Path]) -> Tuple[List[Flight], bool]:
    """Return the flights that can be evaluated, and whether one could not."""
    flights: List[Flight] = []
    has_failed = False
    for path in paths:
        try:
            records = read_flights(path, arguments.flight, arguments.namespace, progress_of(path))
        except BagError as error:
            _complain(f"{path}: {error}")
            has_failed = True
            continue
        for read in records:
            record = replace(read, between=arguments.between and tuple(arguments.between))
            metrics = flight_metrics(
                record, arguments.vehicle_radius, arguments.limits, arguments.segments
            )
            flights.append(Flight(path, record, metrics))
    return flights, has_failed


def _comparison(
    baseline: List[Flight], flights: List[Flight], radius: float
) -> Optional[List[compare.Comparison]]:
    """Return the differences to the baseline; without one, of a second flight to the first."""
    if not baseline and len(flights) == 2:
        baseline, flights = flights[:1], flights[1:]
    if not baseline or not flights:
        return None
    return compare.compare(*([f.record for f in side] for side in (baseline, flights)), radius)


def _print(
    flights: List[Flight], comparisons: Optional[List[compare.Comparison]], count: int
) -> None:
    metrics = [flight.metrics for flight in flights]
    sys.stdout.write(as_text(metrics))
    for figures in metrics:
        sys.stdout.write(segments_as_text(figures))
    if comparisons:
        count = count or 1
        names = [", ".join(name_of(m) for m in side) for side in (metrics[count:], metrics[:count])]
        sys.stdout.write("\n" + compare.as_text(comparisons, *names))


def _write(
    arguments: argparse.Namespace,
    flights: List[Flight],
    comparisons: Optional[List[compare.Comparison]],
) -> bool:
    """Return whether everything that is wanted was written."""
    files = Files(*(getattr(arguments, name) for name in Files._fields))
    is_list = len(arguments.bags) + len(arguments.baseline) > 1 or len(flights) > 1
    try:
        complaints = write(files, flights, comparisons if arguments.baseline else None, is_list)
    except OSError as error:
        complaints = [f"{error.filename or 'output'}: cannot be written: {error.strerror or error}"]
    for complaint in complaints:
        _complain(complaint)
    return not complaints


def _complain(sentence: str) -> None:
    sys.stderr.write(f"{PROGRAM}: {sentence}\n")
