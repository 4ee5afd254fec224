# SPDX-License-Identifier: MIT
"""How tests share the machine when several workers run them (``pytest -n 2 --dist loadscope``).

One worker takes tests/ros, one after the other and first, because that takes longest. Meanwhile
the others give way to its nodes. Beside a test marked ``alone`` nothing else runs at all.
"""

import fcntl
import os
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Iterator, List

import pytest
from hypothesis import settings

settings.register_profile("shared machine", deadline=None)  # a busy one is no failure
settings.load_profile("shared machine")

_NICENESS = 10
_BESIDE_FLIGHTS = pytest.StashKey[bool]()


def _with_ros(nodeid: str) -> bool:
    return nodeid.startswith("tests/ros/")


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Return a scheduler that hands out tests/ros as a whole, and all other tests one by one."""
    if config.getvalue("dist") != "loadscope":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class RosFirst(LoadScopeScheduling):
        # xdist_group would do, but has no effect with pytest 9.2
        def _split_scope(self, nodeid: str) -> str:
            return "ros" if _with_ros(nodeid) else nodeid  # the largest scope comes first

    return RosFirst(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: List[pytest.Item]) -> None:
    """Note whether this is one of several workers, with flights on one of them."""
    flights = any(_with_ros(item.nodeid) for item in items)
    config.stash[_BESIDE_FLIGHTS] = flights and hasattr(config, "workerinput")


@pytest.hookimpl(hookwrapper=True, tryfirst=True)  # outside the time limit of the test
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Wait until the test may run beside what the other workers are doing."""
    if not item.config.stash[_BESIDE_FLIGHTS]:
        yield
        return
    if not _with_ros(item.nodeid):
        os.nice(max(0, _NICENESS - os.nice(0)))
    folder = item.config.cache.mkdir("workers")
    how = fcntl.LOCK_EX if item.get_closest_marker("alone") else fcntl.LOCK_SH
    with ExitStack() as machine:
        with _locked(folder / "door", fcntl.LOCK_EX):  # else a stream of others never ends
            machine.enter_context(_locked(folder / "room", how))
        yield


@contextmanager
def _locked(path: Path, how: int) -> Iterator[None]:
    with open(path, "w", encoding="utf-8") as file:
        fcntl.flock(file, how)
        yield
