# SPDX-License-Identifier: MIT
"""How long a goal may be held up, and when it is late or makes no headway at all."""

from typing import Optional

import numpy as np

from nmpc_control.params import Flight

_FREE = 3.0  # [s] of going on after which patience begins anew
_HEADWAY = 0.5  # [s] of the reference; less than this in `patience` is none
_AT_MOST = 3.0  # times `patience` without headway, also if it was held up now and then


class Patience:
    """Times of one goal: since when it is held up, and when the reference last went on.

    It is held up before obstacles, or while the guard brakes. Where the guard brakes for what the
    solver does not see, the two take turns for ever: a moment of going on is no progress.
    """

    def __init__(self, flight: Flight, t: float) -> None:
        """Begin at time ``t`` [s]."""
        self.is_held = False
        self._flight = flight
        self._held_since: Optional[float] = None
        self._held_last = -np.inf  # [s]
        self._farthest, self._headway_at = 0.0, t

    def update(self, t: float, is_held: bool, reached: float) -> bool:
        """Note at ``t`` [s] whether it is held up; return whether it has just been let go.

        Args:
            t: [s] now.
            is_held: whether it is held up.
            reached: [s] of the reference's time; what comes after its end is no headway.
        """
        released, self.is_held = self.is_held and not is_held, is_held
        if is_held:
            self._held_since = t if self._held_since is None else self._held_since
            self._held_last = t
        elif t - self._held_last > _FREE:
            self._held_since = None
        if reached > self._farthest + _HEADWAY:
            self._farthest, self._headway_at = reached, t
        return released

    def ended(self, t: float) -> str:
        """Return why the goal is to be given up at ``t`` [s]; "" while it is not.

        Without headway it ends, whatever keeps it from going on.
        """
        patience = self._flight.patience
        if self.is_held and t - self._held_since > patience:
            return f"held up for {patience:g} s"
        standing = t - self._headway_at
        if min(standing, t - self._held_last) > patience or standing > _AT_MOST * patience:
            return f"no headway for {standing:.0f} s"
        return ""

    def late(self, t: float, over: float) -> bool:
        """Return whether the end should have been reached at ``t`` [s].

        Args:
            t: [s] now.
            over: [s] since the reference's end; only what was not held up at last is counted.
        """
        return min(over, t - self._held_last) > self._flight.arrival_timeout
