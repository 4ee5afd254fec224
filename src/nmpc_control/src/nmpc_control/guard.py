# SPDX-License-Identifier: MIT
"""The safety process without ROS: plan check, ladder, modes and the setpoint of one tick."""

import math
from dataclasses import replace
from typing import Callable, Optional, Sequence, Tuple

import numpy as np

from nmpc_control import dji, modes
from nmpc_control.braking import Brake
from nmpc_control.disturbance_estimate import DisturbanceEstimate
from nmpc_control.estimator import StateEstimate
from nmpc_control.guard_data import Action, Command, GuardInputs, GuardOutput
from nmpc_control.guard_params import GuardParameters
from nmpc_control.ladder import PlanLadder, Rung
from nmpc_control.mode_inputs import (
    AUTOMATIC,
    PLANNED,
    STREAMING,
    Mode,
    ModeInputs,
    Request,
    preflight,
)
from nmpc_control.obstacle_field import FieldOf, ObstacleField
from nmpc_control.override import Override
from nmpc_control.params import Limits, Vehicle
from nmpc_control.sent_inputs import SentInputs
from nmpc_control.state import THRUST, VELOCITY, hover_input
from nmpc_control.verdict import Verdict

MAX_TICK = 0.1  # [s] a longer pause between ticks counts as this
FORGOTTEN = 0.5  # [s] after its effect an input no longer shows in the attitude
MAX_FAILURES = 10  # [1] ticks in a row that may raise before authority is released


class Guard:
    """Memory of one flight and ``tick``; asks for no time and knows no ROS."""

    def __init__(self, params: GuardParameters, vehicle: Vehicle, limits: Limits) -> None:
        """Begin waiting."""
        self.params = params
        self.vehicle = vehicle
        self.mode = Mode.WAITING
        self._sent = SentInputs(vehicle)
        self.ladder = PlanLadder(params.plan_check, params.hold_timeout, vehicle, limits)
        self._brake = Brake(vehicle, limits, params.brake)
        self.override = Override(
            params.stopping, params.brake, vehicle, 1.0 / params.rate, params.plan_check
        )
        self._field_of = FieldOf()
        self._disturbance = DisturbanceEstimate(params.disturbance)
        self._reason = ""
        self._failures = 0
        self._forget(-math.inf)

    def tick(self, i: GuardInputs) -> GuardOutput:
        """Return the setpoint, the mode and what is to be done at time ``i.t``."""
        if i.t < self._t:
            self._forget(i.t)
        dt, self._t = min(max(i.t - self._t, 0.0), MAX_TICK), i.t
        obstacles = self._field_of(i.obstacles)
        self._learn(i)

        def brake_clearance() -> float:
            state, when = self._state_in_effect(i), i.t + self.vehicle.delay
            return self.override.brake_clearance(state, when, obstacles)

        self._take_plan(i, obstacles, brake_clearance)
        rung, verdict = self.ladder.assess(i.t, obstacles, brake_clearance)
        seen = self._seen(i, rung, verdict)
        answer = modes.answer(self.mode, seen, self.params.modes) if seen.request else None
        actions = self._change_mode(i, seen, answer)
        override = self._overridden(i, verdict, obstacles)
        command = self._command(i, seen, rung, dt, override)
        if command.axes is not None:
            self._sent.add(i.t, command.applied)
        self._sent.trim(i.t)
        self._failures = 0
        return GuardOutput(
            mode=self.mode,
            rung=command.rung,
            reason=override or self._sentence(seen, verdict),
            axes=command.axes,
            applied=command.applied,
            actions=actions,
            answer=answer,
            clearance=verdict.clearance,
        )

    def give_way(self, t: float, telemetry: ModeInputs, error: Exception) -> GuardOutput:
        """Return what to do after ``tick`` raised: brake as simply as possible, then release."""
        self._failures += 1
        reason = f"the guard itself failed: {type(error).__name__}: {error}"
        pilot = modes.pilot_has_control(telemetry, self.params.modes)
        if self._failures <= MAX_FAILURES:
            if self.mode not in STREAMING or pilot:
                return GuardOutput(self.mode, Rung.NONE, reason)
            trusted = self._gps_holds(telemetry)
            axes = self._hold_axes() if trusted else self._axes(hover_input(), 0.0)[0]
            return GuardOutput(Mode.BRAKING, Rung.BRAKE_BLIND, reason, axes)
        actions = (Action.RELEASE_AUTHORITY,) if self.mode in AUTOMATIC else ()
        self._enter(Mode.FAULT, t, reason)
        return GuardOutput(Mode.FAULT, Rung.RELEASE, reason, actions=actions)

    def _forget(self, t: float) -> None:
        """Drop everything that carries a time, as when the clock went backwards."""
        self._t = self._mode_since = t
        self._reference_asked = -math.inf
        self._settled_since: Optional[float] = None
        self._last_good: Optional[StateEstimate] = None
        self._sent.forget()
        self._disturbance.reset()
        self.ladder.forget()
        self.override.forget()

    def _learn(self, i: GuardInputs) -> None:
        """Take what the model lacks into it; only plans are flown by inputs that it has."""
        estimate, vehicle = self._disturbance, self.vehicle
        if self.mode not in PLANNED:
            estimate.reset()
        elif i.t - self._sent.unknown < vehicle.delay + FORGOTTEN or i.estimate is None:
            estimate.pause()
        else:
            history, known = self._sent.history, self._sent.vehicle
            estimate.update(i.t, i.estimate.vector, history, known)
        push = vehicle.disturbance + estimate.acceleration
        self._sent.vehicle = self.ladder.vehicle = replace(vehicle, disturbance=push)

    def _take_plan(
        self, i: GuardInputs, obstacles: ObstacleField, brake_clearance: Callable[[], float]
    ) -> None:
        if i.plan_error:
            self.ladder.refuse(i.plan_error)
        if i.plan is not None:
            state = None if i.estimate is None else i.estimate.vector
            self.ladder.take(
                i.plan,
                i.goal,
                t=i.t,
                state=state,
                inputs=self._sent.history,
                obstacles=obstacles,
                brake_clearance=brake_clearance,
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

    def _seen(self, i: GuardInputs, rung: Rung, verdict: Verdict) -> ModeInputs:
        """Return the telemetry with what the guard itself knows."""
        p = self.params
        telemetry = i.telemetry
        is_fresh = (
            telemetry.position_age <= p.modes.position_timeout
            and telemetry.velocity_age <= p.modes.velocity_timeout
        )
        if is_fresh:
            self._last_good = i.estimate
        steady = i.estimate is not None and abs(i.estimate.vector[VELOCITY][2]) <= p.height_speed
        if not (telemetry.in_air and steady and i.height >= p.modes.take_off_height):
            self._settled_since = None
        elif self._settled_since is None:
            self._settled_since = i.t
        blind = telemetry.position_age > p.modes.position_timeout and not self._gps_holds(telemetry)
        # while it is held back for obstacles long unseen, what they may have grown to is no news
        is_held = bool(i.obstacles_stale) and self.mode in PLANNED and self.ladder.is_blocked(i.t)
        return replace(
            telemetry,
            verified_plans=self.ladder.verified,
            plan_usable=(rung is not Rung.NONE or is_held) and is_fresh,
            plan_finding="" if verdict.ok else verdict.sentence,
            usable_time=self.ladder.usable_time(i.t) if is_fresh else 0.0,
            goal=self.ladder.goal,
            settled_time=0.0 if self._settled_since is None else i.t - self._settled_since,
            blind_time=telemetry.position_age if blind else 0.0,
            brake_time_left=self._brake_time_left(i, telemetry),
            time_in_mode=i.t - self._mode_since,
        )

    def _brake_time_left(self, i: GuardInputs, telemetry: ModeInputs) -> float:
        """Return the time [s] that a brake on the last known velocity still needs."""
        p = self.params
        if telemetry.velocity_age <= p.modes.velocity_timeout or self._gps_holds(telemetry):
            return math.inf
        if self._last_good is None:
            return 0.0
        speed = float(np.linalg.norm(self._last_good.vector[VELOCITY][:2]))
        needed = speed / p.brake.deceleration + self.vehicle.delay
        return self._last_good.t + needed - i.t

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
        if after is Mode.LANDING is not before and request is Request.LAND:
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
            self._enter(after, i.t, transition.reason)
        if self._wants_reference(i.t, seen):
            self._reference_asked = i.t
            actions.append(Action.SET_REFERENCE)
        return tuple(actions)

    def _enter(self, mode: Mode, t: float, reason: str) -> None:
        self.mode, self._mode_since, self._reason = mode, t, reason

    def _wants_reference(self, t: float, seen: ModeInputs) -> bool:
        """Return whether DJI's local position must be switched on: once, on the ground."""
        is_missing = seen.position_age > self.params.reference_retry
        waited = t - self._reference_asked >= self.params.reference_retry
        on_ground = self.mode is Mode.WAITING and seen.on_ground and seen.needs_gps
        return on_ground and is_missing and waited and self._gps_holds(seen)

    def _gps_holds(self, telemetry: ModeInputs) -> bool:
        """Return whether DJI's own velocity control can be trusted to hold."""
        is_fresh = telemetry.gps_age <= self.params.modes.status_timeout
        return is_fresh and telemetry.gps_health > dji.TRUSTED_GPS_HEALTH

    def _command(
        self, i: GuardInputs, seen: ModeInputs, rung: Rung, dt: float, override: str
    ) -> Command:
        if self.mode in PLANNED and not override:
            plan = self.ladder.plan
            up = float(plan.state_at(i.t + plan.delay)[VELOCITY][2])
            return Command(rung, *self._axes(plan.input_at(i.t), up))
        # until DJI's own landing has begun: silence while a service call blocks is nobody's control
        awaits_landing = self.mode is Mode.LANDING and seen.in_air
        if self.mode is not Mode.BRAKING and not awaits_landing and not override:
            return Command(Rung.RELEASE if self.mode is Mode.RELEASED else Rung.NONE)
        has_position = seen.position_age <= self.params.modes.position_timeout
        has_velocity = seen.velocity_age <= self.params.modes.velocity_timeout
        rung = Rung.BRAKE if has_position and has_velocity else Rung.BRAKE_BLIND
        if not seen.authority:
            return Command(rung)
        if self._gps_holds(seen):
            self._brake.begin(hover_input())  # where a brake of our own would have to go on from
            return Command(rung, self._hold_axes())
        state = self._state_in_effect(i)
        u = self._brake.input(state, dt, has_position and has_velocity)
        return Command(rung, *self._axes(u, 0.0))

    def _state_in_effect(self, i: GuardInputs) -> np.ndarray:
        """Return the state (10,) expected when a command sent now takes effect."""
        has_velocity = i.telemetry.velocity_age <= self.params.modes.velocity_timeout
        known = i.estimate if has_velocity and i.estimate is not None else self._last_good
        return self._sent.state_in_effect(i.t, known)

    def _axes(self, u: Sequence[float], up: float) -> Tuple[dji.Axes, Tuple[float, ...]]:
        """Return the axes for an input (4,) and the input that they really command."""
        limits = self.params.setpoint_limits
        if self.params.vertical_command == "velocity":
            axes = dji.attitude_velocity_axes(u[1:], up, self.vehicle, limits)
            return axes, (float(u[THRUST]), axes[0], axes[1], axes[3])
        axes = dji.attitude_thrust_axes(u, self.vehicle, limits)
        return axes, dji.input_from_axes(axes, self.vehicle)

    def _hold_axes(self) -> dji.Axes:
        return dji.velocity_axes((0.0, 0.0, 0.0), 0.0, self.params.setpoint_limits)

    def _sentence(self, seen: ModeInputs, verdict: Verdict) -> str:
        if self.mode is Mode.WAITING:
            return "; ".join(preflight(seen, self.params.modes)) or self._reason
        planned = self.override.remark or verdict.sentence
        return planned if self.mode in PLANNED else self._reason
