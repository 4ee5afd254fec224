# SPDX-License-Identifier: MIT
"""Arguments of ``flight_metrics``."""

import argparse
import math
from pathlib import Path
from typing import Union

from nmpc_control.analysis.bag import ALL
from nmpc_control.analysis.metrics import VEHICLE_RADIUS
from nmpc_control.analysis.segments import length_of

PROGRAM = "flight_metrics"
_EPILOG = """\
Damaged bags give the figures that are still valid; what is missing is said below the tables.
With several bags the tables have a column and the CSV file a line for each, and the JSON file is a
list. Two bags, or those of --baseline and the others, are compared: difference of the means with
its 95 % interval. With --baseline the JSON file is {schema_version, flights, comparison}.
--tum writes reference.tum and estimate.tum (and truth.tum) into DIR, into a folder for each flight
where there are several: evo_ape tum reference.tum estimate.tum gives ape_m.
Exit status: 0; 2 if a bag cannot be read (the others are still reported) or a file written.
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    found = argparse.ArgumentParser(
        PROGRAM,
        description="Evaluate recorded flights: the paper's tables and more, from ROS 1 bags.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    found.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="a recorded flight")
    found.add_argument(
        "--baseline",
        nargs="+",
        type=Path,
        default=[],
        metavar="BAG",
        help="flights that the others are compared with, for example before tuning",
    )
    _add_files(found)
    _add_choices(found)
    return found


def _add_files(found: argparse.ArgumentParser) -> None:
    found.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON")
    found.add_argument("--csv", type=Path, metavar="FILE", help="write all figures as CSV")
    found.add_argument("--latex", type=Path, metavar="FILE", help="write the paper's tables")
    found.add_argument(
        "--report",
        type=Path,
        metavar="DIR",
        help="write an HTML report for each flight, and its figures as PDF",
    )
    found.add_argument("--tum", type=Path, metavar="DIR", help="write trajectories for evo")
    found.add_argument("--quiet", action="store_true", help="print no tables")


def _add_choices(found: argparse.ArgumentParser) -> None:
    found.add_argument(
        "--flight",
        type=_flight,
        metavar="N",
        help="which flight of a bag, from 1, or all (default: the last)",
    )
    found.add_argument(
        "--segments",
        type=_segments,
        metavar="BY",
        help="also figures of parts: mode (automatic and manual apart), goal, or seconds",
    )
    found.add_argument(
        "--between",
        nargs=2,
        type=seconds,
        metavar=("START", "END"),
        help="evaluate these seconds since the bag's start (default: the scenario's phase)",
    )
    found.add_argument(
        "--namespace", metavar="NAME", help="vehicle, like /dji1 (default: the best recorded one)"
    )
    found.add_argument(
        "--vehicle",
        metavar="NAME",
        help="vehicle file whose input bounds count as saturation (default: dji_hil for flights "
        "of this controller, the paper's bounds for others)",
    )
    found.add_argument(
        "--vehicle-radius",
        type=_radius,
        default=VEHICLE_RADIUS,
        metavar="M",
        help="hull [m] that clearance counts from; 0 is the paper's meaning (default: %(default)s)",
    )


def _flight(text: str) -> Union[int, str]:
    if text == ALL:
        return ALL
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"got {text}, expected a number from 1 on, or {ALL}")
    return int(text)


def _segments(text: str) -> str:
    try:
        length_of(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def seconds(text: str) -> float:
    """Return a finite number of seconds; for argparse."""
    value = _number(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"got {text}, expected seconds")
    return value


def _radius(text: str) -> float:
    value = _number(text)
    if not 0.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"got {text}, expected metres from 0 to 100")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
