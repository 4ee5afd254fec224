# SPDX-License-Identifier: MIT
"""What a tick of the guard knows beyond the telemetry: times, watchdogs, what stands against it."""

import math
from dataclasses import replace
from typing import Optional, Tuple

import numpy as np

from nmpc_control import dji, start_checks
from nmpc_control.command_effect import CommandEffect
from nmpc_control.distrust import Distrust
from nmpc_control.estimator import StateEstimate
from nmpc_control.guard_data import GuardInputs
from nmpc_control.guard_params import GuardParameters
from nmpc_control.ladder import PlanLadder, Rung
from nmpc_control.loop_watch import LoopWatch
from nmpc_control.mode_inputs import AUTOMATIC, PLANNED, STREAMING, Mode, ModeInputs
from nmpc_control.params import Limits, Vehicle
from nmpc_control.sent_inputs import SentInputs
from nmpc_control.state import POSITION, VELOCITY, Goal
from nmpc_control.verdict import Verdict
from nmpc_control.watch import Watch


class Situation:
    """Remembers since when things are as they are; ``see`` once per tick."""

    def __init__(
        self, params: GuardParameters, vehicle: Vehicle, limits: Limits, refusal: str
    ) -> None:
        """Begin waiting; ``refusal`` says why this launch must never start, if so."""
        self.params = params
        self.vehicle = vehicle
        self.limits = limits
        self.refusal = refusal
        self.loop = LoopWatch(params.rate)
        self.watch = Watch(params.watch, limits)
        self.effect = CommandEffect(vehicle, params.watch.effect_tilt)
        self._unheeded = Distrust()
        self.home: Optional[np.ndarray] = None  # (3,) [m] where automatic flight began
        self._since: Optional[float] = None  # [s] steady clock, when the mode began
        self._brakes_after_start = False
        self._landing_granted = False
        self._was_away = self._switched = False
        self._battery_heard: Optional[float] = None  # [s] steady clock, where it is silent since
        self._low_since: Optional[float] = None
        self._critical_since: Optional[float] = None
        self._gps_lost_since: Optional[float] = None
        self.forget()

    def forget(self) -> None:
        """Drop what carries a time of the state, as when the clock went backwards."""
        self.last_good: Optional[StateEstimate] = None
        self._settled_since: Optional[float] = None
        self.watch.forget()
        self.effect.forget()

    def enter(self, mode: Mode, before: Mode, i: GuardInputs) -> None:
        """Note a change of mode."""
        self._since = i.now
        self.effect.enter_mode()
        self._brakes_after_start = mode is Mode.BRAKING and before not in AUTOMATIC
        self._landing_granted = False
        if mode is Mode.MANUAL:
            self._switched, self._was_away = False, i.telemetry.rc in (dji.RcMode.P, dji.RcMode.A)
        if mode in AUTOMATIC and before not in AUTOMATIC:
            self.watch.begin_flight()
            self._unheeded.forgive()
            self.home = None if i.estimate is None else i.estimate.vector[POSITION].copy()

    def above_home(self, estimate: Optional[StateEstimate]) -> Optional[Tuple[float, float, float]]:
        """Return the point [m] above where automatic flight began, at the present height."""
        if self.home is None or estimate is None:
            return None
        east, north = self.home[:2]
        return float(east), float(north), float(estimate.vector[POSITION][2])

    def gps_holds(self, telemetry: ModeInputs) -> bool:
        """Return whether DJI's own velocity control can be trusted to hold."""
        is_fresh = telemetry.gps_age <= self.params.modes.status_timeout
        return is_fresh and telemetry.gps_health > dji.TRUSTED_GPS_HEALTH

    def follow(
        self, i: GuardInputs, dt: float, mode: Mode, axes: Optional[dji.Axes], sent: SentInputs
    ) -> None:
        """Compare what the aircraft does with ``axes``, the last that were sent."""
        self.watch.look(i.estimate)
        if mode not in STREAMING:
            self.effect.forget()
        elif i.estimate is not None and axes is not None:
            state = i.estimate.vector
            if axes[4] == dji.VELOCITY:
                # a velocity that is not heard any more cannot show that it falls
                if i.telemetry.velocity_age <= self.params.modes.velocity_timeout:
                    self.effect.follow_hold(i.t, dt, state, np.array(axes[:3]))
            else:
                self.effect.follow_attitude(i.t, dt, sent.history, state)

    def see(
        self, i: GuardInputs, mode: Mode, rung: Rung, verdict: Verdict, ladder: PlanLadder
    ) -> ModeInputs:
        """Return the telemetry with what the guard itself knows."""
        p = self.params
        self.loop.tick(i.now)
        self._since = _since(self._since, True, i.now)
        telemetry = i.telemetry
        is_fresh = (
            telemetry.position_age <= p.modes.position_timeout
            and telemetry.velocity_age <= p.modes.velocity_timeout
        )
        if is_fresh:
            self.last_good = i.estimate
        has_no_effect = mode in PLANNED and self.effect.time > p.modes.effect_brake
        self._unheeded.note(i.now, has_no_effect)
        gps_lost = self._gps_lost_time(i)
        blind = telemetry.position_age > p.modes.position_timeout and not self.gps_holds(telemetry)
        # while it is held back for obstacles long unseen, what they may have grown to is no news
        is_held = bool(i.obstacles_stale) and mode in PLANNED and ladder.is_blocked(i.t)
        low, critical = self._battery_times(i)
        self._landing_granted |= mode is Mode.LANDING and telemetry.landing_granted
        return replace(
            telemetry,
            switched_to_f=self._see_switch(telemetry),
            verified_plans=ladder.verified,
            plan_usable=(rung is not Rung.NONE or is_held) and is_fresh,
            plan_finding="" if verdict.ok else verdict.sentence,
            usable_time=ladder.usable_time(i.t) if is_fresh else 0.0,
            goal=ladder.goal,
            settled_time=self._settled_time(i),
            gps_lost_time=gps_lost,
            blind_time=max(telemetry.position_age if blind else 0.0, gps_lost),
            brake_time_left=self._brake_time_left(i, telemetry),
            speed=_speed(i.estimate),
            brakes_after_start=self._brakes_after_start,
            alarm=self.watch.alarm,
            unheeded=self._unheeded.stands,
            tilt_time=self.watch.tilt_time,
            effectless_time=self.effect.time,
            effectless_total=self.effect.total,
            landing_granted=self._landing_granted,
            battery_silent_time=self._battery_silent_time(i),
            battery_low_time=low,
            battery_critical_time=critical,
            is_home=mode is Mode.HOVERING and ladder.goal is Goal.HOLD and self._is_home(i),
            objections=() if mode in AUTOMATIC else self._objections(i),
            time_in_mode=i.now - self._since,
        )

    def _see_switch(self, telemetry: ModeInputs) -> bool:
        """Return whether the switch was moved to F under the guard's eyes."""
        if telemetry.rc_age > self.params.modes.rc_timeout or telemetry.rc is dji.RcMode.OFF:
            self._was_away = self._switched = False
        elif telemetry.rc in (dji.RcMode.P, dji.RcMode.A):
            self._was_away, self._switched = True, False
        elif telemetry.rc is dji.RcMode.F:
            self._switched = self._switched or self._was_away
        return self._switched

    def _gps_lost_time(self, i: GuardInputs) -> float:
        is_lost = i.telemetry.needs_gps and not self.gps_holds(i.telemetry)
        self._gps_lost_since = _since(self._gps_lost_since, is_lost, i.now)
        return 0.0 if self._gps_lost_since is None else i.now - self._gps_lost_since

    def _settled_time(self, i: GuardInputs) -> float:
        """Return for how long [s] it has been in the air, at height, without climbing."""
        p = self.params
        steady = i.estimate is not None and abs(i.estimate.vector[VELOCITY][2]) <= p.height_speed
        is_up = i.telemetry.in_air and steady and i.height >= p.modes.take_off_height
        self._settled_since = _since(self._settled_since, is_up, i.now)
        return 0.0 if self._settled_since is None else i.now - self._settled_since

    def _battery_silent_time(self, i: GuardInputs) -> float:
        age = i.telemetry.battery_age
        heard = i.now - age if math.isfinite(age) else i.now  # never: count from now
        is_silent = age > self.params.modes.battery_timeout
        self._battery_heard = _since(self._battery_heard, is_silent, heard)
        return 0.0 if self._battery_heard is None else i.now - self._battery_heard

    def _battery_times(self, i: GuardInputs) -> Tuple[float, float]:
        p, battery = self.params.modes, i.telemetry.battery
        self._low_since = _since(self._low_since, battery < p.battery_low, i.now)
        self._critical_since = _since(self._critical_since, battery < p.battery_critical, i.now)
        low, critical = self._low_since, self._critical_since
        return (0.0 if low is None else i.now - low, 0.0 if critical is None else i.now - critical)

    def _is_home(self, i: GuardInputs) -> bool:
        if self.home is None or i.estimate is None:
            return False
        off = i.estimate.vector[POSITION][:2] - self.home[:2]
        return float(np.linalg.norm(off)) <= self.params.modes.home_radius

    def _objections(self, i: GuardInputs) -> Tuple[str, ...]:
        watch = self.params.watch
        jumped = self.watch.has_jumped(i.t)
        found = (
            self.refusal,
            start_checks.place(i.estimate, i.telemetry.on_ground, self.limits, watch),
            "the position jumps" if jumped else "",
            start_checks.headings(i.yaw_disagreement, watch),
            start_checks.loop(self.loop, watch),
        )
        return tuple(sentence for sentence in found if sentence)

    def _brake_time_left(self, i: GuardInputs, telemetry: ModeInputs) -> float:
        """Return the time [s] that a brake on the last known velocity still needs."""
        p = self.params
        if telemetry.velocity_age <= p.modes.velocity_timeout or self.gps_holds(telemetry):
            return math.inf
        if self.last_good is None:
            return 0.0
        speed = float(np.linalg.norm(self.last_good.vector[VELOCITY][:2]))
        needed = speed / p.brake.deceleration + self.vehicle.delay
        return self.last_good.t + needed - i.t


def _since(before: Optional[float], holds: bool, now: float) -> Optional[float]:
    """Return since when [s] something holds, at most ``now``; None: it does not."""
    if not holds:
        return None
    return now if before is None else min(before, now)


def _speed(estimate: Optional[StateEstimate]) -> float:
    return 0.0 if estimate is None else float(np.linalg.norm(estimate.vector[VELOCITY]))
