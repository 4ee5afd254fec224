# SPDX-License-Identifier: MIT
"""Control authority of the onboard computer: asked for, held, given back, lost (doc 4 and 5)."""

from typing import NamedTuple, Optional, Tuple

from uav_sim.preset import Undocumented
from uav_sim.remote_control import RemoteControl

RELEASED, OBTAINED, OBTAINING, RELEASING = 1, 2, 3, 4  # ack_data


class Ack(NamedTuple):
    """Reply to a command, field by field as dji_sdk's services give it."""

    result: bool
    cmd_set: int
    cmd_id: int
    ack_data: int


class ControlAuthority:
    """Held or not. The RC's switch decides who may ask, and ends it when it leaves F.

    ``refusal`` is the ack that answers every request to obtain; None: they are judged as usual.
    """

    def __init__(self, rc: RemoteControl, settings: Undocumented) -> None:
        self.held = False
        self.refusal: Optional[int] = None
        self._rc = rc
        self._settings = settings
        self._under_way: Optional[Tuple[bool, float]] = None  # wanted, time when it is done [s]
        self._suspended = False

    def request(self, t: float, enable: bool) -> Ack:
        """Obtain or give back the authority at ``t`` [s]."""
        if enable and not self._rc.allows_sdk:
            return _reply(False, self._settings.wrong_mode_ack)
        if enable and self.refusal is not None:
            return _reply(False, self.refusal)
        self._suspended = False
        if self.held != enable and not self._is_done(t, enable):
            return _reply(False, OBTAINING if enable else RELEASING)
        self.held = enable
        return _reply(True, OBTAINED if enable else RELEASED)

    def objection(self, must_hold: bool = True) -> str:
        """Return why the onboard computer may not command now; empty if it may."""
        if not self._rc.connected:
            return "the RC is off"
        if not self._rc.allows_sdk:
            return f"the RC is in {self._rc.mode}"
        return "" if self.held or not must_hold else "no control authority"

    def update(self) -> bool:
        """Follow the RC's switch; return whether the authority was lost just now."""
        if not self._rc.connected:
            return False
        in_f = self._rc.mode == "F"
        if in_f and self._suspended:
            self.held, self._suspended = True, False
        lost = self.held and not in_f
        if lost:
            self.held = False
            self._suspended = self._settings.authority_survives_toggle
        return lost

    def _is_done(self, t: float, enable: bool) -> bool:
        """Whether a request has been under way for long enough; the first one starts it."""
        if self._under_way is None or self._under_way[0] != enable:
            self._under_way = (enable, t + self._settings.authority_time)
        done = t >= self._under_way[1] - 1e-9
        if done:
            self._under_way = None
        return done


def _reply(result: bool, data: int) -> Ack:
    return Ack(result, 1, 0, data)
