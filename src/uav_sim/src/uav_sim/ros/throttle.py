# SPDX-License-Identifier: MIT
"""Log lines of which each kind comes at most once a second, with a count of those left out."""

import re
import time
from threading import Lock
from typing import Callable, Dict, List, Optional

PERIOD = 1.0  # [s] of wall time
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?([eE][-+]?\d+)?|\binf\b|\bnan\b)")


class _Kind:
    def __init__(self, t: float, text: str) -> None:
        self.shown = t
        self.text = text
        self.hidden = 0


class Throttle:
    """Lines that differ only in their numbers are of one kind; any thread may ask."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = Lock()
        self._kinds: Dict[str, _Kind] = {}

    def line(self, text: str) -> Optional[str]:
        """Return the line to write now for something that happened, or None."""
        now, key = self._clock(), _NUMBER.sub("#", text)
        with self._lock:
            kind = self._kinds.get(key)
            if kind is None:
                self._kinds[key] = _Kind(now, text)
                return text
            kind.text = text
            kind.hidden += 1
            return self._show(kind, now) if now - kind.shown >= PERIOD else None

    def overdue(self) -> List[str]:
        """Return lines for what was left out more than a second ago; forgets kinds long unseen."""
        now, lines = self._clock(), []
        with self._lock:
            for key, kind in list(self._kinds.items()):
                if now - kind.shown >= PERIOD:
                    if kind.hidden:
                        lines.append(self._show(kind, now))
                    else:
                        del self._kinds[key]
        return lines

    @staticmethod
    def _show(kind: _Kind, now: float) -> str:
        count, kind.shown, kind.hidden = kind.hidden, now, 0
        return f"{kind.text} ({count} times in the last second)" if count > 1 else kind.text
