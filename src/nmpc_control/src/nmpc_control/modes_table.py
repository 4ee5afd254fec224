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


def table() -> str:
    """Return the document."""
    modes = [f"| {_name(mode)} | {MEANING[mode]} |" for mode in Mode]
    rules = [_row(number, rule) for number, rule in enumerate(RULES, 1)]
    return HEAD + "\n".join(modes) + "\n" + RULES_HEAD + "\n".join(rules) + "\n"


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
