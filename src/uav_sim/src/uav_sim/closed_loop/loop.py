# SPDX-License-Identifier: MIT
"""Controller, guard and simulated aircraft on one clock, without ROS."""

import math
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.controller import Controller, Step
from nmpc_control.dji import Axes, Task
from nmpc_control.guard import Guard
from nmpc_control.guard_data import Action, GuardInputs, GuardOutput
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.guard_params import GuardParameters
from nmpc_control.ladder import BRAKES
from nmpc_control.mode_inputs import FOLLOWED, PLANNED, STREAMING, Mode, Request
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import Parameters
from nmpc_control.scenario import Scenario
from nmpc_control.source_params import GPS, VICON, SourcesParameters, load_source_parameters
from nmpc_control.state_sources import StateSources
from uav_sim.body import BodyState
from uav_sim.disturbance import Disturbance
from uav_sim.errors import SimulatorError
from uav_sim.m100 import SimulatedM100, Truth
from uav_sim.preset import PlantPreset
from uav_sim.telemetry import Packet
from uav_sim.vicon import ViconPose
from uav_sim.world import World

OBSTACLE_PERIOD = 0.1  # [s] between two lists of sensed obstacles
_START_TIMEOUT = 30.0  # [s] from the first packet to automatic flight
_AFTER_ARRIVAL = 1.0  # [s] of hover that is still recorded
_GENERIC = "generic"
_TASKS = {Action.TAKE_OFF: Task.TAKE_OFF, Action.LAND: Task.LAND}
_SWITCH_TO_F = 0.1  # [s] when the pilot hands over: the guard must see the switch move


@dataclass
class Log:
    """What happened, sample by sample."""

    steps: List[Step] = field(default_factory=list)
    outputs: List[Tuple[float, GuardOutput]] = field(default_factory=list)
    truths: List[Truth] = field(default_factory=list)
    obstacles: List[Tuple[float, List[BodyState]]] = field(default_factory=list)  # true, moving
    clock_start: Optional[float] = None  # [s] of the trajectory's clock
    end: float = 0.0  # [s]


class NoFlightError(SimulatorError):
    """Automatic flight did not begin; the text says why."""


class ClosedLoop:
    """One vehicle under automatic control; ``step`` advances all of it by one step of the plant.

    Its position comes from motion capture where the disturbance has it, else from GPS, unless
    ``sources`` says otherwise. Obstacles that move, or drift with the position, are handed over as
    sensed, at 10 Hz.

    Its joints, for whoever wants something between the parts: ``now``, ``controller_time``,
    ``heard``, ``captured``, ``receive``, ``hear``, ``look``, ``solve``, ``deliver``, ``tick``,
    ``judge``, ``send``, ``act``, ``tell``, ``call``, ``report``.
    """

    def __init__(
        self,
        preset: PlantPreset,
        world: World,
        parameters: Parameters,
        guard_parameters: GuardParameters,
        disturbance: Optional[Disturbance] = None,
        sources: Optional[SourcesParameters] = None,
    ) -> None:
        self.aircraft = SimulatedM100(preset, world, disturbance)
        captured = disturbance is not None and disturbance.vicon is not None
        sources = sources or load_source_parameters(position_source=VICON if captured else GPS)
        is_shifted = disturbance is not None and disturbance.shift is not None
        self.senses = self.aircraft.world.moves or is_shifted  # obstacles, again and again
        self.controller = Controller(parameters, guard_parameters.vertical_command)
        self.guard = Guard(guard_parameters, parameters.vehicle, parameters.limits)
        self.inbox = GuardInbox(guard_parameters)
        estimators = (self.controller.estimator, self.inbox.estimator)
        self.sources = tuple(StateSources(sources, estimator) for estimator in estimators)
        self.log = Log()
        self._ticks = _every(1.0 / guard_parameters.rate, preset.step)
        self._solves = _every(1.0 / parameters.solver.budget.rate, preset.step)
        self._looks = _every(OBSTACLE_PERIOD, preset.step)
        self._handover = _every(_SWITCH_TO_F, preset.step)
        self._count = 0
        self.aircraft.rc.mode = "P"

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.aircraft.t

    @property
    def now(self) -> float:
        """Time [s] on the clock of the onboard computer."""
        return self.t

    @property
    def controller_time(self) -> float:
        """Time [s] on the clock of the computer on which the controller runs."""
        return self.now

    def step(self) -> None:
        """Advance by one step: telemetry, solve when due, guard when due, aircraft."""
        for packet in self.heard():
            self.receive(packet.topic, packet.t, packet.value)
        for pose in self.captured():
            for sources in self.sources:
                sources.add_pose(*pose)
        if self.senses and self._count % self._looks == 0:
            self.look()
        self._count += 1
        if self._count == self._handover:
            self.aircraft.rc.mode = "F"
        if self._count % self._solves == 0:
            self.solve()
        if self._count % self._ticks == 0:
            self.tick()
            self.log.truths.append(self.aircraft.truth)

    def heard(self) -> List[Packet]:
        """Advance the aircraft by one step; return the telemetry that came in it."""
        return self.aircraft.step()

    def captured(self) -> List[ViconPose]:
        """Return the poses of motion capture that came in this step."""
        return self.aircraft.new_poses

    def receive(self, topic: str, t: float, value: Any) -> None:
        """Take a value of ``dji_sdk``'s telemetry, stamped ``t`` [s]."""
        self.hear(topic, t, value)
        timed: Dict[str, Callable[[float, Any], None]] = {
            "rc": self.inbox.add_rc,
            "flight_status": self.inbox.add_flight_status,
            "gps_health": self.inbox.add_gps_health,
            "battery_state": self.inbox.add_battery,
        }
        if topic in timed:
            timed[topic](t, value)
        elif topic == "height_above_takeoff":
            self.inbox.add_height(value)

    def hear(self, topic: str, t: float, value: Any) -> None:
        """Hand the aircraft's state to controller and guard."""
        for sources in self.sources:
            hear(sources, topic, t, value)

    def look(self) -> None:
        """Hand over the obstacles as they are sensed now."""
        sensed = [_known(state, self.t) for state in self.aircraft.sensed_obstacles]
        self.controller.obstacles = self.inbox.obstacles = tuple(sensed)
        if self.aircraft.world.moves:
            self.log.obstacles.append((self.t, self.aircraft.world.states()))

    def solve(self) -> None:
        """Let the controller do one step, and deliver its plan."""
        step = self.controller.step(self.controller_time)
        if step is not None:
            self.deliver(step)
            self.controller.prepare()

    def deliver(self, step: Step) -> None:
        """Hand a plan to the guard."""
        self.inbox.add_plan(step.plan, step.goal)
        if self.controller.itinerary.clock_start is not None:
            self.log.clock_start = self.controller.itinerary.clock_start
        self.log.steps.append(step)

    def tick(self) -> None:
        """Let the guard act once; its setpoint leaves, its actions are carried out."""
        self.inbox.needs_gps = self.sources[1].active == GPS
        yaw = self.sources[1].yaw_disagreement(self.now)
        self.inbox.yaw_disagreement = math.nan if yaw is None else yaw
        output = self.judge(self.inbox.inputs(self.now, self.t))
        self.act(output)
        if output.axes is not None:
            self.send(output.axes)
        self.report(self.now, output)
        self.log.outputs.append((self.t, output))

    def report(self, t: float, output: GuardOutput) -> None:
        """Have the controller know what the guard did at ``t`` [s], as by its status."""
        known = output.axes is not None and output.applied is not None
        self.controller.record_input(t, np.array(output.applied) if known else None)
        self.controller.engaged = output.mode in PLANNED
        self.controller.braking = output.mode is Mode.BRAKING
        self.controller.held_back = output.mode in PLANNED and output.rung in BRAKES
        self.controller.manual = output.mode in FOLLOWED

    def judge(self, inputs: GuardInputs) -> GuardOutput:
        """Return what the guard decides."""
        return self.guard.tick(inputs)

    def send(self, axes: Axes) -> None:
        """Let a setpoint leave for the aircraft."""
        self.aircraft.setpoint(_GENERIC, axes)

    def act(self, output: GuardOutput) -> None:
        """Carry out what the guard asks for beside its setpoint."""
        for action in output.actions:
            if action in (Action.HOLD, Action.RETURN):
                self.tell(action, output)
            elif action is Action.OBTAIN_AUTHORITY:
                self.inbox.authority = self.call(action)
            elif action is Action.LAND:
                self.inbox.landing_granted = self.call(action)
            else:
                self.call(action)
                if action is Action.RELEASE_AUTHORITY:
                    self.inbox.authority = False

    def tell(self, action: Action, output: GuardOutput) -> None:
        """Tell the controller to hold, or to return."""
        now, itinerary = self.controller_time, self.controller.itinerary
        estimate = self.controller.estimator.estimate(now)
        if estimate is None:
            return
        x = estimate.vector
        if action is Action.HOLD:
            itinerary.hold(x[:3], x[5])
        elif output.target is not None:
            itinerary.go_to(now, x[:3], x[5], np.array(output.target), x[5])

    def call(self, action: Action) -> bool:
        """Call the service of dji_sdk that an action needs; return whether it was granted."""
        aircraft = self.aircraft
        if action is Action.SET_REFERENCE:
            return aircraft.set_local_position_reference()
        if action in _TASKS:
            return aircraft.task(int(_TASKS[action])).result
        return aircraft.control_authority(action is Action.OBTAIN_AUTHORITY).result


def fly(
    scenario: Scenario,
    loop: ClosedLoop,
    approach: bool = False,
    on_progress: Callable[[float], None] = lambda progress: None,
) -> Log:
    """Fly a scenario from its initial position in the air; returns the log of the whole flight.

    Args:
        scenario: what to fly; obstacles that stand are known to controller and guard from it.
        loop: aircraft and control, new.
        approach: fly to the start and settle first; otherwise the clock starts as soon as
            automatic flight is on.
        on_progress: called with 0..1.

    Raises:
        NoFlightError: automatic flight did not begin.
    """
    loop.aircraft.place(scenario.initial_position, yaw=scenario.start_yaw)
    if not loop.senses:
        loop.controller.obstacles = loop.inbox.obstacles = scenario.obstacles
    while (
        loop.guard.mode not in STREAMING
        or not loop.controller.engaged
        or loop.guard.mode.name == "BRAKING"
    ):
        loop.inbox.request = Request.START
        loop.step()
        if loop.t > _START_TIMEOUT:
            raise NoFlightError(f"automatic flight did not begin: {loop.log.outputs[-1][1].reason}")
    itinerary = loop.controller.itinerary
    x = loop.controller.estimator.estimate(loop.controller_time).vector
    if approach:
        itinerary.fly(loop.controller_time, x[:3], x[5], scenario.trajectory)
    else:
        itinerary.begin(loop.controller_time, scenario.trajectory)
    while itinerary.outcome is None and loop.guard.mode in STREAMING:
        loop.step()
        on_progress(itinerary.progress(loop.controller_time))
    end = loop.t + _AFTER_ARRIVAL
    while loop.t < end:
        loop.step()
    loop.log.end = loop.t
    return loop.log


def hear(sources: StateSources, topic: str, t: float, value: Any) -> None:
    """Hand a message of ``dji_sdk`` with the stamp ``t`` [s] to those sources that it concerns."""
    if topic == "attitude":
        sources.estimator.add_attitude(t, value)
    elif topic == "imu":
        sources.estimator.add_imu(t, value.angular_velocity)
    elif topic == "velocity":
        sources.add_velocity(t, value)
    elif topic == "local_position":
        sources.add_position(GPS, t, value)


def _known(state: BodyState, t: float) -> Obstacle:
    """Return an obstacle of the simulator as the controller's, seen at ``t`` [s]."""
    obstacle, position, velocity = state
    return Obstacle(
        obstacle.id,
        np.array(position),
        np.array(obstacle.size),
        obstacle.shape,
        np.array(velocity),
        t,
    )


def _every(period: float, step: float) -> int:
    return max(1, round(period / step))
