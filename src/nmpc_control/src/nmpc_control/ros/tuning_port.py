# SPDX-License-Identifier: MIT
"""dynamic_reconfigure for what ``tuning`` may change, in flight too.

ROS: the server's usual names below ~tuning: set_parameters, parameter_descriptions and the latched
parameter_updates, which is what is in force. Refused: all stays, parameter_updates says the old
values again, the reason stands in its ``answer``, in nmpc/answer, the log and /diagnostics.
"""

import threading
from typing import Any, Callable, Dict

import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper
from dynamic_reconfigure.server import Server

from nmpc_control.cfg import TuningConfig
from nmpc_control.params import Parameters
from nmpc_control.tuning import Tuning, values_of

ANSWER_TIMEOUT = 2.0  # [s] wall time in which the control loop must answer
_FIRST = ~0  # level with which the server calls while it is being made
_ANEW, _ANSWER = "as_in_files", "answer"


class TuningPort:
    """Hands changes to the control loop, which makes them between two steps."""

    def __init__(
        self,
        tuning: Tuning,
        ask: Callable[[Callable[[float], None]], None],
        take: Callable[[Parameters], None],
        tell: Callable[[str], None],
    ) -> None:
        """Offer the parameters.

        Args:
            tuning: used in the control loop only, once this is made.
            ask: has something called in the control loop with the time [s].
            take: puts parameters into force; called there.
            tell: has a sentence for the operator published.
        """
        self._tuning, self._ask, self._take, self._tell = tuning, ask, take, tell
        self._shown = values_of(tuning.parameters)  # as clients know them
        self._answer = "as in the files"
        self._server = Server(TuningConfig, self._on_change, namespace="tuning")

    def refresh(self) -> None:
        """Show clients what is in force now; in a thread, as it asks the master many things."""
        threading.Thread(target=self._server.update_configuration, args=({},), daemon=True).start()

    def diagnose(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        """Fill the entry of /diagnostics."""
        refusal, changes = self._tuning.refusal, dict(self._tuning.changes)
        level = DiagnosticStatus.WARN if refusal else DiagnosticStatus.OK
        words = f"{len(changes)} values changed" if changes else "as in the files"
        status.summary(level, f"the last change was refused: {refusal}" if refusal else words)
        for name, value in sorted(changes.items()):
            status.add(name, f"{value:g}")
        return status

    def _on_change(self, config: Dict[str, Any], level: int) -> Dict[str, Any]:
        anew = level != _FIRST and bool(config[_ANEW])
        wanted = {name: float(config[name]) for name in self._shown}
        # only what the client changed: what it has not seen yet is not to be set back by it
        changed = {name: v for name, v in wanted.items() if not v == self._shown[name]}
        if level != _FIRST and (changed or anew):
            self._answer = self._change(changed, anew)
        self._shown = values_of(self._tuning.parameters)
        config.update(self._shown)
        config.update({_ANEW: False, _ANSWER: self._answer})
        return config

    def _change(self, changed: Dict[str, float], anew: bool) -> str:
        lock, answered = threading.Lock(), threading.Event()
        answer = []

        def change(_: float) -> None:
            with lock:
                if answered.is_set():
                    return  # too late: the client has been told that nothing was changed
                answer.append(self._tuning.change(changed, self._take, anew))
                answered.set()

        self._ask(change)
        answered.wait(ANSWER_TIMEOUT)
        with lock:
            answered.set()
        made, sentence = answer[0] if answer else (False, "refused: the controller did not answer")
        (rospy.loginfo if made else rospy.logwarn)(f"tuning {sentence}")
        self._tell(f"tuning {sentence}")
        return sentence
