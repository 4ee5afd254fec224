# SPDX-License-Identifier: MIT
"""The files that ``flight_metrics`` writes."""

import json
from pathlib import Path
from typing import List, NamedTuple, Optional, Sequence

from nmpc_control.analysis.compare import Comparison, as_json
from nmpc_control.analysis.latex import as_latex
from nmpc_control.analysis.metrics import SCHEMA_VERSION
from nmpc_control.analysis.record import FlightRecord, Metrics
from nmpc_control.analysis.tables import write_csv
from nmpc_control.analysis.tum import write_tum


class Flight(NamedTuple):
    """One flight of one bag."""

    path: Path
    record: FlightRecord
    metrics: Metrics


class Files(NamedTuple):
    """What is to be written where; None: not wanted."""

    json: Optional[Path]
    csv: Optional[Path]
    latex: Optional[Path]
    report: Optional[Path]
    tum: Optional[Path]


def write(
    files: Files,
    flights: Sequence[Flight],
    comparisons: Optional[Sequence[Comparison]],
    is_list: bool,
) -> List[str]:
    """Write what is wanted; return in words what could not be written for lack of data.

    Args:
        files: What is wanted.
        flights: At least one.
        comparisons: Differences to a baseline; None without one.
        is_list: Whether JSON is a list, also of one flight.

    Raises:
        OSError: a file cannot be written.
    """
    metrics = [flight.metrics for flight in flights]
    complaints: List[str] = []
    if files.json is not None:
        content = metrics if is_list else metrics[0]
        if comparisons is not None:
            content = {
                "schema_version": SCHEMA_VERSION,
                "flights": metrics,
                "comparison": as_json(comparisons),
            }
        text = json.dumps(content, indent=2, allow_nan=False) + "\n"
        files.json.write_text(text, encoding="utf-8")
    if files.csv is not None:
        with files.csv.open("w", encoding="utf-8", newline="") as stream:
            write_csv(metrics, stream)
    if files.latex is not None:
        files.latex.write_text(as_latex(metrics), encoding="utf-8")
    if files.tum is not None:
        for flight in flights:
            folder = files.tum if len(flights) == 1 else files.tum / stem(flight, flights)
            if not write_tum(flight.record, folder):
                complaints.append(f"{flight.path}: no positions: no TUM files")
    if files.report is not None:
        _write_reports(files.report, flights)
    return complaints


def _write_reports(directory: Path, flights: Sequence[Flight]) -> None:
    # the plotting libraries take a second to load
    from nmpc_control.analysis.figures import write_figures
    from nmpc_control.analysis.report import html_report

    directory.mkdir(parents=True, exist_ok=True)
    for flight in flights:
        name = stem(flight, flights)
        radius = flight.metrics["vehicle_radius_m"]
        write_figures(flight.record, directory, name, radius)
        page = html_report(flight.record, flight.metrics)
        (directory / f"{name}.html").write_text(page, encoding="utf-8")


def stem(flight: Flight, flights: Sequence[Flight]) -> str:
    """Return a name for a flight's files that no other flight has.

    It is the bag's, with its folder's where two bags are called the same, with the flight's
    number where a bag has several.
    """
    same = {other.path for other in flights if other.path.stem == flight.path.stem}
    name = flight.path.stem
    if len(same) > 1:
        name = f"{flight.path.resolve().parent.name}_{name}"
    is_alone = sum(other.path == flight.path for other in flights) == 1
    return name if is_alone else f"{name}_{flight.record.flight[0]}"
