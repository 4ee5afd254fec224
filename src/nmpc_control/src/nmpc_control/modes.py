# SPDX-License-Identifier: MIT
"""Transitions of a flight: one pure function of mode, inputs and parameters, and its answers.

The rules stand in ``mode_rules``; ``doc/modes.md`` is written from them.
"""

from dataclasses import dataclass
from typing import Tuple

from nmpc_control.mode_inputs import (
    AUTOMATIC,
    STREAMING,
    Mode,
    ModeInputs,
    ModeParameters,
    Request,
)
from nmpc_control.mode_rules import RULES
from nmpc_control.preflight import preflight


@dataclass(frozen=True)
class Transition:
    """The mode to be in, and why in plain words and as a code; both empty without a change."""

    mode: Mode
    reason: str
    code: str = ""


def next_mode(mode: Mode, inputs: ModeInputs, params: ModeParameters) -> Transition:
    """Return the mode that follows; its reason is empty where nothing changes."""
    for rule in RULES:
        if mode in rule.modes and rule.when(inputs, params):
            return Transition(rule.to, rule.reason.format(i=inputs, p=params), rule.code)
    return Transition(mode, "")


def answer(mode: Mode, i: ModeInputs, p: ModeParameters) -> Tuple[bool, str]:
    """Return whether the request in ``i`` is granted in this mode, and a sentence about it."""
    request = i.request
    if request is Request.START:
        if mode in AUTOMATIC:
            return False, f"automatic flight is under way: {mode.name.lower()}"
        if mode is Mode.MANUAL:
            return False, f"the pilot has control: RC {i.rc.value}"
        against = preflight(i, p)
        if against:
            return False, "not started: " + "; ".join(against)
        return True, "taking off" if i.on_ground else "braking to hover"
    if request is Request.HOVER:
        granted = mode in STREAMING
        return granted, "hovering" if granted else f"not in flight: {mode.name.lower()}"
    if request is Request.LAND:
        granted = mode in (Mode.TAKING_OFF, *STREAMING)
        return granted, "landing" if granted else f"not in flight: {mode.name.lower()}"
    granted = mode in (*AUTOMATIC, Mode.READY, Mode.FAULT)
    return granted, "giving authority back" if granted else f"nothing held: {mode.name.lower()}"
