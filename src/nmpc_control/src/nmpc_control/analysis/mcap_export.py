# SPDX-License-Identifier: MIT
"""The command ``bag_to_mcap``: a bag as MCAP, for Foxglove; also one that ROS's tools refuse.

The messages stay as they are, in ROS 1's own encoding, so nothing is decoded.
"""

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, Iterable, List, Optional, Sequence, Tuple

from mcap.writer import Writer

from nmpc_control.analysis.bag_file import BagFile
from nmpc_control.analysis.progress import progress_of
from nmpc_control.errors import BagError

PROGRAM = "bag_to_mcap"


def main(argv: Optional[Sequence[str]] = None) -> None:
    """Run the command; exits with status 2 on bad input."""
    parser = argparse.ArgumentParser(
        PROGRAM,
        description="Convert ROS 1 bags to MCAP for Foxglove, beside each bag or into a folder. "
        "Damaged bags are converted as far as they can be read.",
    )
    parser.add_argument("bags", nargs="+", type=Path, metavar="BAG", help="a recorded flight")
    parser.add_argument("--output", type=Path, metavar="DIR", help="folder for the files")
    arguments = parser.parse_args(argv)
    has_failed = False
    for bag in arguments.bags:
        target = (arguments.output or bag.parent) / f"{bag.stem}.mcap"
        try:
            if arguments.output is not None:
                arguments.output.mkdir(parents=True, exist_ok=True)
            count, remarks = convert(bag, target)
        except (BagError, OSError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            sys.stderr.write(f"{PROGRAM}: {bag}: {reason}\n")
            has_failed = True
            continue
        sys.stdout.write(f"{target}: {count} messages\n")
        for remark in remarks:
            sys.stderr.write(f"{PROGRAM}: {bag}: {remark}\n")
    if has_failed:
        sys.exit(2)


def convert(bag: Path, target: Path) -> Tuple[int, List[str]]:
    """Write the bag's messages to an MCAP file; return their number and what was wrong with it.

    Raises:
        BagError: it is no bag, or holds no messages.
        OSError: a file cannot be read or written.
    """
    with BagFile(bag) as source:
        connections = source.connections
        count = sum(c.msgcount for c in connections)
        if not count:
            raise BagError("the bag holds no messages")
        shown = progress_of(bag)
        with target.open("wb") as stream:
            writer = Writer(stream)
            writer.start(profile="ros1", library="nmpc_control")
            channels = _channels(writer, connections)
            messages: Iterable[Any] = shown(source.messages(channels), count)
            written = 0
            for connection, time, raw in messages:
                writer.add_message(channels[connection], time, raw, time, written)
                written += 1
            writer.finish()
        return written, source.remarks


def _channels(writer: Writer, connections: Sequence[Any]) -> Dict[int, int]:
    """Return the MCAP channel of every connection."""
    schemas: Dict[Any, int] = {}
    channels = {}
    for c in connections:
        name = c.msgtype.replace("/msg/", "/")
        key = (name, c.definition)
        if key not in schemas:
            schemas[key] = writer.register_schema(name, "ros1msg", c.definition.encode())
        channels[c.id] = writer.register_channel(c.topic, "ros1", schemas[key])
    return channels
