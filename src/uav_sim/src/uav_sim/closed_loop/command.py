# SPDX-License-Identifier: MIT
"""What the commands have in common: how they fail, and how they show progress."""

import sys
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Iterator, NoReturn

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from nmpc_control.errors import NmpcError
from uav_sim.errors import SimulatorError

BAD_INPUT, INTERRUPTED = 2, 130


def fail(program: str, text: str, status: int = BAD_INPUT) -> NoReturn:
    """End the process with one line on standard error."""
    sys.stderr.write(f"{program}: {text}\n")
    sys.exit(status)


@contextmanager
def failing_in_one_line(program: str) -> Iterator[None]:
    """Turn what the user can put right, and Ctrl-C, into one line and an exit status."""
    try:
        yield
    except KeyboardInterrupt:
        fail(program, "interrupted", INTERRUPTED)
    except (NmpcError, SimulatorError) as error:
        fail(program, str(error))
    except BrokenProcessPool:
        fail(program, "a worker died", status=1)
    except OSError as error:
        fail(program, f"{error.filename or 'output'}: {error.strerror or error}")


def progress_bar(quiet: bool) -> Progress:
    """Return a bar on standard error that tells, beside the count, a task's ``news``."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[news]}"),
        console=Console(stderr=True),
        disable=quiet,
        transient=True,
    )
