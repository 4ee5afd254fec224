# SPDX-License-Identifier: MIT
"""A progress bar for long reading, on terminals only."""

import sys
from pathlib import Path
from typing import Any, Iterable, Iterator

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from nmpc_control.analysis.recording import Progress as Wrapper

_LONG_WORK = 100_000  # messages from which on progress is shown
_STEPS = 200  # of the bar


def progress_of(path: Path) -> Wrapper:
    """Return a wrapper of messages that shows how far reading is."""

    def show(messages: Iterable[Any], count: int) -> Iterable[Any]:
        is_shown = count >= _LONG_WORK and sys.stderr.isatty()
        return _bar(path.name, messages, count) if is_shown else messages

    return show


def _bar(name: str, messages: Iterable[Any], count: int) -> Iterator[Any]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    step = count // _STEPS
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(escape(name), total=count)
        for number, message in enumerate(messages):
            if number % step == 0:
                bar.update(task, completed=number)
            yield message
