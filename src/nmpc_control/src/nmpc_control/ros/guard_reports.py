# SPDX-License-Identifier: MIT
"""What the guard tells people and tools: ControllerStatus every tick, diagnostics once a second.

ROS Publishers: nmpc/status (nmpc_msgs/ControllerStatus), /diagnostics.
"""

import math
import os
from typing import Callable, Optional, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from nmpc_control.guard import Guard
from nmpc_control.guard_data import GuardInputs, GuardOutput
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import PLANNED, Mode
from nmpc_control.ros.diagnostics import Diagnostics, Wrapper
from nmpc_control.state import Goal
from nmpc_msgs.msg import ControlInput, ControllerStatus, Plan

_ATTENTION = (Mode.BRAKING, Mode.RELEASED, Mode.FAULT)
LATE_SHARE = 0.02  # [1] of late periods from which on the loop is reported
LONG_WAY = 0.3  # [s] from telemetry to the plan made of it, from which on it is reported
OVERLOAD = 1.0  # [1] processes that want a core, per core
_SILENT = ControlInput(math.nan, math.nan, math.nan, math.nan)


class GuardReports:
    """Publishes every tick's outcome and keeps the last one for the diagnostics."""

    def __init__(self, guard: Guard, rejected_samples: Callable[[], str]) -> None:
        self._guard = guard
        self._rejected_samples = rejected_samples
        self._last: Optional[Tuple[GuardInputs, GuardOutput]] = None
        self._status = rospy.Publisher(
            "nmpc/status", ControllerStatus, queue_size=10, tcp_nodelay=True
        )
        self._diagnostics = Diagnostics("M100")
        self._diagnostics.add("flight", self._diagnose_flight)
        self._diagnostics.add("telemetry", self._diagnose_telemetry)
        self._diagnostics.add("plans", self._diagnose_plans)
        self._diagnostics.add("loop", self._diagnose_loop)
        self._diagnostics.add("battery", self._diagnose_battery)

    def add(self, name: str, diagnose: Callable[[Wrapper], Wrapper]) -> None:
        """Have another entry in /diagnostics."""
        self._diagnostics.add(name, diagnose)

    def publish(
        self,
        now: rospy.Time,
        inputs: GuardInputs,
        output: GuardOutput,
        last_plan: Plan,
        obstacle_age: float,
        tick_time: float,
    ) -> None:
        """Publish one tick, which has taken ``tick_time`` [s].

        ``last_plan`` is the newest plan message, an empty one without.
        """
        guard, telemetry = self._guard, inputs.telemetry
        ages = (telemetry.position_age, telemetry.velocity_age, telemetry.attitude_age)
        message = ControllerStatus(
            mode=int(output.mode),
            rung=int(output.rung),
            reason=output.reason,
            reason_code=output.code,
            authority=telemetry.authority,
            setpoint_sent=output.axes is not None,
            applied=_SILENT if output.applied is None else ControlInput(*output.applied),
            goal=int(guard.ladder.goal if output.mode in PLANNED else Goal.HOLD),
            reference_time=last_plan.reference_time if output.mode in PLANNED else math.nan,
            plan_age=guard.ladder.age(inputs.t),
            state_age=max(ages),
            position_age=telemetry.position_age,
            velocity_age=telemetry.velocity_age,
            attitude_age=telemetry.attitude_age,
            rc_age=telemetry.rc_age,
            battery_age=telemetry.battery_age,
            obstacle_age=obstacle_age,
            plans_received=guard.ladder.received,
            plans_rejected=guard.ladder.rejected,
            solver_status=last_plan.solver_status,
            iterations=last_plan.iterations,
            solve_time=last_plan.solve_time,
            deadline_misses=last_plan.deadline_misses,
            predicted_clearance=output.clearance,
            battery=telemetry.battery,
            tick_time=tick_time,
            clock_offset=guard.link.offset,
            link_delay=guard.link.delay,
            loop_rate=guard.situation.loop.rate,
            loop_jitter=guard.situation.loop.jitter,
        )
        message.header.stamp = now
        self._status.publish(message)
        self._last = (inputs, output)
        self._diagnostics.update()

    def _diagnose_flight(self, status: Wrapper) -> Wrapper:
        if self._last is None:
            status.summary(DiagnosticStatus.WARN, "not started")
            return status
        inputs, output = self._last
        level = DiagnosticStatus.WARN if output.mode in _ATTENTION else DiagnosticStatus.OK
        level = DiagnosticStatus.ERROR if output.mode is Mode.FAULT else level
        status.summary(level, f"{output.mode.name.lower().replace('_', ' ')}: {output.reason}")
        status.add("rung", Rung(output.rung).name.lower().replace("_", " "))
        status.add("reason code", output.code)
        status.add("authority", str(inputs.telemetry.authority))
        situation = self._guard.situation
        status.add("commands without effect [s]", f"{situation.effect.total:.1f}")
        status.add("jumps of the position", str(situation.watch.jumps))
        return status

    def _diagnose_telemetry(self, status: Wrapper) -> Wrapper:
        if self._last is None:
            status.summary(DiagnosticStatus.WARN, "nothing received")
            return status
        telemetry = self._last[0].telemetry
        timeouts = self._guard.params.modes
        ages = {
            "attitude": (telemetry.attitude_age, timeouts.attitude_timeout),
            "velocity": (telemetry.velocity_age, timeouts.velocity_timeout),
            "position": (telemetry.position_age, timeouts.position_timeout),
            "rc": (telemetry.rc_age, timeouts.rc_timeout),
            "flight status": (telemetry.status_age, timeouts.status_timeout),
            "battery": (telemetry.battery_age, timeouts.battery_timeout),
        }
        stale = [name for name, (age, timeout) in ages.items() if age > timeout]
        level = DiagnosticStatus.WARN if stale else DiagnosticStatus.OK
        status.summary(level, f"stale: {', '.join(stale)}" if stale else "all fresh")
        for name, (age, _) in ages.items():
            status.add(f"{name} age [s]", f"{age:.3f}")
        status.add("RC mode", telemetry.rc.value)
        status.add("GPS health", str(telemetry.gps_health))
        status.add("battery [%]", f"{100.0 * telemetry.battery:.0f}")
        status.add("samples refused", self._rejected_samples())
        return status

    def _diagnose_plans(self, status: Wrapper) -> Wrapper:
        ladder = self._guard.ladder
        age = math.inf if self._last is None else ladder.age(self._last[0].t)
        is_fresh = age <= self._guard.params.plan_check.timeout
        level = DiagnosticStatus.OK if is_fresh else DiagnosticStatus.WARN
        status.summary(level, f"last verified plan {age:.2f} s ago")
        link = self._guard.link
        if link.finding:
            status.summary(DiagnosticStatus.ERROR, link.finding)
        elif link.delay > LONG_WAY:
            words = f"from telemetry to plan it takes up to {1e3 * link.delay:.0f} ms"
            status.summary(DiagnosticStatus.WARN, words)
        status.add("controller's clock ahead [ms]", f"{1e3 * link.offset:.1f}")
        status.add("telemetry to plan [ms]", f"{1e3 * link.delay:.0f}")
        status.add("received", str(ladder.received))
        status.add("rejected", str(ladder.rejected))
        return status

    def _diagnose_loop(self, status: Wrapper) -> Wrapper:
        """Rate and jitter of the stream's own loop, and what else the computer does."""
        loop = self._guard.situation.loop
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
        is_late = loop.late > LATE_SHARE
        level = DiagnosticStatus.WARN if is_late or load > OVERLOAD else DiagnosticStatus.OK
        status.summary(level, f"{loop.rate:.1f} Hz, worst gap {1e3 * loop.worst:.0f} ms")
        status.add("jitter p99 [ms]", f"{1e3 * loop.jitter:.1f}")
        status.add("periods late [%]", f"{100.0 * loop.late:.1f}")
        status.add("load per core", f"{load:.2f}")
        status.add("nice", os.getpriority(os.PRIO_PROCESS, 0))
        return status

    def _diagnose_battery(self, status: Wrapper) -> Wrapper:
        if self._last is None:
            status.summary(DiagnosticStatus.WARN, "nothing received")
            return status
        telemetry, p = self._last[0].telemetry, self._guard.params.modes
        is_known = telemetry.battery_age <= p.battery_timeout
        is_low = telemetry.battery < p.battery_start
        level = DiagnosticStatus.OK if is_known and not is_low else DiagnosticStatus.WARN
        level = DiagnosticStatus.ERROR if telemetry.battery < p.battery_low else level
        silence = f"not heard of for {telemetry.battery_age:.0f} s"
        status.summary(level, f"{telemetry.battery:.0%}" if is_known else silence)
        status.add("when low", p.battery_action)
        status.add("counts as low when silent for [s]", f"{p.battery_silent_time:g}")
        status.add("thrust left [%]", f"{100.0 * self._guard.battery_gain:.1f}")
        return status
