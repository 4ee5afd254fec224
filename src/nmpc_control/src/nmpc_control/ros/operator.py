# SPDX-License-Identifier: MIT
"""Flies one scenario from the ground and back: start, hover, trajectory, hover, land.

ROS Services called: ``start``, ``land``. ROS Action: ``fly_trajectory``. ROS Subscribers:
``nmpc/status``.
Exit status 0 only when the trajectory ended where it should and the aircraft is on the ground
again.
"""

import argparse
import sys
from typing import Callable, List, Optional

import actionlib
import rospy
from std_srvs.srv import Trigger

from nmpc_msgs.msg import ControllerStatus, FlyTrajectoryAction, FlyTrajectoryGoal, Plan

_POLL = 0.1  # [s] of ROS time
_START_TIMEOUT = 60.0  # [s] until `start` is accepted
_TAKE_OFF_TIMEOUT = 60.0  # [s]
_LANDING_TIMEOUT = 120.0  # [s]
_PHASES = {
    Plan.GOAL_HOLD: "hold",
    Plan.GOAL_APPROACH: "approach",
    Plan.GOAL_TRAJECTORY: "trajectory",
}
_ON_GROUND = (ControllerStatus.MODE_READY, ControllerStatus.MODE_WAITING)


class FlightError(Exception):
    """The flight cannot go on; the text says why."""


class Operator:
    """Talks to guard and controller the way a person with a terminal would."""

    def __init__(self) -> None:
        self._status: Optional[ControllerStatus] = None
        self._shown = ""
        self._client = actionlib.SimpleActionClient("fly_trajectory", FlyTrajectoryAction)
        rospy.Subscriber("nmpc/status", ControllerStatus, self._on_status, queue_size=1)

    def fly(self, scenario: str, speed: float) -> bool:
        """Fly a scenario by name.

        Returns whether it arrived. Raises FlightError when a step is refused.
        """
        self._start()
        self._wait(self._is(ControllerStatus.MODE_HOVERING), _TAKE_OFF_TIMEOUT, "take-off")
        self._say("in the air, hovering")
        if not self._client.wait_for_server(rospy.Duration(20.0)):
            raise FlightError("nmpc_controller offers no action fly_trajectory")
        goal = FlyTrajectoryGoal(scenario=scenario, speed=speed)
        self._client.send_goal(goal, feedback_cb=self._on_feedback)
        while not self._client.wait_for_result(rospy.Duration(_POLL)):
            if rospy.is_shutdown():
                raise FlightError("interrupted")
        result = self._client.get_result()
        arrived = bool(result and result.arrived)
        words = "arrived" if arrived else "did not arrive"
        self._say(f"{words}: {result.message if result else 'no result'}")
        self.land()
        return arrived

    def land(self) -> None:
        """Land and wait until the aircraft is on the ground; raises FlightError."""
        answer = self._call("land")
        if not answer.success:
            raise FlightError(f"land refused: {answer.message}")
        self._wait(lambda status: status.mode in _ON_GROUND, _LANDING_TIMEOUT, "landing")
        self._say("landed")

    def _start(self) -> None:
        deadline = rospy.Time.now() + rospy.Duration(_START_TIMEOUT)
        while not rospy.is_shutdown():
            answer = self._call("start")
            if answer.success:
                self._say(f"start: {answer.message}")
                return
            self._say(f"not yet: {answer.message}")
            if rospy.Time.now() > deadline:
                raise FlightError(f"start refused: {answer.message}")
            rospy.sleep(_POLL)
        raise FlightError("interrupted")

    def _call(self, service: str):  # noqa: ANN202 (a generated type)
        try:
            rospy.wait_for_service(service, timeout=20.0)
            return rospy.ServiceProxy(service, Trigger)()
        except (rospy.ROSException, rospy.ServiceException) as error:
            raise FlightError(f"service {service}: {error}") from None

    def _wait(self, reached: Callable[[ControllerStatus], bool], timeout: float, what: str) -> None:
        deadline = rospy.Time.now() + rospy.Duration(timeout)
        while not rospy.is_shutdown():
            if self._status is not None and reached(self._status):
                return
            if rospy.Time.now() > deadline:
                reason = self._status.reason if self._status else "no status from flight_guard"
                raise FlightError(f"{what} did not finish in {timeout:.0f} s: {reason}")
            rospy.sleep(_POLL)
        raise FlightError("interrupted")

    @staticmethod
    def _is(mode: int) -> Callable[[ControllerStatus], bool]:
        return lambda status: status.mode == mode

    def _on_status(self, status: ControllerStatus) -> None:
        self._status = status

    def _on_feedback(self, feedback) -> None:  # noqa: ANN001 (a generated type)
        step = int(feedback.progress * 10)
        phase = _PHASES.get(feedback.goal, "?")
        if feedback.goal == Plan.GOAL_TRAJECTORY:
            clearance = (
                f", clearance {feedback.clearance:.2f} m" if feedback.clearance < 1e6 else ""
            )
            self._say(
                f"{phase} {10 * step} %: deviation {feedback.deviation:.2f} m{clearance}",
                key=f"{phase}{step}",
            )
        else:
            self._say(phase, key=phase)

    def _say(self, text: str, key: Optional[str] = None) -> None:
        if (key or text) != self._shown:
            self._shown = key or text
            sys.stdout.write(f"[{rospy.Time.now().to_sec():7.2f} s] {text}\n")
            sys.stdout.flush()


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``fly_scenario``."""
    parser = argparse.ArgumentParser(prog="fly_scenario", description=__doc__.split("\n")[0])
    parser.add_argument("scenario", help="name of a scenario that nmpc_controller knows")
    parser.add_argument(
        "--speed", type=float, default=0.0, help="mean speed [m/s]; 0: the scenario's own"
    )
    options = parser.parse_args(rospy.myargv(argv)[1:] if argv is None else argv)
    rospy.init_node("operator", anonymous=True)
    operator = Operator()
    try:
        arrived = operator.fly(options.scenario, options.speed)
    except FlightError as error:
        sys.exit(f"fly_scenario: {error}")
    except rospy.ROSInterruptException:
        sys.exit("fly_scenario: interrupted")
    sys.exit(0 if arrived else 1)
