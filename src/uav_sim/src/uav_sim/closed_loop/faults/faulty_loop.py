# SPDX-License-Identifier: MIT
"""A closed loop with troubles at its joints, and with what the two nodes do about them.

What the nodes add to controller and guard is repeated here as briefly as it can be: an exception
ends no loop, a clock that steps back begins anew, services are called beside the stream, stamps
from the future count as now, and obstacles are remembered.
"""

import math
from typing import Any, List, Optional, Tuple

from nmpc_control.clock_steps import STEP, ClockSteps
from nmpc_control.controller import Controller, Step
from nmpc_control.dji import Axes, RcMode, rc_mode
from nmpc_control.estimator import Estimator
from nmpc_control.guard_data import Action, GuardInputs, GuardOutput
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_memory import ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting, fault
from nmpc_control.state import POSITION
from uav_sim.body import BodyState
from uav_sim.closed_loop.faults.service_calls import ServiceCalls
from uav_sim.closed_loop.faults.trouble import Trouble
from uav_sim.closed_loop.loop import ClosedLoop
from uav_sim.phase import Phase
from uav_sim.telemetry import Packet
from uav_sim.vicon import ViconPose

HEAR_AGAIN = 0.1  # [s] for telemetry after a jump of the clock, as in the guard's node
SENDER, STRANGER = "simulator", "stranger"


class FaultyLoop(ClosedLoop):
    """One flight; ``troubles`` are those that act now."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.senses = True
        self.troubles: List[Trouble] = []
        self.sent: List[Tuple[float, Axes]] = []  # [s] true time, what left for the aircraft
        self.against_landing = 0.0  # [s] into DJI's own landing, of the last setpoint sent
        self._lands_since = -math.inf  # [s]
        self.escape: Optional[Axes] = None  # sent in place of what the guard decides
        self.pilot_heard: Optional[float] = None  # [s] when the switch was first heard to leave F
        parameters = load_obstacle_parameters()
        self._memories = (ObstacleMemory(parameters), ObstacleMemory(parameters))
        self._calls = ServiceCalls(
            self._try, self._call_time, self._set_authority, self._fail, self._note_landing
        )
        self._posted: List[Step] = []
        self._reading = -math.inf  # [s]
        self._guard_clock, self._controller_clock = ClockSteps(), ClockSteps()
        self._deaf_until = -math.inf  # [s]

    @property
    def now(self) -> float:
        """Time [s] on the clock of the onboard computer; a small step back is waited out."""
        reading = self.t + sum(trouble.clock() for trouble in self.troubles)
        jumped = reading < self._reading - STEP
        self._reading = reading if jumped else max(reading, self._reading)
        return self._reading

    def step(self) -> None:
        """Advance by one step, and let calls and plans go on their way."""
        super().step()
        if self.aircraft.phase is not Phase.LANDING:
            self._lands_since = self.t
        self._calls.step(self.t)
        steps, self._posted = self._posted, []
        for trouble in self.troubles:
            steps = trouble.deliver(self.t, steps)
        for step in steps:
            super().deliver(step)
        if steps and self._guard_runs:
            self._look_ahead()

    @property
    def _guard_runs(self) -> bool:
        hears = self.t >= self._deaf_until
        return hears and all(trouble.runs(self.t) for trouble in self.troubles)

    def _look_ahead(self) -> None:
        """Have the guard check a plan when it comes, as its node does."""
        try:
            self.guard.look_at_plan(self.inbox.plan_inputs(self.now, self.t))
        except Exception as error:  # noqa: BLE001 (as in its node: a plan is refused)
            self.guard.ladder.refuse(f"its check failed: {type(error).__name__}: {error}")

    def heard(self) -> List[Packet]:
        """Advance the aircraft by one step; return what is heard of it."""
        packets = super().heard()
        for trouble in self.troubles:
            packets = trouble.hear(self.t, packets)
        return packets

    def captured(self) -> List[ViconPose]:
        """Return the poses that are heard."""
        poses = super().captured()
        for trouble in self.troubles:
            poses = trouble.capture(poses)
        return [pose._replace(t=pose.t + self.now - self.t) for pose in poses]

    def receive(self, topic: str, t: float, value: Any) -> None:
        """Take a value stamped by this computer."""
        if topic == "rc" and rc_mode(value, self.guard.params.rc_switch) is not RcMode.F:
            self.pilot_heard = self.pilot_heard or self.t
        super().receive(topic, min(t + self.now - self.t, self.now), value)

    def look(self) -> None:
        """Let both memories hear the lists of obstacles, those of a crowd first."""
        now = self.now
        for trouble in self.troubles:
            self._hear(now, STRANGER, trouble.crowd(now))
        listed: Optional[List[Sighting]] = [
            _sighting(state, now) for state in self.aircraft.sensed_obstacles
        ]
        for trouble in self.troubles:
            listed = None if listed is None else trouble.sight(listed)
        self._hear(now, SENDER, listed)

    def solve(self) -> None:
        """Let the controller do one step; one that raises is reported by its node, no more."""
        if self._controller_clock.went_back(self.now):
            self.controller = Controller(
                self.controller.parameters, self.guard.params.vertical_command
            )
            self.sources[0].forget(self.controller.estimator)
            self._memories[0].start_anew()
        self.controller.obstacles = self._known(0, self.controller.estimator)

        def think() -> Optional[Step]:
            return self.controller.step(self.now)

        for trouble in self.troubles:
            think = _around(trouble, self.t, think)
        try:
            step = think()
        except RuntimeError:
            self.controller.nmpc.reset()
            return
        if step is not None:
            self._posted.append(step)

    def tick(self) -> None:
        """Let the guard act if its process runs and has heard enough."""
        if self.escape is not None:
            super().send(self.escape)
            return
        if not self._guard_runs:
            return
        if self._guard_clock.went_back(self.now):
            self._deaf_until = self.t + HEAR_AGAIN
            authority, self.inbox = self.inbox.authority, GuardInbox(self.guard.params)
            self.inbox.authority = authority
            self.sources[1].forget(self.inbox.estimator)
            self._memories[1].start_anew()
            return
        self.inbox.obstacles = self._known(1, self.inbox.estimator)
        self.inbox.obstacles_stale = self._memories[1].stale(self.now)
        super().tick()

    def judge(self, inputs: GuardInputs) -> GuardOutput:
        """Return what the guard decides, or what it falls back to where it fails."""
        try:
            for trouble in self.troubles:
                trouble.before_judgement()
            return self.guard.tick(inputs)
        except Exception as error:  # noqa: BLE001 (as in its node: the aircraft is in the air)
            return self.guard.give_way(inputs.t, inputs.telemetry, error)

    def send(self, axes: Axes) -> None:
        """Let a setpoint leave, and remember it."""
        self.sent.append((self.t, axes))
        if self.aircraft.phase is Phase.LANDING:
            self.against_landing = max(self.against_landing, self.t - self._lands_since)
        super().send(axes)

    def act(self, output: GuardOutput) -> None:
        """Order calls of services, do the rest at once."""
        if Action.RELEASE_AUTHORITY in output.actions:
            self.inbox.authority = False
        told = (Action.HOLD, Action.RETURN)
        self._calls.order([action for action in output.actions if action not in told])
        for action in output.actions:
            if action in told:
                self.tell(action, output)

    def _hear(self, now: float, sender: str, listed: Optional[List[Sighting]]) -> None:
        for memory in self._memories if listed is not None else ():
            if len(listed) <= MAX_OBSTACLES:
                memory.hear(now, sender, [(s, fault(s)) for s in listed])
            else:
                memory.refuse(now, sender, "too many", f"{sender} sends {len(listed)} obstacles")

    def _known(self, which: int, aircraft: Estimator) -> Tuple[Obstacle, ...]:
        estimate = aircraft.estimate(self.now)
        place = None if estimate is None else estimate.vector[POSITION]
        return self._memories[which].obstacles(self.now, place)

    def _try(self, action: Action) -> bool:
        refused = any(trouble.refuses(action) for trouble in self.troubles)
        return not refused and self.call(action)

    def _call_time(self, action: Action) -> float:
        return max((trouble.call_time(action) for trouble in self.troubles), default=0.0)

    def _set_authority(self, is_held: bool) -> None:
        self.inbox.authority = is_held

    def _note_landing(self) -> None:
        self.inbox.landing_granted = True

    def _fail(self, sentence: str) -> None:
        self.inbox.failure = sentence


def _around(trouble: Trouble, t: float, think: Any) -> Any:
    return lambda: trouble.solve(t, think)


def _sighting(state: BodyState, t: float) -> Sighting:
    obstacle, position, velocity = state
    return Sighting(
        id=obstacle.id,
        shape=obstacle.shape,
        size=tuple(obstacle.size),
        position=tuple(position),
        velocity=tuple(velocity),
        stamp=t,
    )
