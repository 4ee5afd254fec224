# SPDX-License-Identifier: MIT
"""Where the aircraft should be when: hold, approach a start, fly a trajectory, hold its end."""

from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from nmpc_control.params import Flight
from nmpc_control.patience import Patience
from nmpc_control.reference_clock import ReferenceClock
from nmpc_control.state import NX, POSITION, VELOCITY, YAW, YAW_RATE, Goal
from nmpc_control.trajectory import Trajectory, approach


@dataclass(frozen=True)
class Outcome:
    """How a goal ended."""

    arrived: bool
    message: str


class Itinerary:
    """Sequence of references.

    ``update`` moves it on, ``reference`` samples it, nothing asks for the time.
    """

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.goal = Goal.HOLD
        self.outcome: Optional[Outcome] = None  # of the last goal; None while one is pursued
        self.trajectory: Optional[Trajectory] = None  # the one that is flown or approached
        self.clock_start: Optional[float] = None  # [s] time at which the trajectory began
        self._hold: Tuple[np.ndarray, float] = (np.zeros(3), 0.0)
        self._leg: Optional[Trajectory] = None
        self._clock: Optional[ReferenceClock] = None
        self._suspended: Optional[Goal] = None
        self._left: Optional[float] = None  # [s] of the trajectory, where it goes on after a leg
        self._waits_since: Optional[float] = None  # [s] for somebody to ask for it, since when
        self._patience: Optional[Patience] = None  # with the goal
        self._settled_since: Optional[float] = None

    @property
    def is_pursuing(self) -> bool:
        """Whether there is a goal that is not over, under way or suspended."""
        return self.goal is not Goal.HOLD or self._suspended is not None

    def hold(self, position: np.ndarray, yaw: float, message: str = "told to hold") -> None:
        """Hold a position (3,) [m] and yaw [rad]; a goal that was pursued ends without arrival."""
        if self.is_pursuing:
            self._end(False, message)
        self._hold = (np.array(position, dtype=float), float(yaw))

    @property
    def waits(self) -> bool:
        """Whether a goal waits until ``take_up``."""
        return self._waits_since is not None

    def suspend(self, position: np.ndarray, yaw: float) -> None:
        """Hold a position (3,) [m] and yaw [rad] for a while; the goal and its clock wait."""
        if self.goal is not Goal.HOLD:
            self._suspended, self.goal = self.goal, Goal.HOLD
        self._hold = (np.array(position, dtype=float), float(yaw))

    def resume(self, t: float) -> None:
        """Go on at ``t`` [s] with the goal where it was suspended, if nobody is to ask for it."""
        if self._suspended is not None and not self.waits:
            self.goal, self._suspended = self._suspended, None
            self._clock.resume(t)

    def leave_to_pilot(self, t: float, position: np.ndarray, yaw: float) -> None:
        """Suspend the goal at ``t`` [s] until it is asked for, or ``flight.memory`` is over."""
        self.suspend(position, yaw)
        if self._suspended is None:
            return
        if self._waits_since is None:
            self._waits_since = t
        self.forget_in_time(t)

    def forget_in_time(self, t: float) -> None:
        """Drop a goal that has waited for too long at ``t`` [s]."""
        if self.waits and t - self._waits_since > self.flight.memory:
            self._end(False, f"not taken up again within {self.flight.memory:g} s")

    def take_up(self, t: float, position: np.ndarray, yaw: float) -> None:
        """Fly from a position (3,) [m] to where the goal was left, settle, and go on with it."""
        suspended, time = self._suspended, self._clock.time
        if suspended is Goal.APPROACH:
            end = self._leg.sample(np.array([self._leg.duration]))
            target, target_yaw, left = self._leg.end, float(end.yaw[0]), self._left
        else:
            there = self.trajectory.sample(np.array([time]))
            target, target_yaw, left = there.position[0], float(there.yaw[0]), time
        self._set_out(t, position, yaw, target, target_yaw)
        self._left = left

    def go_to(
        self, t: float, position: np.ndarray, yaw: float, target: np.ndarray, target_yaw: float
    ) -> None:
        """Fly straight from a position (3,) [m] to a target (3,) [m] and hold there."""
        self._set_out(t, position, yaw, np.asarray(target, dtype=float), target_yaw)
        self.trajectory = None

    def fly(self, t: float, position: np.ndarray, yaw: float, trajectory: Trajectory) -> None:
        """Fly from a position (3,) [m] to a trajectory's start, settle, then fly it."""
        first = trajectory.sample(np.zeros(1))
        self._set_out(t, position, yaw, first.position[0], float(first.yaw[0]))
        self.trajectory = trajectory

    def begin(self, t: float, trajectory: Trajectory, at: float = 0.0) -> None:
        """Start the trajectory's clock at ``t`` [s] wherever the aircraft is; ``at`` [s] of it."""
        self.goal, self.outcome, self._suspended = Goal.TRAJECTORY, None, None
        self.trajectory, self.clock_start = trajectory, t - at
        self._left = self._waits_since = None
        self._clock = ReferenceClock(trajectory, t - at, self.flight)
        self._clock.go_on(t, at)
        self._patience = Patience(self.flight, t)

    def is_going_to(self, target: np.ndarray) -> bool:
        """Return whether a target (3,) [m] is what ``go_to`` is under way to."""
        on_leg = self.goal is Goal.APPROACH and self.trajectory is None
        return on_leg and bool(np.linalg.norm(self._target() - target) < 1e-3)

    def update(
        self, t: float, position: np.ndarray, velocity: np.ndarray, held_up: bool = False
    ) -> None:
        """Move on at time ``t`` [s].

        Args:
            t: [s] now.
            position: (3,) [m] of the aircraft.
            velocity: (3,) [m/s] of it.
            held_up: whether obstacles or the guard keep it from going on; then time does not press.
        """
        if not self.is_pursuing or self.waits:
            return
        is_held, over = held_up or self._suspended is not None, min(0.0, self._clock.over)
        if self._patience.update(t, is_held, over + self._clock.duration):
            self._clock.release(t)
        ended = self._patience.ended(t)
        if ended:
            self._give_up(t, position, ended)
        if self.goal is Goal.HOLD:
            return
        self._clock.advance(t, position)
        near = np.linalg.norm(position - self._target()) < self.flight.arrival_distance
        at_rest = near and np.linalg.norm(velocity) < self.flight.arrival_speed
        if self._left is not None:  # the trajectory goes on in motion: the place is enough
            at_rest = np.linalg.norm(position - self._target()) < self.flight.wait_lag
        if self.goal is Goal.APPROACH:
            self._update_approach(t, position, bool(at_rest))
        elif self._clock.over >= 0.0:
            if at_rest:
                self._finish("arrived")
            elif self._patience.late(t, self._clock.over):
                self._give_up(t, position, "the trajectory's time is over, its end was not reached")

    def reference(self, times: np.ndarray) -> np.ndarray:
        """Return the reference states (M, 10) at times (M,) [s]; roll and pitch are zero."""
        x = np.zeros((len(times), NX))
        if self.goal is Goal.HOLD:
            x[:, POSITION], x[:, YAW] = self._hold
            return x
        sample, pace = self._path.sample(self._clock.read(times)), max(1.0, self._clock.rate)
        x[:, POSITION], x[:, VELOCITY] = sample.position, pace * sample.velocity
        x[:, YAW], x[:, YAW_RATE] = sample.yaw, pace * sample.yaw_rate
        return x

    def reference_time(self, t: float) -> float:
        """Return the clock of the trajectory [s] at ``t``; NaN while none is flown."""
        if self.goal is not Goal.TRAJECTORY:
            return float("nan")
        return float(self._clock.read(np.array(t)))

    def progress(self, t: float) -> float:
        """Return the part 0..1 of the trajectory's time that has passed at ``t`` [s]."""
        if self.goal is not Goal.TRAJECTORY:
            return 0.0
        return float(
            np.clip(self.reference_time(t) / max(self.trajectory.duration, 1e-9), 0.0, 1.0)
        )

    @property
    def _path(self) -> Trajectory:
        return self._leg if self.goal is Goal.APPROACH else self.trajectory

    def _set_out(
        self, t: float, position: np.ndarray, yaw: float, target: np.ndarray, target_yaw: float
    ) -> None:
        self.goal, self.outcome, self._suspended = Goal.APPROACH, None, None
        self.clock_start, self._settled_since = None, None
        self._patience = Patience(self.flight, t)
        self._left = self._waits_since = None
        self._leg = approach(
            position,
            target,
            self.flight.approach_speed,
            self.flight.approach_acceleration,
            yaw,
            target_yaw,
        )
        self._clock = ReferenceClock(self._leg, t, self.flight)

    def _target(self) -> np.ndarray:
        return self._path.end

    def _update_approach(self, t: float, position: np.ndarray, at_rest: bool) -> None:
        if not at_rest or self._clock.over < 0.0:
            self._settled_since = None
            if self._patience.late(t, self._clock.over):
                self._give_up(t, position, "the start was not reached in time")
            return
        self._settled_since = t if self._settled_since is None else self._settled_since
        if t - self._settled_since < self.flight.settle_time:
            return
        if self.trajectory is None:
            self._finish("arrived")
        else:
            self.begin(t, self.trajectory, self._left or 0.0)

    def _finish(self, message: str) -> None:
        last = self._path.sample(np.array([self._path.duration]))
        self._hold = (last.position[0], float(last.yaw[0]))
        self._end(True, message)

    def _give_up(self, t: float, position: np.ndarray, message: str) -> None:
        """Hold where the aircraft is: what was not reached is not chased without anybody's will."""
        yaw = float(self.reference(np.array([t]))[0, YAW])
        self._hold = (np.array(position, dtype=float), yaw)
        self._end(False, message)

    def _end(self, arrived: bool, message: str) -> None:
        self.goal, self.outcome = Goal.HOLD, Outcome(arrived, message)
        self._leg, self._clock, self.clock_start, self._patience = None, None, None, None
        self._suspended = self._left = self._waits_since = None
