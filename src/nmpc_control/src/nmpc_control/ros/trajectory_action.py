# SPDX-License-Identifier: MIT
"""The action fly_trajectory.

Goals in, feedback and result out, all from the control loop's thread.
"""

from typing import Callable, List, Optional

import actionlib
import numpy as np

from nmpc_control.controller import Step
from nmpc_control.errors import NmpcError
from nmpc_control.itinerary import Itinerary
from nmpc_control.scenario import Scenario, load_scenario, scenario_from_waypoints
from nmpc_control.state import Goal
from nmpc_msgs.msg import (
    FlyTrajectoryAction,
    FlyTrajectoryFeedback,
    FlyTrajectoryGoal,
    FlyTrajectoryResult,
)

_FEEDBACK_PERIOD = 0.2  # [s]


class TrajectoryAction:
    """Server of fly_trajectory.

    ``on_goal`` and ``on_cancel`` are called from ROS threads and only notify.
    """

    def __init__(self, on_goal: Callable[[], None], on_cancel: Callable[[], None]) -> None:
        self._server = actionlib.SimpleActionServer(
            "fly_trajectory", FlyTrajectoryAction, auto_start=False
        )
        self._server.register_goal_callback(on_goal)
        self._server.register_preempt_callback(on_cancel)
        self._deviations: List[float] = []
        self._began: Optional[float] = None
        self._fed_back = 0.0

    def start(self) -> None:
        """Offer the action."""
        self._server.start()

    @property
    def active(self) -> bool:
        """Whether a goal is pursued for a client."""
        return self._server.is_active()

    @property
    def cancelled(self) -> bool:
        """Whether the client asked to end the goal without a new one."""
        return self._server.is_preempt_requested() and not self._server.is_new_goal_available()

    def accept(self) -> Optional[FlyTrajectoryGoal]:
        """Return the goal that waits to be accepted, if any."""
        if not self._server.is_new_goal_available():
            return None
        self._deviations, self._began = [], None
        return self._server.accept_new_goal()

    def report(self, t: float, step: Step, itinerary: Itinerary, was_pursued: bool) -> None:
        """Send feedback, or the result where the itinerary has just ended its goal."""
        if step.goal is Goal.TRAJECTORY:
            self._began = t if self._began is None else self._began
            self._deviations.append(step.deviation)
        if not self.active:
            return
        outcome = itinerary.outcome
        if was_pursued and outcome is not None and step.goal is Goal.HOLD:
            self.finish(t, outcome.arrived, outcome.message)
        elif t - self._fed_back >= _FEEDBACK_PERIOD:
            self._fed_back = t
            self._server.publish_feedback(
                FlyTrajectoryFeedback(
                    goal=int(step.goal),
                    progress=itinerary.progress(t),
                    deviation=step.deviation,
                    clearance=step.clearance,
                )
            )

    def finish(self, t: float, arrived: bool, message: str) -> None:
        """End the goal that is pursued, if one is, with what was measured on the trajectory."""
        if not self.active:
            return
        deviations = self._deviations or [float("nan")]
        result = FlyTrajectoryResult(
            arrived=arrived,
            message=message,
            average_deviation=float(np.mean(deviations)),
            maximum_deviation=float(np.max(deviations)),
            navigation_time=0.0 if self._began is None else t - self._began,
        )
        if arrived:
            self._server.set_succeeded(result, message)
        else:
            self._server.set_aborted(result, message)


def scenario_of(goal: FlyTrajectoryGoal, offered: Optional[Scenario]) -> Scenario:
    """Return the scenario that a goal names, or one through its waypoints.

    Args:
        goal: as received; a name is looked up among the package's scenarios only, never as a path.
        offered: scenario that was loaded at start-up and may be named too.

    Raises:
        NmpcError: unknown name, a path, fewer than two waypoints, a value that is not finite.
    """
    if not np.isfinite(goal.speed) or goal.speed < 0:
        raise NmpcError(f"speed: got {goal.speed}, expected a finite number >= 0 [m/s]")
    speed = goal.speed if goal.speed > 0 else None
    if not goal.scenario:
        return scenario_from_waypoints(
            np.array([[p.x, p.y, p.z] for p in goal.waypoints]).reshape(-1, 3), speed
        )
    if offered and goal.scenario == offered.name and speed is None:
        return offered
    if "/" in goal.scenario or goal.scenario.endswith((".yaml", ".yml")):
        raise NmpcError(f"scenario: got {goal.scenario!r}, expected a name, not a path")
    return load_scenario(goal.scenario, speed=speed)
