# SPDX-License-Identifier: MIT
"""Calls of dji_sdk beside the loop, repeated as the guard's node repeats them."""

from collections import deque
from typing import Callable, Deque, List, Optional, Sequence

from nmpc_control.guard_data import Action

ATTEMPTS = 3  # [1] as in nmpc_control.ros.dji_services
PAUSE = 1.0  # [s] between attempts, the same


class ServiceCalls:
    """One call after the other; a newer order makes older ones obsolete."""

    def __init__(
        self,
        call: Callable[[Action], bool],
        call_time: Callable[[Action], float],
        on_authority: Callable[[bool], None],
        on_failure: Callable[[str], None],
        on_landing: Callable[[], None],
    ) -> None:
        """Begin without an order.

        Args:
            call: makes a call; returns whether it was granted.
            call_time: for how long [s] it blocks.
            on_authority: told what a call about it has brought.
            on_failure: told in words after the last attempt.
            on_landing: told when a call to land was granted.
        """
        self._call, self._call_time = call, call_time
        self._on_authority, self._on_failure = on_authority, on_failure
        self._on_landing = on_landing
        self._orders: Deque[Action] = deque()
        self._attempt = 0
        self._due: Optional[float] = None  # [s] when the present call ends, or is tried again
        self._is_under_way = False
        self._is_obsolete = False

    def order(self, actions: Sequence[Action]) -> None:
        """Carry out the actions, as long as each one succeeds."""
        if not actions:
            return
        self._is_obsolete = self._is_under_way  # nobody can take back a call that blocks
        first: List[Action] = [self._orders[0]] if self._is_under_way else []
        self._orders = deque([*first, *actions])
        if not self._is_under_way:
            self._attempt, self._due = 0, None

    def step(self, t: float) -> None:
        """Go on at ``t`` [s]."""
        while self._orders:
            action = self._orders[0]
            if self._due is not None and t < self._due - 1e-9:
                return
            if not self._is_under_way:
                self._is_under_way, self._due = True, t + self._call_time(action)
                continue
            self._is_under_way, self._due = False, None
            self._end(t, action, self._call(action))

    def _end(self, t: float, action: Action, granted: bool) -> None:
        if self._is_obsolete:
            self._is_obsolete, self._attempt = False, 0
            self._orders.popleft()
        elif granted:
            self._attempt = 0
            self._orders.popleft()
            if action in (Action.OBTAIN_AUTHORITY, Action.RELEASE_AUTHORITY):
                self._on_authority(action is Action.OBTAIN_AUTHORITY)
            elif action is Action.LAND:
                self._on_landing()
        elif self._attempt < ATTEMPTS - 1:
            self._attempt, self._due = self._attempt + 1, t + PAUSE
        else:
            self._attempt = 0
            self._orders.clear()
            self._on_failure(f"{action.value} was refused")
