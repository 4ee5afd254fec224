# SPDX-License-Identifier: MIT
"""Writes ``doc/modes.md`` from the rules that are flown: ``python -m nmpc_control.modes_table``."""

import argparse
import sys
from pathlib import Path
from typing import List, Optional, Sequence

from nmpc_control.config import config_directory
from nmpc_control.errors import ConfigError
from nmpc_control.mode_inputs import Mode
from nmpc_control.mode_rules import RULES, Rule

MEANING = {
    Mode.WAITING: "something stands against a start; the reason says what",
    Mode.READY: "`start` would be accepted",
    Mode.TAKING_OFF: "the flight controller's own take-off; no setpoints",
    Mode.FLYING: "on a verified plan towards a goal",
    Mode.HOVERING: "on a verified plan that holds position",
    Mode.BRAKING: "no plan is flown: brake and hold, by DJI's own velocity control with good GPS",
    Mode.LANDING: "hold until the flight controller's own landing begins, then no setpoints",
    Mode.MANUAL: "the pilot flies; the state is followed, a trajectory waits; no setpoints",
    Mode.RELEASED: "authority was given back; no setpoints until a new `start`",
    Mode.FAULT: "needs a person; no setpoints until a new `start`",
}

HEAD = """# Modes of a flight

Written by `python -m nmpc_control.modes_table` from `mode_rules.py`; do not edit.

`modes.next_mode(mode, inputs, parameters)` is a pure function: it asks for no time and remembers
nothing. In each tick of the guard the first rule that applies to the present mode decides. Names
in `code` are parameters below `modes:` in `config/guard.yaml`, or services.

| mode | meaning |
|---|---|
"""

RULES_HEAD = """
## Transitions, in the order in which they are looked at

| # | from | to | when | reason code | reason |
|---|---|---|---|---|---|
"""

END = """
## When the guard itself is ended in the air

Ctrl-C (SIGINT), SIGTERM and `rosnode kill`: it brakes and holds as in `braking`, reason code
`leaving`, and meanwhile gives authority back to dji_sdk. Only when that is acknowledged, or after
12 s without an answer, the stream stops; a last status `released` follows, and the process ends.
Then DJI's own control holds the aircraft, and the pilot's sticks act. On the ground it ends at
once. `roslaunch` sends SIGINT, after 15 s SIGTERM, 2 s later SIGKILL: the 12 s fit in.

A second signal ends it at once. That, SIGKILL, a crash or the loss of power stop the stream
within one period; authority is not given back, and nothing starts the guard again. What an M100
does then is documented nowhere: the pilot takes over with the switch. The simulator keeps the last
setpoint for its `cmd_timeout` (0.5 s, an assumption), then levels, brakes and, with good GPS,
holds position; the sticks act. A guard that is started anew waits, and sends nothing before
`start`.

A guard that is stopped for a while (SIGSTOP) goes on from what it hears next.

The controller may end in any way at any time: the guard flies the last verified plan, then brakes
and holds; a controller that a person starts again is flown once its plans have been usable for
`recover_time`. The ROS master may end, too: nothing in flight asks it for anything, and the guard
can still land and give authority back; services of the guard can then only be reached by who has
called them before. Launch `dji_sdk` apart: what is launched with the guard ends with it.
"""


def table() -> str:
    """Return the document."""
    modes = [f"| {_name(mode)} | {MEANING[mode]} |" for mode in Mode]
    rules = [_row(number, rule) for number, rule in enumerate(RULES, 1)]
    return HEAD + "\n".join(modes) + "\n" + RULES_HEAD + "\n".join(rules) + "\n" + END


def _row(number: int, rule: Rule) -> str:
    cells = (str(number), _names(rule.modes), _name(rule.to), rule.words, f"`{rule.code}`")
    return f"| {' | '.join(cells)} | {rule.reason or '(what stands against it)'} |"


def _names(modes: Sequence[Mode]) -> str:
    return ", ".join(_name(mode) for mode in modes)


def _name(mode: Mode) -> str:
    return mode.name.lower().replace("_", " ")


def main(argv: Optional[List[str]] = None) -> None:
    """Write the document; exit status 2 where that is not possible."""
    parser = argparse.ArgumentParser(prog="modes_table", description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, help="default: the package's doc/modes.md")
    options = parser.parse_args(argv)
    try:
        path = options.file or config_directory().parent / "doc" / "modes.md"
        path.write_text(table(), encoding="utf-8")
    except ConfigError as error:
        parser.error(str(error))
    except OSError as error:
        parser.error(f"{path}: {error.strerror}")
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
