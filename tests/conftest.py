# SPDX-License-Identifier: MIT
"""How tests share the machine when several workers run them (``pytest -n 2 --dist loadgroup``).

Tests with ROS run on one worker, one after the other, and first, because that takes longest. The
other workers give way to their nodes. Beside a test marked ``alone`` nothing runs at all.
"""

import fcntl
import os
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Iterator, List

import pytest

_NICENESS = 10
_GIVES_WAY = pytest.StashKey[bool]()


def pytest_collection_modifyitems(config: pytest.Config, items: List[pytest.Item]) -> None:
    """Put the tests with ROS into one group: the largest, which is handed out first."""
    with_ros = [item for item in items if item.get_closest_marker("ros")]
    for item in with_ros:
        item.add_marker(pytest.mark.xdist_group("ros"))
    config.stash[_GIVES_WAY] = hasattr(config, "workerinput") and bool(with_ros)


@pytest.hookimpl(hookwrapper=True, tryfirst=True)  # outside the time limit of the test
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Wait until the test may run beside what the other workers are doing."""
    folder = item.config.cache.mkdir("workers")
    how = fcntl.LOCK_EX if item.get_closest_marker("alone") else fcntl.LOCK_SH
    with ExitStack() as machine:
        with _locked(folder / "door", fcntl.LOCK_EX):  # else a stream of others never ends
            machine.enter_context(_locked(folder / "room", how))
        if item.config.stash[_GIVES_WAY] and not item.get_closest_marker("ros"):
            os.nice(max(0, _NICENESS - os.nice(0)))
        yield


@contextmanager
def _locked(path: Path, how: int) -> Iterator[None]:
    with open(path, "w", encoding="utf-8") as file:
        fcntl.flock(file, how)
        yield
