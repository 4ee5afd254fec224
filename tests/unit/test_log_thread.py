# SPDX-License-Identifier: MIT
import logging
import threading

import pytest

from nmpc_control.ros.log_thread import CAPACITY, logging_in_a_thread


class Terminal(logging.Handler):
    """Writes to a list; may be stopped, or gone."""

    def __init__(self):
        super().__init__()
        self.shown, self.open, self.is_gone = [], threading.Event(), False
        self.open.set()

    def emit(self, record):
        self.open.wait()
        if self.is_gone:
            raise OSError(32, "Broken pipe")
        self.shown.append(record.getMessage())


@pytest.fixture
def terminal():
    logger, found = logging.getLogger("rosout"), Terminal()
    logger.addHandler(found)
    yield found
    found.open.set()
    logger.removeHandler(found)


def say(text, *values):
    logging.getLogger("rosout").error(text, *values)


def test_all_is_written_in_order_and_the_handlers_come_back(terminal):
    with logging_in_a_thread():
        assert terminal not in logging.getLogger("rosout").handlers
        for number in range(20):
            say("line %d", number)
    assert terminal.shown == [f"line {number}" for number in range(20)]
    assert terminal in logging.getLogger("rosout").handlers


def test_one_that_is_gone_raises_nowhere(terminal):
    terminal.is_gone = True
    with pytest.raises(OSError, match="Broken pipe"):
        say("the twin")
    with logging_in_a_thread():
        say("lost")
    terminal.is_gone = False
    with logging_in_a_thread():
        say("again")
    assert terminal.shown == ["again"]


@pytest.mark.timeout(20)
def test_one_that_is_stopped_blocks_nobody(terminal):
    terminal.open.clear()
    with logging_in_a_thread():
        for _ in range(2 * CAPACITY):
            say("much")
        terminal.open.set()
    assert 0 < len(terminal.shown) <= CAPACITY + 1
