# SPDX-License-Identifier: MIT
"""The controller on a workstation: between it and the guard a link with delay, loss and clock skew.

Telemetry and what the guard did go down, plans go up, each topic on a connection of its own, as
ROS has it. With TCP nothing is lost: what is lost on the air is sent again later, and everything
behind it waits. Stamps of telemetry are those of the aircraft's computer, stamps of plans those of
the workstation.
"""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Any, Callable, Deque, Dict, Optional, Tuple

import numpy as np

from nmpc_control.controller import Step
from nmpc_control.guard_data import Action, GuardOutput
from nmpc_control.state import NU, NX, Goal, Plan
from uav_sim.closed_loop.loop import ClosedLoop, hear

STATE = ("attitude", "imu", "velocity", "local_position")


@dataclass(frozen=True)
class LinkQuality:
    """One way of the link; both are alike."""

    delay: float = 0.0  # [s] least
    jitter: float = 0.0  # [s] mean of what comes on top, exponentially distributed
    loss: float = 0.0  # [1] part of the packets that is lost on the air
    retransmission: float = 0.2  # [s] until one that was lost is sent again; Linux waits as long
    skew: float = 0.0  # [s] by which the workstation's clock is ahead


class Channel:
    """One TCP connection: everything arrives, once, in order."""

    def __init__(self, quality: LinkQuality, rng: np.random.Generator) -> None:
        self.quality = quality
        self.is_up = True  # False: what is sent meanwhile arrives when it is up again
        self._rng = rng
        self._under_way: Deque[Tuple[float, Any]] = deque()
        self._last = -math.inf  # [s] arrival of the newest

    def send(self, t: float, item: Any) -> None:
        """Send something at ``t`` [s]."""
        quality, at = self.quality, t
        while quality.loss and self._rng.random() < quality.loss:
            at += quality.retransmission
        at += quality.delay
        if quality.jitter:
            at += self._rng.exponential(quality.jitter)
        self._last = max(self._last, at)
        self._under_way.append((self._last, item))

    def receive(self, t: float) -> Tuple[Any, ...]:
        """Return what has arrived by ``t`` [s] and was not returned before."""
        arrived = []
        while self.is_up and self._under_way and self._under_way[0][0] <= t + 1e-9:
            arrived.append(self._under_way.popleft()[1])
        return tuple(arrived)


class LinkedLoop(ClosedLoop):
    """A closed loop whose controller is at the other end of a link.

    The position comes from GPS; obstacles are those that stand, known at both ends.
    """

    def __init__(
        self, *arguments: Any, link: Optional[LinkQuality] = None, seed: int = 0, **more: Any
    ) -> None:
        """Arguments as of ``ClosedLoop``; ``seed`` of all that is random on the link."""
        super().__init__(*arguments, **more)
        self.link = link or LinkQuality()
        self._rng = np.random.default_rng(seed)
        self._channels: Dict[str, Channel] = {}
        self._newest = math.nan  # [s] stamp of the newest attitude that the controller has heard

    def cut(self, is_up: bool) -> None:
        """Take the link down, or have it up again."""
        for channel in self._channels.values():
            channel.is_up = is_up

    @property
    def controller_time(self) -> float:
        """Time [s] by the workstation's clock."""
        return self.t + self.link.skew

    def step(self) -> None:
        """Advance by one step of the plant; first of all everybody hears what has arrived."""
        for name in tuple(self._channels):
            for deliver in self._channels[name].receive(self.t):
                deliver()
        super().step()

    def hear(self, topic: str, t: float, value: Any) -> None:
        """Hand the state to the guard at once, and to the controller over the link."""
        controller, guard = self.sources

        def at_the_workstation() -> None:
            hear(controller, topic, min(t, self.controller_time), value)  # as the node does
            if topic == "attitude":
                self._newest = t

        hear(guard, topic, t, value)
        if topic in STATE:
            self._send_by(topic, at_the_workstation)

    def solve(self) -> None:
        """Let the controller do one step; send its plan, or why there is none."""
        t = self.controller_time
        step = self.controller.step(t)
        if step is not None:
            self.deliver(step)
            return
        nothing = self._nothing(t)
        self._send_by("plan", lambda: self.inbox.add_plan(nothing, Goal.HOLD))

    def deliver(self, step: Step) -> None:
        """Send a plan to the guard."""
        step = replace(step, plan=replace(step.plan, state_t=self._newest, solve_time=0.0))
        self._send_by("plan", lambda: self.inbox.add_plan(step.plan, step.goal))
        if self.controller.itinerary.clock_start is not None:
            self.log.clock_start = self.controller.itinerary.clock_start - self.link.skew
        self.log.steps.append(step)

    def report(self, t: float, output: GuardOutput) -> None:
        """Send the controller what the guard did."""
        report = super().report
        self._send_by("status", lambda: report(t, output))

    def tell(self, action: Action, output: GuardOutput) -> None:
        """Send the controller what it is to do."""
        tell = super().tell
        self._send_by("request", lambda: tell(action, output))

    def _nothing(self, t: float) -> Plan:
        """Return what the node sends in place of a plan, at ``t`` [s]: why there is none."""
        states, inputs = np.zeros((2, NX)), np.zeros((1, NU))
        why = self.controller.why_not(t)
        return Plan(t, 1.0, 0.0, states, inputs, found=False, status=why, state_t=self._newest)

    def _send_by(self, topic: str, deliver: Callable[[], None]) -> None:
        if topic not in self._channels:
            self._channels[topic] = Channel(self.link, self._rng)
        self._channels[topic].send(self.t, deliver)
