# SPDX-License-Identifier: MIT
"""The command ``identify``: from recorded flights to the controller's vehicle file, without ROS."""

import argparse
import json
import math
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NoReturn, Optional, Sequence

import numpy as np
from rich.console import Console

from nmpc_control.analysis.identification.document import as_document
from nmpc_control.analysis.identification.identify import ALWAYS, Identification, identify
from nmpc_control.analysis.identification.log import Log, read_log
from nmpc_control.analysis.identification.segments import FLIGHT, LIMITED
from nmpc_control.analysis.identification.summary import as_text
from nmpc_control.analysis.identification.vehicle_file import vehicle_yaml
from nmpc_control.analysis.options import seconds
from nmpc_control.analysis.progress import progress_of
from nmpc_control.errors import BagError, NmpcError
from nmpc_control.params import load_vehicle

PROGRAM = "identify"
_EPILOG = """\
Several bags are several flights of the same aircraft. Only segments in which the aircraft followed
the commands count; what they do not tell is null in the JSON file, beside the reason. Times are in
seconds since the bag's first message. Exit status: 0; 2 if a bag cannot be used or a file not
written. doc/identification.md says how everything is identified.
"""
_REGIMES = {"normal": FLIGHT, "limited": LIMITED}


def main(argv: Optional[Sequence[str]] = None) -> None:
    """Run the command; exits with status 2 on bad input."""
    arguments = _parser().parse_args(argv)
    _check(arguments)
    try:
        found = _identify(arguments)
        if not arguments.quiet:
            sys.stdout.write(as_text(found))
        _write(arguments, found)
    except NmpcError as error:
        _give_up(str(error))
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        bags = ", ".join(map(str, arguments.bags))
        _give_up(f"{bags}: its numbers cannot be evaluated: {error}")
    except OSError as error:
        _give_up(f"{error.filename or 'output'}: cannot be written: {error.strerror or error}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        PROGRAM,
        description="Identify an M100 from recorded commands and what followed: ROS 1 bags with "
        "dji_sdk setpoints or mav_msgs commands.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="a recorded flight")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    parser.add_argument("--write", type=Path, metavar="YAML", help="write a vehicle file")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="write residual plots")
    period = {"nargs": 2, "type": seconds, "metavar": ("FROM", "TO")}
    parser.add_argument("--fit", **period, help="identify from this part of one bag [s]")
    parser.add_argument("--validate", **period, help="state the fit on this part of it too [s]")
    parser.add_argument(
        "--regime",
        choices=tuple(_REGIMES),
        default="normal",
        help="'limited' for segments in which attitude followed a small part of the commands",
    )
    parser.add_argument(
        "--vehicle",
        default="dji_hil",
        metavar="NAME",
        help="of config/vehicles: where --write takes what bags cannot tell, as mass and hull, and "
        "what these did not (default: %(default)s)",
    )
    parser.add_argument(
        "--airframe",
        metavar="WORDS",
        help="airframe, place and date of the measurement, for thrust_map.measured_on; without "
        "them the map of a real flight stays unusable",
    )
    parser.add_argument(
        "--namespace", metavar="NAME", help="vehicle, like /dji1 (default: the best recorded one)"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing")
    return parser


def _check(arguments: argparse.Namespace) -> None:
    for name in ("fit", "validate"):
        period = getattr(arguments, name)
        if period is not None and not period[0] < period[1]:
            _give_up(f"--{name}: got {period[0]:g} {period[1]:g}, expected the earlier time first")
        if period is not None and len(arguments.bags) > 1:
            _give_up(f"--{name}: times are of one bag, got {len(arguments.bags)} bags")
    if arguments.validate is not None and arguments.fit is None:
        _give_up(
            "--validate: expected --fit too: all of the bag would be fitted, this part as well"
        )
    if len({path.resolve() for path in arguments.bags}) < len(arguments.bags):
        _give_up("the same bag twice would count its data twice")
    if arguments.write is not None and arguments.regime != "normal":
        _give_up("--write: a vehicle file is of the normal regime, got --regime limited")


def _identify(arguments: argparse.Namespace) -> Identification:
    logs = []
    for path in arguments.bags:
        try:
            name = _name(path, arguments.bags)
            logs.append(read_log(path, arguments.namespace, progress_of(path), name))
        except BagError as error:
            raise BagError(f"{path}: {error}") from None
    for option in ("fit", "validate"):
        _check_period(option, getattr(arguments, option), arguments.bags[0], logs[0])
    fit = tuple(arguments.fit) if arguments.fit else ALWAYS
    held_back = tuple(arguments.validate) if arguments.validate else None
    is_shown = sys.stderr.isatty()
    with Console(stderr=True).status("identifying") if is_shown else nullcontext():
        return identify(logs, fit, held_back, _REGIMES[arguments.regime])


def _check_period(option: str, period: Optional[Sequence[float]], path: Path, log: Log) -> None:
    first = max(log.commands.times[0], log.attitude.times[0])
    last = min(log.commands.times[-1], log.attitude.times[-1])
    if period is not None and min(period[1], last) <= max(period[0], first):
        raise BagError(
            f"{path}: --{option}: got {period[0]:g} to {period[1]:g} s, expected a part of "
            f"{first:.1f} to {last:.1f} s, where commands and attitude are"
        )


def _name(path: Path, paths: Sequence[Path]) -> str:
    """Return the bag's name, with its folder's where two bags are called the same."""
    is_unique = sum(other.name == path.name for other in paths) == 1
    return path.name if is_unique else f"{path.resolve().parent.name}/{path.name}"


def _write(arguments: argparse.Namespace, found: Identification) -> None:
    if arguments.json is not None:
        text = json.dumps(_plain(as_document(found)), indent=2, allow_nan=False) + "\n"
        arguments.json.write_text(text, encoding="utf-8")
    if arguments.figures is not None:
        # matplotlib takes a second to load
        from nmpc_control.analysis.identification.figures import write_figures

        arguments.figures.mkdir(parents=True, exist_ok=True)
        write_figures(found, arguments.figures, arguments.bags[0].stem)
    if arguments.write is not None:
        _write_vehicle(arguments, found)


def _write_vehicle(arguments: argparse.Namespace, found: Identification) -> None:
    if found.attitude.best is None and found.thrust.map is None:
        reason = found.attitude.tilt_limit.reason
        raise BagError(f"{arguments.write}: not written, as nothing was identified: {reason}")
    base = load_vehicle(arguments.vehicle)
    text, kept = vehicle_yaml(found, arguments.write.stem, base, arguments.airframe)
    arguments.write.write_text(text, encoding="utf-8")
    if kept:
        names = ", ".join(kept)
        sys.stderr.write(f"{PROGRAM}: {arguments.write}: not identified, of {base.name}: {names}\n")


def _plain(value: Any) -> Any:
    """Return data in which numbers that are not finite are null, as JSON has none."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _give_up(sentence: str) -> NoReturn:
    printable = "".join(c for c in sentence if c.isprintable())
    sys.stderr.write(f"{PROGRAM}: {printable}\n")
    sys.exit(2)
