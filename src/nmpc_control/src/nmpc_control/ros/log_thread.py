# SPDX-License-Identifier: MIT
"""Log messages leave in a thread of their own.

rospy writes them where they are made: a terminal that is stopped would block that thread, one that
is gone or a full disk raise in it.
"""

import logging
import queue
import threading
from contextlib import contextmanager
from typing import Iterator, List, Optional, Tuple

CAPACITY = 1000  # messages that may wait; what comes then is lost
PATIENCE = 1.0  # [s] for the last ones

Job = Optional[Tuple[logging.Handler, logging.LogRecord]]  # None: the end


class Deferred(logging.Handler):
    """Leaves the work to another handler, in the thread that takes the jobs."""

    def __init__(self, handler: logging.Handler, jobs: "queue.Queue[Job]") -> None:
        super().__init__(handler.level)
        self.handler = handler
        self._jobs = jobs

    def emit(self, record: logging.LogRecord) -> None:
        """Take a record; never blocks, never raises."""
        try:
            self._jobs.put_nowait((self.handler, record))
        except queue.Full:
            pass


@contextmanager
def logging_in_a_thread() -> Iterator[None]:
    """Have all loggers write from a thread, until the end of the block."""
    jobs: "queue.Queue[Job]" = queue.Queue(CAPACITY)
    loggers = [logger for logger in _loggers() if logger.handlers]
    before = [list(logger.handlers) for logger in loggers]
    for logger in loggers:
        logger.handlers = [Deferred(handler, jobs) for handler in logger.handlers]
    writer = threading.Thread(target=_write, args=(jobs,), name="log", daemon=True)
    writer.start()
    try:
        yield
    finally:
        for logger, handlers in zip(loggers, before):
            logger.handlers = handlers
        try:
            jobs.put(None, timeout=PATIENCE)
        except queue.Full:
            pass
        writer.join(PATIENCE)


def _loggers() -> List[logging.Logger]:
    known = logging.getLogger().manager.loggerDict.values()
    return [logging.getLogger(), *(one for one in known if isinstance(one, logging.Logger))]


def _write(jobs: "queue.Queue[Job]") -> None:
    for handler, record in iter(jobs.get, None):
        try:
            handler.handle(record)
        except Exception:  # noqa: BLE001 (whatever it is, there is nobody left to tell)
            pass
