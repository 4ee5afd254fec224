# SPDX-License-Identifier: MIT
"""ROS node nmpc_controller: estimates, samples the reference, solves, publishes plans.

Never commands the aircraft.

ROS Subscribers:
    the state: see ``state_port``; nmpc/position_source (nmpc_msgs/PositionSource): its source.
    nmpc/status (nmpc_msgs/ControllerStatus): mode of the guard and the input really sent.
    nmpc/hold_request (std_msgs/Empty): drop the goal and hold position.
    nmpc/return_request (geometry_msgs/PointStamped): drop the goal and fly there.
    obstacles, nmpc/forget_obstacles: see ``obstacle_port`` and ``obstacle_services``.
    command/pose, command/trajectory: see ``commands``.
ROS Action: fly_trajectory (nmpc_msgs/FlyTrajectory). ROS Services: see ``resume_service``,
    ``tuning_port``.
ROS Publishers: see ``publishers``.
ROS Parameters:
    ~vehicle (str): file under config/vehicles. ~profile (str): file under config/profiles.
    ~weights (str): weight preset, default the scenario's own.
    ~scenario (str): name or path of a scenario that is offered beside the named ones.
    ~backend (str): compiled or ipopt. ~avoidance (bool): false removes the obstacle term.
    ~frame_id (str): world frame. ~base_frame (str): body frame, default base_link below the
    node's namespace, so that several vehicles share one tree of frames.
"""

import queue
import sys
import time
import traceback
from collections import deque
from typing import Callable, Deque, Dict, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import Empty, String

from nmpc_control.clock_steps import ClockSteps
from nmpc_control.controller import Controller
from nmpc_control.errors import NmpcError
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.ladder import BRAKES
from nmpc_control.mode_inputs import FOLLOWED, PLANNED
from nmpc_control.obstacle import Obstacle
from nmpc_control.params import Limits, Parameters, load_weights
from nmpc_control.ros.commands import Commands
from nmpc_control.ros.log_thread import logging_in_a_thread
from nmpc_control.ros.node_parameters import load_node_parameters
from nmpc_control.ros.obstacle_port import ObstaclePort
from nmpc_control.ros.publishers import Publishers
from nmpc_control.ros.resume_service import ResumeService
from nmpc_control.ros.source_switch import TOPIC as SOURCE_TOPIC
from nmpc_control.ros.source_switch import follow
from nmpc_control.ros.state_port import StatePort
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.ros.trajectory_action import TrajectoryAction, scenario_of
from nmpc_control.ros.tuning_port import TuningPort
from nmpc_control.scenario import Scenario, load_scenario
from nmpc_control.state import POSITION, YAW
from nmpc_control.tuning import Tuning
from nmpc_msgs.msg import ControllerStatus, PositionSource

TELEMETRY_WAIT = 0.025  # [s] of wall time: a plan is made from a state that has just come


class ControllerNode:
    """Callbacks store or queue; everything else happens in ``run``, in one thread."""

    def __init__(self) -> None:
        self.frame_id = rospy.get_param("~frame_id", "world")
        self.parameters = load_node_parameters()
        guard = load_guard_parameters(profile=rospy.get_param("~profile", ""))
        self._vertical_command = guard.vertical_command
        self._tuning = Tuning(self.parameters, guard.plan_check.minimum_clearance)
        self.controller = Controller(self.parameters, self._vertical_command)
        self.scenario: Optional[Scenario] = None
        offered = rospy.get_param("~scenario", "")
        self._offered = load_scenario(offered) if offered else None
        self._guard_is = (ControllerStatus.MODE_WAITING, ControllerStatus.RUNG_NONE)
        self._inputs: Deque[Tuple[float, Optional[Tuple[float, ...]]]] = deque(maxlen=200)
        self._requests: "queue.Queue[Callable[[float], None]]" = queue.Queue(maxsize=20)
        self._known: Dict[str, Obstacle] = {}  # of scenarios: a new goal does not remove them
        self._port = ObstaclePort(self.frame_id, lambda: self.controller.nmpc.left_out)
        base_frame = rospy.get_param("~base_frame", f"{rospy.get_namespace()}base_link".lstrip("/"))
        self.publishers = Publishers(self.frame_id, base_frame)
        self.publishers.add_diagnostics("obstacles", self._port.diagnose)
        self.state = StatePort(self.controller.estimator, self.frame_id)
        self.publishers.add_diagnostics("position", self.state.diagnose)
        self.action = TrajectoryAction(
            on_goal=lambda: self._request(self._accept_goal),
            on_cancel=lambda: self._request(self._cancel_goal),
        )
        self._commands = Commands(self.frame_id, lambda: self.controller, self.action, self._show)
        self._tuning_port = TuningPort(self._tuning, self._request, self._take, self._commands.tell)
        self.publishers.add_diagnostics("tuning", self._tuning_port.diagnose)
        if self._offered:
            self._show(self._offered)

    def run(self) -> None:
        """Solve at the controller's rate until shutdown; after a failed tick the next is tried."""
        self.action.start()
        self._subscribe()
        ResumeService(self._request, lambda t: self.controller.take_up(t))
        rate = rospy.Rate(self.parameters.solver.budget.rate)
        period = 1.0 / self.parameters.solver.budget.rate
        misses, last, clock = 0, None, ClockSteps()
        while not rospy.is_shutdown():
            now = rospy.Time.now()
            if clock.went_back(now.to_sec()):
                last = None
                self._start_anew()
            if last is not None:
                misses += max(0, int(round((now - last).to_sec() / period)) - 1)
            last = now
            try:
                self._tick(now, misses)
            except Exception:  # noqa: BLE001 (one bad tick must not end the control of an aircraft)
                rospy.logerr_throttle(1.0, f"control step failed: {traceback.format_exc(limit=-3)}")
                self.controller.nmpc.reset()
            is_late = rate.remaining() <= rospy.Duration(0)
            try:
                rate.sleep()
            except rospy.ROSTimeMovedBackwardsException:
                continue  # seen above, like a computer's own clock, of which rospy does not tell
            except rospy.ROSInterruptException:
                break
            if not is_late:
                self.state.wait_for_velocity(TELEMETRY_WAIT)

    def _start_anew(self) -> None:
        """Forget everything that carries a time, as after a jump of the clock."""
        rospy.logwarn("the clock jumped backwards")
        self.controller = Controller(self.parameters, self._vertical_command)
        self._inputs.clear()
        self._port.start_anew()
        self.state.start_anew(self.controller.estimator)
        self.action.finish(rospy.Time.now().to_sec(), False, "the clock jumped backwards")

    def _tick(self, now: rospy.Time, misses: int) -> None:
        t, begun = now.to_sec(), time.perf_counter()
        state_stamp = self.state.newest
        while self._inputs:
            sent, u = self._inputs.popleft()
            self.controller.record_input(sent, None if u is None else np.array(u))
        self._follow_guard()
        while not self._requests.empty():
            self._requests.get_nowait()(t)
        self.controller.obstacles, _ = self._port.look(t, self.controller.estimator)
        pursued = self.controller.itinerary.is_pursuing
        clock_start = self.controller.itinerary.clock_start
        step = self.controller.step(t)
        if step is not None:
            self.publishers.step(now, step, misses, state_stamp, time.perf_counter() - begun)
        elif self.state.hears:
            self.publishers.no_plan(now, self.controller.why_not(t), state_stamp)
        self.publishers.obstacles(t, self.controller.obstacles)
        self.publishers.diagnose(step, misses)
        if step is None:
            return
        itinerary = self.controller.itinerary
        if itinerary.clock_start is not None and itinerary.clock_start != clock_start:
            self.publishers.trajectory(self.scenario, itinerary.clock_start)
        self.action.report(t, step, itinerary, pursued)
        self.controller.prepare()

    def _follow_guard(self) -> None:
        """Have the controller know what the guard does, all of it at once and between two steps."""
        mode, rung = self._guard_is
        self.controller.engaged = mode in PLANNED
        self.controller.braking = mode == ControllerStatus.MODE_BRAKING
        self.controller.held_back = mode in PLANNED and rung in BRAKES
        self.controller.manual = mode in FOLLOWED

    def _accept_goal(self, t: float) -> None:
        goal = self.action.accept()
        if goal is None:
            return
        if self.action.cancelled:
            self._hold(t, "the goal was cancelled")
            return
        try:
            scenario = scenario_of(goal, self._offered)
            along = np.linspace(0.0, scenario.trajectory.duration, 500)
            self._require_inside_fence(scenario.trajectory.sample(along).position)
        except NmpcError as error:
            self._hold(t, str(error))  # accepting it has ended the goal before
            return
        estimate = self.controller.estimator.estimate(t)
        if estimate is None or not self.controller.engaged:
            self._hold(t, "automatic flight is off: call `start` first")
            return
        self._use(scenario)
        x = estimate.vector
        self.controller.itinerary.fly(t, x[POSITION], x[YAW], scenario.trajectory)

    def _use(self, scenario: Scenario) -> None:
        weights = rospy.get_param("~weights", "") or scenario.weights
        self._tuning.use_weights(load_weights(weights), self._take)
        self._tuning_port.refresh()
        self._show(scenario)

    def _take(self, parameters: Parameters) -> None:
        """Put parameters into force for the next step; raises NmpcError and leaves the old."""
        self._require_kept(parameters.limits)
        self.controller.use(parameters)
        self.parameters = parameters

    def _require_kept(self, limits: Limits) -> None:
        """Raise NmpcError where a new fence would leave the aircraft outside."""
        estimate = self.controller.estimator.estimate(rospy.Time.now().to_sec())
        if estimate is None:
            return
        place = estimate.vector[POSITION]
        if self.parameters.limits.encloses(place) and not limits.encloses(place):
            raise NmpcError("the aircraft would be outside of that fence")

    def _show(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._known.update({obstacle.id: obstacle for obstacle in scenario.obstacles})
        known = tuple(self._known.values())
        self._port.set_known(known)
        self.publishers.known_obstacles(known)
        self.publishers.trajectory(scenario, None)
        self.publishers.room(scenario.room)

    def _cancel_goal(self, t: float) -> None:
        if self.action.cancelled:
            self._hold(t, "the goal was cancelled")

    def _hold(self, t: float, message: str) -> None:
        estimate = self.controller.estimator.estimate(t)
        if estimate is not None:
            self.controller.itinerary.hold(estimate.vector[POSITION], estimate.vector[YAW], message)
        self.action.finish(t, False, message)

    def _return(self, t: float, message: PointStamped) -> None:
        """Fly to where the guard says that automatic flight began."""
        p = message.point
        target = np.array([p.x, p.y, p.z])
        estimate = self.controller.estimator.estimate(t)
        if estimate is None or not self.controller.engaged or not np.all(np.isfinite(target)):
            return
        self.action.finish(t, False, "the battery is low")
        x = estimate.vector
        self.controller.itinerary.go_to(t, x[POSITION], x[YAW], target, float(x[YAW]))

    def _require_inside_fence(self, points: np.ndarray) -> None:
        limits = self.parameters.limits
        if not limits.encloses(points):
            raise NmpcError(
                f"the reference leaves the fence from {limits.fence_min} to {limits.fence_max} m"
            )

    def _request(self, action: Callable[[float], None]) -> None:
        try:
            self._requests.put_nowait(action)
        except queue.Full:
            rospy.logwarn_throttle(1.0, "more requests than can be served: one dropped")

    def _subscribe(self) -> None:
        subscriptions = Subscriptions()
        self._port.subscribe(subscriptions, known=False)
        listen = subscriptions.add

        def on_status(m: ControllerStatus) -> None:
            self._guard_is = (m.mode, m.rung)
            u = (m.applied.thrust, m.applied.roll, m.applied.pitch, m.applied.yaw_rate)
            known = m.setpoint_sent and np.all(np.isfinite(u))
            self._inputs.append((m.header.stamp.to_sec(), u if known else None))

        self.state.subscribe(subscriptions)
        listen(SOURCE_TOPIC, PositionSource, lambda m: follow(self.state, m), queue_size=10)
        listen("nmpc/status", ControllerStatus, on_status, queue_size=10)
        listen(
            "nmpc/hold_request",
            Empty,
            lambda m: self._request(lambda t: self._hold(t, "told to hold")),
        )
        listen(
            "nmpc/return_request",
            PointStamped,
            lambda m: self._request(lambda t: self._return(t, m)),
        )
        listen("nmpc/forget_obstacles", String, lambda m: self._port.forget(m.data), queue_size=10)
        self._commands.subscribe(subscriptions, self._request)


def main() -> None:
    """Entry point of the node."""
    rospy.init_node("nmpc_controller")
    try:
        node = ControllerNode()
    except NmpcError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    with logging_in_a_thread():
        node.run()
