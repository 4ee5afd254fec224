# SPDX-License-Identifier: MIT
"""The safety process without ROS: plan check, ladder, modes and the setpoint of one tick."""

import math
from dataclasses import replace
from typing import Callable, Optional, Set, Tuple

import numpy as np

from nmpc_control import modes
from nmpc_control.braking import Brake
from nmpc_control.disturbance_estimate import DisturbanceEstimate, learnable
from nmpc_control.dji import FlightStatus
from nmpc_control.evasion import Evasion
from nmpc_control.flight_words import sentence
from nmpc_control.guard_data import Action, Command, GuardInputs, GuardOutput
from nmpc_control.guard_params import GuardParameters
from nmpc_control.ladder import PlanLadder, Rung
from nmpc_control.link_watch import LinkWatch
from nmpc_control.mode_conditions import (
    awaits_landing,
    battery_call,
    knows_motion,
    pilot_has_control,
)
from nmpc_control.mode_inputs import AUTOMATIC, PLANNED, STREAMING, Mode, ModeInputs, Request
from nmpc_control.obstacle_field import FieldOf, ObstacleField
from nmpc_control.override import Override
from nmpc_control.params import Limits, Vehicle
from nmpc_control.sent_inputs import IN_FORCE, SentInputs
from nmpc_control.setpoints import Setpoints
from nmpc_control.situation import Situation
from nmpc_control.state import VELOCITY, hover_input
from nmpc_control.verdict import Finding, Verdict

MAX_TICK = 0.1  # [s] a longer pause between ticks counts as this
FORGOTTEN = 0.5  # [s] after its effect an input no longer shows in the attitude
MAX_FAILURES = 10  # [1] ticks in a row that may raise before authority is released
_SILENT_RUNGS = {Mode.RELEASED: Rung.RELEASE, Mode.LANDING: Rung.LANDING}


class Guard:
    """Memory of one flight and ``tick``; asks for no time and knows no ROS."""

    def __init__(
        self, params: GuardParameters, vehicle: Vehicle, limits: Limits, refusal: str = ""
    ) -> None:
        """Begin waiting; ``refusal`` says why this launch must never start, if so."""
        self.params = params
        self.vehicle = vehicle
        self.mode = Mode.WAITING
        self.situation = Situation(params, vehicle, limits, refusal)
        self._setpoints = Setpoints(params, vehicle)
        self._sent = SentInputs(vehicle)
        self.ladder = PlanLadder(params.plan_check, params.hold_timeout, vehicle, limits)
        self.link = LinkWatch(params.link)
        self._brake = Brake(vehicle, limits, params.brake)
        self.override = Override(
            params.stopping, params.brake, vehicle, 1.0 / params.rate, params.plan_check
        )
        self.evasion = Evasion(params.evasion, vehicle, limits)
        self._field_of = FieldOf()
        self._disturbance = DisturbanceEstimate(
            learnable(params.disturbance, params.vertical_command)
        )
        self._reason = self._code = ""
        self._failures = 0
        self._axes = None  # the last that were sent, in the last tick
        self._battery_told: Set[str] = set()  # which calls of it have been acted on
        self._reference_asked = -math.inf
        self._forget(-math.inf)

    @property
    def battery_gain(self) -> float:
        """What the battery leaves of the thrust of the vehicle's map [1], as commanded with."""
        return self._setpoints.battery.gain

    def tick(self, i: GuardInputs) -> GuardOutput:
        """Return the setpoint, the mode and what is to be done at time ``i.t``."""
        if i.t < self._t:
            self._forget(i.t)
        dt, self._t = min(max(i.t - self._t, 0.0), MAX_TICK), i.t
        obstacles = self._field_of(i.obstacles)
        self._learn(i)
        if i.telemetry.battery_age <= self.params.modes.battery_timeout:
            commands = self.mode in STREAMING or self.mode is Mode.LANDING
            self._setpoints.battery.update(i.telemetry.battery, dt, commands)
        self.look_at_plan(i)
        rung, verdict = self.ladder.assess(
            i.t,
            obstacles,
            self._brake_clearance(i, obstacles),
            lambda: self.override.time_to_stop(self._state_in_effect(i)),
        )
        self.situation.follow(i, dt, self.mode, self._axes, self._sent)
        seen = self.situation.see(i, self.mode, rung, verdict, self.ladder)
        answer = modes.answer(self.mode, seen, self.params.modes) if seen.request else None
        actions = (*self._change_mode(i, seen, answer), *self._look_after_battery(i, seen))
        override = self._overridden(i, verdict, obstacles)
        self._evade(i, seen, obstacles)
        command = self._command(i, seen, rung, dt, override)
        self._axes = command.axes
        if command.axes is not None:
            self._sent.add(i.t, command.applied)
        self._sent.trim(i.t)
        self._failures = 0
        return GuardOutput(
            mode=self.mode,
            rung=command.rung,
            reason=override or self._words(seen, self.override.remark or verdict.sentence),
            code="held_back" if override else self._code,
            axes=command.axes,
            applied=command.applied,
            actions=actions,
            answer=answer,
            clearance=verdict.clearance,
            target=self.situation.above_home(i.estimate) if Action.RETURN in actions else None,
        )

    def give_way(self, t: float, telemetry: ModeInputs, error: Exception) -> GuardOutput:
        """Return what to do after ``tick`` raised: brake as simply as possible, then release."""
        self._failures += 1
        reason = f"the guard itself failed: {type(error).__name__}: {error}"
        pilot = pilot_has_control(telemetry, self.params.modes)
        if self._failures <= MAX_FAILURES:
            if self.mode not in STREAMING or pilot:
                return GuardOutput(self.mode, Rung.NONE, reason, "guard_failed")
            if self.situation.gps_holds(telemetry):
                command = self._setpoints.hold(Rung.BRAKE_BLIND)
            else:
                command = self._setpoints.of_input(Rung.BRAKE_BLIND, hover_input(), 0.0)
            return GuardOutput(Mode.BRAKING, command.rung, reason, "guard_failed", command.axes)
        actions = (Action.RELEASE_AUTHORITY,) if self.mode in AUTOMATIC else ()
        self.mode, self._reason, self._code = Mode.FAULT, reason, "guard_failed"
        return GuardOutput(Mode.FAULT, Rung.RELEASE, reason, self._code, actions=actions)

    def _forget(self, t: float) -> None:
        """Drop everything that carries a time, as when the clock went backwards."""
        self._t = t
        self.situation.forget()
        self._sent.forget()
        self._disturbance.reset()
        self.ladder.forget()
        self.link.forget()
        self.override.forget()
        self.evasion.forget()

    def _learn(self, i: GuardInputs) -> None:
        """Take what the model lacks into it, and keep it while DJI's own control brakes."""
        estimate, vehicle, sent = self._disturbance, self.vehicle, self._sent
        if not sent.history or i.t - sent.history[-1][0] > IN_FORCE:
            sent.unknown = i.t
        if self.mode not in STREAMING:
            estimate.reset()
        elif i.t - sent.unknown < vehicle.delay + FORGOTTEN or i.estimate is None:
            estimate.pause()
        else:
            estimate.update(i.t, i.estimate.vector, sent.history, sent.vehicle)
        known = replace(vehicle, disturbance=vehicle.disturbance + estimate.acceleration)
        sent.vehicle = self.ladder.vehicle = self.override.vehicle = known

    def look_at_plan(self, i: GuardInputs) -> None:
        """Check what has come from the controller: in ``tick``, or before, to make that short."""
        if i.plan_error:
            self.ladder.refuse(i.plan_error)
        if i.plan is None:
            return
        self.link.take(i.t, i.plan)
        if self.link.finding:
            self.ladder.refuse(self.link.finding, Finding.CLOCK)
            return
        obstacles = self._field_of(i.obstacles)
        self.ladder.take(
            i.plan,
            i.goal,
            t=i.t,
            state=None if i.estimate is None else i.estimate.vector,
            inputs=self._sent.history,
            obstacles=obstacles,
            brake_clearance=self._brake_clearance(i, obstacles),
        )

    def _brake_clearance(self, i: GuardInputs, obstacles: ObstacleField) -> Callable[[], float]:
        """Return what tells how near [m] a brake begun now would come to an obstacle."""
        return lambda: self.override.brake_clearance(
            self._state_in_effect(i), i.t + self.vehicle.delay, obstacles
        )

    def _overridden(self, i: GuardInputs, verdict: Verdict, obstacles: ObstacleField) -> str:
        """Return why to brake although there is a plan; empty where that is not so."""
        if self.mode not in PLANNED:
            self.override.forget()
            return ""
        was_active = self.override.active
        state = None if i.estimate is None else self._state_in_effect(i)
        reason = self.override.reason(i.t, i.obstacles_stale, state, obstacles, verdict)
        if reason and not was_active:
            self._brake.begin(self._sent.last(i.t, i.estimate))
        return reason

    def _change_mode(
        self, i: GuardInputs, seen: ModeInputs, answer: Optional[Tuple[bool, str]]
    ) -> Tuple[Action, ...]:
        before = self.mode
        transition = modes.next_mode(before, seen, self.params.modes)
        after = transition.mode
        request = seen.request if answer and answer[0] else None
        actions = []
        if after in AUTOMATIC and before not in AUTOMATIC:
            actions.append(Action.OBTAIN_AUTHORITY)
        if after is Mode.TAKING_OFF is not before:
            actions.append(Action.TAKE_OFF)
        lands_itself = seen.flight_status is FlightStatus.LANDING
        if after is Mode.LANDING is not before and not lands_itself:
            actions += [Action.HOLD, Action.LAND]
        if after not in AUTOMATIC and (before in AUTOMATIC or request is Request.RELEASE):
            actions.append(Action.RELEASE_AUTHORITY)
        if request is Request.HOVER and after in STREAMING:
            self.ladder.expect_hold(i.t)
            actions.append(Action.HOLD)
        if after not in STREAMING:
            self.ladder.stop_expecting()
        if after is not before:
            if after in (Mode.BRAKING, Mode.LANDING):
                self._brake.begin(self._sent.last(i.t, i.estimate))
            self.situation.enter(after, before, i)
            self.mode, self._reason, self._code = after, transition.reason, transition.code
        if self._wants_reference(i.now, seen):
            self._reference_asked = i.now
            actions.append(Action.SET_REFERENCE)
        return tuple(actions)

    def _look_after_battery(self, i: GuardInputs, seen: ModeInputs) -> Tuple[Action, ...]:
        """Return what a battery low or silent asks for, once; the landing is a change of mode."""
        p = self.params.modes
        if self.mode not in AUTOMATIC:
            self._battery_told.clear()
        call = battery_call(seen, p)
        if self.mode not in PLANNED or not call or call in self._battery_told:
            return ()
        self._battery_told.add(call)
        if p.battery_action == "return" and self.situation.above_home(i.estimate) is not None:
            return (Action.RETURN,)
        self.ladder.expect_hold(i.t)
        return (Action.HOLD,)

    def _wants_reference(self, now: float, seen: ModeInputs) -> bool:
        """Return whether DJI's local position must be switched on: once, on the ground."""
        is_missing = seen.position_age > self.params.reference_retry
        waited = now - self._reference_asked >= self.params.reference_retry
        on_ground = self.mode is Mode.WAITING and seen.on_ground and seen.needs_gps
        return on_ground and is_missing and waited and self.situation.gps_holds(seen)

    def _command(
        self, i: GuardInputs, seen: ModeInputs, rung: Rung, dt: float, override: str
    ) -> Command:
        if self.mode in PLANNED and not override:
            plan = self.ladder.plan
            # the flight controller's own loop lags: what is asked for now is there that much later
            ahead = i.t + plan.delay + self.params.vertical_lead
            up = float(plan.state_at(ahead)[VELOCITY][2])
            return self._setpoints.of_input(rung, plan.input_at(i.t), up)
        # until DJI's own landing has begun: silence while a service call blocks is nobody's control
        waits = self.mode is Mode.LANDING and awaits_landing(seen, self.params.modes)
        if self.mode is not Mode.BRAKING and not waits and not override:
            return Command(_SILENT_RUNGS.get(self.mode, Rung.NONE))
        has_motion = knows_motion(seen, self.params.modes)
        rung = Rung.BRAKE if has_motion else Rung.BRAKE_BLIND
        rung = Rung.LANDING if waits else rung
        if not seen.authority:
            self._brake.begin(self._sent.last(i.t, i.estimate))  # as the aircraft is when it comes
            return Command(rung)
        aside = self.evasion.velocity
        if self.situation.gps_holds(seen):
            self._brake.begin(hover_input())  # where a brake of our own would have to go on from
            return self._setpoints.hold(rung, (0.0, 0.0, 0.0) if aside is None else aside)
        state = self._state_in_effect(i)
        push = self._sent.vehicle.disturbance
        u = self._brake.input(state, dt, has_motion, push, aside)
        return self._setpoints.of_input(rung, u, 0.0 if aside is None else float(aside[2]))

    def _evade(self, i: GuardInputs, seen: ModeInputs, obstacles: ObstacleField) -> None:
        """Look whether something comes at who brakes without a plan."""
        knows = knows_motion(seen, self.params.modes)
        if self.mode is not Mode.BRAKING or not seen.authority or not knows:
            self.evasion.forget()
            return
        self.evasion.look(self._state_in_effect(i), i.t + self.vehicle.delay, obstacles)

    def _state_in_effect(self, i: GuardInputs) -> np.ndarray:
        """Return the state (10,) expected when a command sent now takes effect."""
        has_velocity = i.telemetry.velocity_age <= self.params.modes.velocity_timeout
        known = i.estimate if has_velocity and i.estimate is not None else self.situation.last_good
        return self._sent.state_in_effect(i.t, known)

    def _words(self, seen: ModeInputs, flown: str) -> str:
        evaded = self.evasion.obstacle
        return sentence(self.mode, seen, self.params.modes, self._reason, evaded, flown)
