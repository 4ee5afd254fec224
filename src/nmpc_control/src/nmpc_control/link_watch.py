# SPDX-License-Identifier: MIT
"""What the times in a plan tell of the controller's clock and of the way to it and back.

A plan carries two stamps: that of the newest telemetry it was made from, set by the computer on the
aircraft, and its own, set by the controller's computer. Nothing arrives before it was sent, so

    received - t - solving  =  way up - offset,    t - telemetry  =  way down + offset,

where the offset is what the controller's clock is ahead by. Both ways take some time, so each plan
bounds the offset from both sides, and the tightest bounds of many plans are those of the quickest
ways: the middle between them is wrong by half their difference at most (the reasoning of NTP).
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Deque, Tuple

from nmpc_control.state import Plan

WINDOW = 40  # [1] plans that are looked at; a stall of the link does not empty it


@dataclass(frozen=True)
class LinkParameters:
    """What is tolerated of the controller's clock."""

    clock_tolerance: float = field(metadata={"min": 1e-3})  # [s] offset from which none is flown


class LinkWatch:
    """Bounds of the offset and the delay, from the last plans."""

    def __init__(self, params: LinkParameters) -> None:
        self.params = params
        self._bounds: Deque[Tuple[float, float]] = deque(maxlen=WINDOW)
        self._delays: Deque[float] = deque(maxlen=WINDOW // 2)

    def forget(self) -> None:
        """Drop all plans, as when the own clock has jumped."""
        self._bounds.clear()
        self._delays.clear()

    def take(self, received: float, plan: Plan) -> None:
        """Look at a plan that was received at a time [s] of the own clock.

        One that does not tell what it was made from tells nothing here.
        """
        least, most = plan.t + plan.solve_time - received, plan.t - plan.state_t
        if not (math.isfinite(least) and math.isfinite(most)):
            return
        self._bounds.append((least, most))
        self._delays.append(most - least)
        if self._least > self._most:  # a clock was set meanwhile: what was before is not true now
            self._bounds = deque([(least, most)], maxlen=WINDOW)

    @property
    def offset(self) -> float:
        """By what [s] the controller's clock is ahead of the own; NaN before a plan told."""
        return 0.5 * (self._least + self._most) if self._bounds else math.nan

    @property
    def delay(self) -> float:
        """Longest time [s] of a second from telemetry to the plan made of it, without solving."""
        return max(self._delays, default=math.nan)

    @property
    def finding(self) -> str:
        """Why no plan may be flown, in words; empty where nothing is wrong with the clocks."""
        offset = self.offset
        if not abs(offset) > self.params.clock_tolerance:
            return ""
        where = "ahead of" if offset > 0.0 else "behind"
        return f"the controller's clock is {abs(offset):.2f} s {where} the guard's"

    @property
    def _least(self) -> float:
        return max(least for least, _ in self._bounds)

    @property
    def _most(self) -> float:
        return min(most for _, most in self._bounds)
