# SPDX-License-Identifier: MIT
"""The service ``resume`` of nmpc_controller: go on with what the pilot interrupted.

ROS Services: resume (std_srvs/Trigger), answered with a reason in words.
"""

import threading
from typing import Callable, Tuple

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

ANSWER_TIMEOUT = 2.0  # [s] wall time in which the control loop must answer


class ResumeService:
    """Hands the request to the control loop and waits for its answer."""

    def __init__(
        self,
        ask: Callable[[Callable[[float], None]], None],
        take_up: Callable[[float], Tuple[bool, str]],
    ) -> None:
        """Offer the service.

        Args:
            ask: has something called in the control loop with the time [s].
            take_up: to be called there; returns whether the flight goes on, and a sentence.
        """
        self._ask = ask
        self._take_up = take_up
        rospy.Service("resume", Trigger, self._serve)

    def _serve(self, _: TriggerRequest) -> TriggerResponse:
        answered = threading.Event()
        answer = [(False, "the controller did not answer")]

        def take_up(t: float) -> None:
            answer[0] = self._take_up(t)
            answered.set()

        self._ask(take_up)
        answered.wait(ANSWER_TIMEOUT)
        return TriggerResponse(*answer[0])
