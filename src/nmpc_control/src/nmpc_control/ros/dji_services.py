# SPDX-License-Identifier: MIT
"""Calls of dji_sdk's services from a thread of their own: one may block 10 s, the stream may not.

ROS Services called: dji_sdk/sdk_control_authority, dji_sdk/drone_task_control,
dji_sdk/set_local_pos_ref.
"""

import queue
import threading
from typing import Any, Callable, Dict, Sequence, Tuple

import rospy

from dji_sdk.srv import DroneTaskControl, SDKControlAuthority, SetLocalPosRef
from nmpc_control.dji import Task
from nmpc_control.guard_data import Action
from nmpc_control.ros.known_service import KnownService

ATTEMPTS = 3  # [1] a refusal may be "in progress" only
PAUSE = 1.0  # [s] between attempts
WAIT = 2.0  # [s] for a service to appear
LOOK = 1.0  # [s] between two looks for services not found yet

_CALLS: Dict[Action, Tuple[str, type, Tuple[int, ...]]] = {
    Action.OBTAIN_AUTHORITY: ("dji_sdk/sdk_control_authority", SDKControlAuthority, (1,)),
    Action.RELEASE_AUTHORITY: ("dji_sdk/sdk_control_authority", SDKControlAuthority, (0,)),
    Action.TAKE_OFF: ("dji_sdk/drone_task_control", DroneTaskControl, (int(Task.TAKE_OFF),)),
    Action.LAND: ("dji_sdk/drone_task_control", DroneTaskControl, (int(Task.LAND),)),
    Action.SET_REFERENCE: ("dji_sdk/set_local_pos_ref", SetLocalPosRef, ()),
}
_AUTHORITY_ACKS = {
    0: "the RC switch is not in F",
    3: "obtaining is in progress",
    4: "releasing is in progress",
    5: "the RC switch must be in P",
    6: "the RC switch must be in F",
    0xC9: "intelligent orientation control is active",
}


class DjiServices:
    """A queue of calls; a newer order makes older ones that wait or repeat obsolete."""

    def __init__(
        self,
        on_authority: Callable[[bool], None],
        on_failure: Callable[[str], None],
        on_landing: Callable[[], None],
    ) -> None:
        """Begin to work; what calls bring is told from a thread of their own.

        Args:
            on_authority: told whether it is held now.
            on_failure: told in words after the last attempt.
            on_landing: told when a call to land was granted.
        """
        self._on_authority = on_authority
        self._on_failure = on_failure
        self._on_landing = on_landing
        self._orders: "queue.Queue[Tuple[int, Sequence[Action]]]" = queue.Queue()
        self._known = {name: KnownService(name, kind) for name, kind, _ in _CALLS.values()}
        self._newest = 0
        self.may_hold_authority = (
            False  # asked for, and not given back with an acknowledgement since
        )
        self._changed = threading.Event()
        threading.Thread(target=self._work, name="dji_services", daemon=True).start()

    def order(self, actions: Sequence[Action]) -> None:
        """Carry out the actions one after the other, as long as each one succeeds."""
        calls = [action for action in actions if action in _CALLS]
        if not calls:
            return
        if Action.OBTAIN_AUTHORITY in calls:
            self.may_hold_authority = True
        if calls != [Action.SET_REFERENCE]:
            self._newest += 1
            self._changed.set()
        self._orders.put((self._newest, calls))

    def release_now(self) -> Tuple[bool, str]:
        """Give authority back in this thread, ahead of everything that waits."""
        self._newest += 1
        self._changed.set()
        succeeded, sentence = self._call(Action.RELEASE_AUTHORITY)
        self.may_hold_authority = not succeeded
        if succeeded:
            self._on_authority(False)
        return succeeded, sentence

    def _work(self) -> None:
        while not rospy.is_shutdown():
            try:
                number, actions = self._orders.get(timeout=LOOK)
            except queue.Empty:
                for service in self._known.values():
                    service.find()  # before it is needed, while there is a master to ask
                continue
            for action in actions:
                if not self._carry_out(number, action):
                    break

    def _carry_out(self, number: int, action: Action) -> bool:
        for attempt in range(ATTEMPTS):
            if number != self._newest:
                return False
            self._changed.clear()
            succeeded, sentence = self._call(action)
            rospy.loginfo(sentence)
            if succeeded and action is Action.RELEASE_AUTHORITY:
                self.may_hold_authority = False
            if number != self._newest:
                return False
            if succeeded:
                if action in (Action.OBTAIN_AUTHORITY, Action.RELEASE_AUTHORITY):
                    self._on_authority(action is Action.OBTAIN_AUTHORITY)
                elif action is Action.LAND:
                    self._on_landing()
                return True
            if attempt < ATTEMPTS - 1:
                self._changed.wait(PAUSE)
        self._on_failure(sentence)
        return False

    def _call(self, action: Action) -> Tuple[bool, str]:
        """Return whether dji_sdk carried out the action, and a sentence about it."""
        name, _, arguments = _CALLS[action]
        try:
            answer = self._known[name].call_within(WAIT, *arguments)
        except rospy.ROSInterruptException:
            return False, f"{action.value}: interrupted"
        except (rospy.ROSException, rospy.ServiceException) as error:
            return False, f"{action.value}: {name} does not answer: {error}"
        if answer.result:
            return True, f"{action.value}: done"
        return False, f"{action.value} was refused{_reason(action, answer)}"


def _reason(action: Action, answer: Any) -> str:
    if action is Action.SET_REFERENCE:
        return ": GPS health must be above 3"
    words = _AUTHORITY_ACKS.get(answer.ack_data, "") if "authority" in action.value else ""
    return f" (ack {answer.ack_data})" + (f": {words}" if words else "")
