# SPDX-License-Identifier: MIT
"""What went wrong twice within a while is not trusted again until somebody asks for a new start.

A brake makes some faults look good: at rest a state that stands still is right, and no command is
missed. Without this memory the aircraft would set out on them again and again.
"""

import math

APART = 0.3  # [s] a shorter pause does not end what is wrong
SOON = 30.0  # [s] from the end of one time to the beginning of the next


class Distrust:
    """Counts how often something went wrong; ``stands`` from the second time on."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Trust again, and remember nothing."""
        self.stands = False
        self._last = -math.inf  # [s] when it was wrong last

    def forgive(self) -> None:
        """Trust again: somebody has asked for automatic flight."""
        self.stands = False

    def note(self, t: float, is_wrong: bool) -> None:
        """Take whether it is wrong at ``t`` [s]."""
        if is_wrong:
            self.stands |= APART < t - self._last <= SOON
            self._last = t
