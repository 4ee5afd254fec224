# SPDX-License-Identifier: MIT
"""The command ``replay``: recorded commands through a plant preset, beside the recording."""

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any, Dict, Optional, Sequence

from nmpc_control.analysis.progress import progress_of
from nmpc_control.errors import BagError
from uav_sim.closed_loop.command import fail, failing_in_one_line
from uav_sim.closed_loop.replay.figure import write_figure
from uav_sim.closed_loop.replay.recorded import read_recorded
from uav_sim.closed_loop.replay.replay import LONG, Replay, replay
from uav_sim.preset import preset_names
from uav_sim.spread import any_preset

PROGRAM = "replay"
_EPILOG = f"""\
Segments in the air are split where the ground is touched, and begin with the recorded velocity and
attitude. fit = 100 (1 - |y - y_model| / |y - mean y|) over all segments; R^2 of vertical velocity
over those of at least {LONG:g} s. One constant thrust bias is fitted per bag. Where the recorded
angles are a fraction of the commanded ones, that scale is fitted, too, and said.
Exit status: 0; 2 if the bag cannot be used, or a file not written.
"""


def main(argv: Optional[Sequence[str]] = None) -> None:
    """Run the command; exits with status 2 on bad input."""
    options = _parser().parse_args(argv)
    with failing_in_one_line(PROGRAM):
        try:
            recorded = read_recorded(options.bag, options.namespace, progress_of(options.bag))
        except BagError as error:
            fail(PROGRAM, f"{options.bag}: {error}")
        result = replay(
            recorded, any_preset(options.plant), options.start, options.end, options.attitude_scale
        )
        figures = {"bag": options.bag.name, **result.figures()}
        _write(options, result, figures)
    if not options.quiet:
        sys.stdout.write(as_text(figures))


def as_text(figures: Dict[str, Any]) -> str:
    """Return the figures as lines for a terminal."""
    lines = [
        f"{figures['bag']} ({figures['source']}) through {figures['plant']}",
        f"{'in the air [s]':>19}  {'roll fit %':>10}  {'pitch fit %':>11}  {'v_z R^2':>8}",
    ]
    rows = [(f"{r['start_s']:.2f} to {r['end_s']:.2f}", r) for r in figures["segments"]]
    for name, row in [*rows, ("all", figures)]:
        roll, pitch = row["roll"]["fit_percent"], row["pitch"]["fit_percent"]
        r2 = row["vertical_velocity"]["r2"]
        lines.append(
            f"{name:>19}  {_number(roll, 1):>10}  {_number(pitch, 1):>11}  {_number(r2, 3):>8}"
        )
    lines.append(f"thrust bias fitted: {figures['thrust_bias_mps2']:+.4f} m/s^2")
    lines.extend(f"note: {remark}" for remark in figures["remarks"])
    return "\n".join(lines) + "\n"


def _write(options: argparse.Namespace, result: Replay, figures: Dict[str, Any]) -> None:
    if options.json is not None:
        text = json.dumps(figures, indent=2, allow_nan=False) + "\n"
        options.json.write_text(text, encoding="utf-8")
    image = options.figure
    if image is None:
        stem = options.json.with_suffix("") if options.json else Path(f"{options.bag.stem}_replay")
        image = stem.with_name(f"{stem.name}.png")
    write_figure(result, image, f"{options.bag.name} through {options.plant}")
    if not options.quiet:
        sys.stdout.write(f"figure: {image}\n")


def _number(value: Optional[float], digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        PROGRAM,
        description=__doc__,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="a recorded flight, ROS 1")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures as JSON")
    parser.add_argument(
        "--plant",
        default="dji_hil",
        metavar="NAME",
        help=f"{', '.join(preset_names())} or spread:SEED (default: %(default)s)",
    )
    parser.add_argument(
        "--figure",
        type=_image,
        metavar="FILE",
        help="PNG or PDF (default: beside the JSON file, or <bag>_replay.png here)",
    )
    parser.add_argument(
        "--start", type=_seconds, default=-math.inf, metavar="S", help="from this time of the bag"
    )
    parser.add_argument(
        "--end", type=_seconds, default=math.inf, metavar="S", help="until this time of the bag"
    )
    parser.add_argument(
        "--attitude-scale",
        type=_scale,
        metavar="X",
        help="of the commanded angles (default: 1, fitted only where 1 fails grossly)",
    )
    parser.add_argument("--namespace", metavar="NAME", help="vehicle, like /dji1")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    return parser


def _image(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in (".png", ".pdf"):
        raise argparse.ArgumentTypeError(f"got {text}, expected a name that ends in .png or .pdf")
    return path


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"got {text}, expected seconds from 0 on")
    return value


def _scale(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 2.0:
        raise argparse.ArgumentTypeError(f"got {text}, expected a number above 0 and up to 2")
    return value
