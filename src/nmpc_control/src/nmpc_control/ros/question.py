# SPDX-License-Identifier: MIT
"""A request of the operator on its way from a service's thread to a tick of the guard."""

import threading

from nmpc_control.mode_inputs import Request

NEVER_LATE = (Request.HOVER, Request.RELEASE)  # done even if the caller was told of no answer


class Question:
    """What an operator asks for; taken up by a tick, or given up by who waits, not both."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.answered = threading.Event()
        late = "it acts as soon as it runs" if request in NEVER_LATE else "nothing is done"
        self.answer = (False, f"the guard did not answer: {late}")
        self._decided = threading.Lock()

    def take_up(self) -> bool:
        """Return whether to act on it: nobody takes off who was told that nothing happened."""
        return self._decided.acquire(blocking=False) or self.request in NEVER_LATE

    def give_up(self) -> bool:
        """Return whether no tick has taken it up; none will then."""
        return self._decided.acquire(blocking=False)
