# SPDX-License-Identifier: MIT
"""ROS node flight_guard: owns setpoint stream, authority, modes and ladder; needs no solver.

ROS Subscribers: see ``guard_listener``.
ROS Publishers:
    dji_sdk/flight_control_setpoint_generic (sensor_msgs/Joy): 50 Hz while automatic flight is on.
    nmpc/hold_request (std_msgs/Empty): tells the controller to drop its goal.
    nmpc/return_request (geometry_msgs/PointStamped): tells it to fly there; the battery is low.
    nmpc/status, /diagnostics: see ``guard_reports``.
ROS Services: start, hover, land, release (std_srvs/Trigger), answered with a reason in words;
    those of ``obstacle_services`` and ``source_switch``.
ROS Parameters:
    ~vehicle (str): file under config/vehicles. ~profile (str): file under config/profiles.
    ~avoidance (bool): false leaves obstacles out of the plan check.
    ~simulated (bool): a simulator is flown: its thrust map counts, its RC stands in F already.
    ~frame_id (str): world frame, instead of the one in ``config/guard.yaml``.
"""

import gc
import os
import queue
import signal
import sys
import time
import traceback
from dataclasses import replace
from typing import Callable, Optional

import rospy
from geometry_msgs.msg import Point, PointStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Empty, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from nmpc_control import start_checks
from nmpc_control.errors import ConfigError, NmpcError
from nmpc_control.guard import Guard
from nmpc_control.guard_data import Action, GuardOutput
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import AUTOMATIC, ModeInputs, Request
from nmpc_control.params import load_parameters
from nmpc_control.ros.departure import Departure
from nmpc_control.ros.dji_services import DjiServices
from nmpc_control.ros.guard_listener import GuardListener
from nmpc_control.ros.guard_reports import GuardReports
from nmpc_control.ros.log_thread import logging_in_a_thread
from nmpc_control.ros.obstacle_services import ObstacleServices
from nmpc_control.ros.question import Question
from nmpc_control.ros.source_switch import SourceSwitch

OVERSLEPT = 0.06  # [s] of wall time between two ticks: this process was not running
CATCH_UP = 0.01  # [s] of wall time that callbacks then get
CLOCK_STEP = 0.1  # [s] by which the clock may step back without being a jump
HEAR_AGAIN = 0.1  # [s] of wall time for telemetry after a jump
PLAN_CHECK = 0.005  # [s] a look at a plan takes; with less left before a tick, it is part of it
ANSWER_TIMEOUT = 2.0  # [s] wall time in which a tick must answer a service call
SWITCH_INTERVAL = 5e-4  # [s] for which a thread that reads messages may keep the loop waiting
TICK_INTERVAL = 0.01  # [s] for which a tick keeps those waiting
REAL_TIME = 1  # real-time priority, the lowest
NICENESS = -10  # where the system grants no real time


class GuardNode:
    """One loop in the main thread ticks, publishes and waits for nobody."""

    def __init__(self, guard: Guard, avoidance: bool) -> None:
        self.guard = guard
        self._listener = GuardListener(guard.params, avoidance)
        self._reports = GuardReports(guard, self._listener.rejected_samples)
        self._reports.add("obstacles", self._listener.obstacles.diagnose)
        self._obstacle_services = ObstacleServices(self._listener.obstacles)
        self._reports.add("position", self._listener.state.diagnose)
        SourceSwitch(self._listener.state, lambda: guard.mode in AUTOMATIC)
        heard = self._listener
        self._dji = DjiServices(heard.set_authority, heard.report_failure, heard.report_landing)
        self._questions: "queue.Queue[Question]" = queue.Queue(maxsize=10)
        self._departure = Departure(self._dji)
        self._t = 0.0
        self._world_frame = guard.params.world_frame
        self._telemetry = ModeInputs()  # of this tick
        self._has_sent = False
        self._looked = 0.0  # [s] spent on a plan before the tick; a part of it
        self._setpoint = rospy.Publisher(
            "dji_sdk/flight_control_setpoint_generic", Joy, queue_size=1, tcp_nodelay=True
        )
        self._hold = rospy.Publisher("nmpc/hold_request", Empty, queue_size=1)
        self._return = rospy.Publisher("nmpc/return_request", PointStamped, queue_size=1)
        self._has_steady = not rospy.get_param("/use_sim_time", False)
        for request in Request:
            rospy.Service(request.value, Trigger, self._serve(request))
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._departure.on_signal)
        rospy.on_shutdown(self._departure.on_shutdown)

    def run(self) -> None:
        """Tick until told to end; a tick that fails is reported and answered with a brake."""
        try:
            self._stream()
        finally:
            self._departure.end()

    def _stream(self) -> None:
        while rospy.Time.now().is_zero() and not self._must_stop():
            time.sleep(0.01)  # of wall time: with /use_sim_time there is no other yet
        rate = rospy.Rate(self.guard.params.rate)
        ticked = time.monotonic()
        while not rospy.is_shutdown():
            is_last = self._must_stop()
            sys.setswitchinterval(TICK_INTERVAL)
            try:
                self._tick(rospy.Time.now(), Request.RELEASE if is_last else None)
            except Exception as error:  # noqa: BLE001 (the stream must not end with one bad message)
                rospy.logerr_throttle(1.0, f"tick failed: {traceback.format_exc(limit=-3)}")
                self._give_way(error)
            sys.setswitchinterval(SWITCH_INTERVAL)
            if is_last:
                break
            try:
                self._look_ahead(rate)
                rate.sleep()
            except rospy.ROSTimeMovedBackwardsException:
                rospy.logwarn("the clock jumped backwards")
            except rospy.ROSInterruptException:
                break
            if time.monotonic() - ticked > OVERSLEPT:
                time.sleep(
                    CATCH_UP
                )  # what came meanwhile waits in the sockets: hear it, then judge
            ticked = time.monotonic()

    def _look_ahead(self, rate: rospy.Rate) -> None:
        """Check a plan that comes long enough before the next tick, so that the tick is short."""
        if not self._has_steady:
            return
        spare = rate.remaining().to_sec() - PLAN_CHECK
        if spare <= 0.0 or not self._listener.wait_for_plan(spare):
            return
        begun = time.perf_counter()
        t = max(rospy.Time.now().to_sec(), self._t)
        try:
            self.guard.look_at_plan(self._listener.take_plan(t, time.monotonic()))
        except Exception as error:  # noqa: BLE001 (a plan that cannot be checked is refused)
            rospy.logerr_throttle(1.0, f"plan check failed: {traceback.format_exc(limit=-3)}")
            self.guard.ladder.refuse(f"its check failed: {type(error).__name__}: {error}")
        self._looked = time.perf_counter() - begun

    def _give_way(self, error: Exception) -> None:
        """Brake or release after a tick that failed outside the guard itself.

        One that had sent its setpoint sends no other, and one that does not know what the pilot
        does sends none.
        """
        try:
            output = self.guard.give_way(self._t, self._telemetry, error)
            if output.axes is not None and not self._has_sent and not self._must_stop():
                self._setpoint.publish(Joy(axes=output.axes))
            self._act(output)
        except Exception:  # noqa: BLE001 (there is nothing left to fall back to but the next tick)
            rospy.logerr_throttle(1.0, f"giving way failed: {traceback.format_exc(limit=-3)}")

    def _must_stop(self) -> bool:
        """Return whether the guard was told to end, and nothing has to be held any more."""
        if not self._departure.is_due:
            return False
        return self._departure.is_over or self.guard.mode not in AUTOMATIC

    def _tick(self, now: rospy.Time, last_request: Optional[Request]) -> None:
        if now.to_sec() < self._t - CLOCK_STEP:
            self._t, self._looked = now.to_sec(), 0.0
            self._listener.start_anew()
            time.sleep(HEAR_AGAIN)  # or all that was heard before the jump would count as missing
            return
        begun, self._looked = time.perf_counter() - self._looked, 0.0
        t = max(now.to_sec(), self._t)  # a small step back: time stands still until it is caught up
        self._t = t
        question = self._next_question()
        request = question.request if question else None
        self._telemetry, self._has_sent = ModeInputs(), False  # nothing of this tick yet
        steady = time.monotonic() if self._has_steady else None  # simulated time is steady itself
        inputs = self._listener.take(
            t, steady, last_request or request, leaving=self._departure.is_due
        )
        self._telemetry = inputs.telemetry
        try:
            output = self.guard.tick(inputs)
        except Exception as error:  # noqa: BLE001 (whatever it is, the aircraft is in the air)
            rospy.logerr_throttle(1.0, traceback.format_exc(limit=-3))
            output = self.guard.give_way(t, inputs.telemetry, error)
        if output.axes is not None and not last_request:
            self._setpoint.publish(Joy(header=Header(stamp=now), axes=output.axes))
            self._has_sent = True
        duration = time.perf_counter() - begun
        self._act(output)
        if question:
            question.answer = output.answer or (False, output.reason)
            question.answered.set()
            rospy.loginfo(f"{question.request.value}: {question.answer[1]}")
        try:
            obstacle_age, last_plan = self._listener.obstacles.age(t), self._listener.last_plan
            self._reports.publish(now, inputs, output, last_plan, obstacle_age, duration)
        except Exception:  # noqa: BLE001 (what cannot be told must not end what is flown)
            rospy.logerr_throttle(1.0, f"report failed: {traceback.format_exc(limit=-3)}")

    def _act(self, output: GuardOutput) -> None:
        if Action.RELEASE_AUTHORITY in output.actions:
            self._listener.set_authority(False)
        if Action.HOLD in output.actions:
            self._hold.publish(Empty())
        if Action.RETURN in output.actions:
            header = Header(stamp=rospy.Time.from_sec(self._t), frame_id=self._world_frame)
            self._return.publish(PointStamped(header, Point(*output.target)))
        if not self._departure.is_due:
            self._dji.order(output.actions)

    def _serve(self, request: Request) -> Callable[[TriggerRequest], TriggerResponse]:
        def handle(_: TriggerRequest) -> TriggerResponse:
            question = Question(request)
            try:
                self._questions.put_nowait(question)
            except queue.Full:
                return TriggerResponse(False, "too many requests at once")
            if not question.answered.wait(ANSWER_TIMEOUT) and not question.give_up():
                question.answered.wait(ANSWER_TIMEOUT)  # a tick is at it
            return TriggerResponse(*question.answer)

        return handle

    def _next_question(self) -> Optional[Question]:
        try:
            question = self._questions.get_nowait()
        except queue.Empty:
            return None
        if not self._departure.is_due:
            return question if question.take_up() else None
        question.answer = (False, "the guard is ending")
        question.answered.set()
        return None


def main() -> None:
    """Entry point of the node: exit status 2 on bad parameters."""
    # before any thread of ours begins: all inherit it, and none that runs Python comes after others
    priority = _ask_for_priority()
    rospy.init_node("flight_guard", disable_signals=True)
    if priority:
        rospy.loginfo(priority)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        guard = _guard()
        node = GuardNode(guard, bool(rospy.get_param("~avoidance", True)))
        gc.collect()
        gc.freeze()  # or now and then a tick would wait until all modules were looked through again
        with logging_in_a_thread():
            node.run()
    except NmpcError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        pass  # rospy's own handler would end ROS before authority is given back
    finally:
        rospy.signal_shutdown("flight_guard ends")


def _guard() -> Guard:
    profile = rospy.get_param("~profile", "")
    params = load_guard_parameters(profile=profile)
    params = replace(params, world_frame=rospy.get_param("~frame_id", params.world_frame))
    parameters = load_parameters(_vehicle_name(), profile=profile)
    simulated = bool(rospy.get_param("~simulated", False))
    if simulated:
        params = replace(params, modes=replace(params.modes, needs_switch=False))
    vehicle = parameters.vehicle
    refusal = start_checks.thrust_map(vehicle, params.vertical_command, simulated)
    if refusal:
        rospy.logerr(f"start will be refused: {refusal}")
    return Guard(params, vehicle, parameters.limits, refusal)


def _ask_for_priority() -> str:
    """Run ahead of solver, recorder and desktop; return what the system does not allow, if so."""
    told = "doc/first_flight.md, step 0"
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(REAL_TIME))
        return ""
    except OSError:
        pass
    try:
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    except OSError:
        return f"no right to a higher priority: {told}"
    return f"no right to real time, only to niceness {NICENESS}: {told}"


def _vehicle_name() -> str:
    name = rospy.get_param("~vehicle", "")
    if not name:
        raise ConfigError("parameter", "~vehicle", name, "the name of a file in config/vehicles")
    return name
