# SPDX-License-Identifier: MIT
"""What a person reads in ``nmpc/status``: the one sentence that matters most now."""

from nmpc_control.mode_conditions import battery_sentence
from nmpc_control.mode_inputs import PLANNED, Mode, ModeInputs, ModeParameters
from nmpc_control.preflight import preflight


def sentence(
    mode: Mode, seen: ModeInputs, params: ModeParameters, reason: str, evaded: str, flown: str
) -> str:
    """Return it.

    Args:
        mode: present one.
        seen: what the guard knows.
        params: thresholds.
        reason: why the mode was entered.
        evaded: obstacle that a brake gets out of the way of; empty: none.
        flown: what there is to say of the plan.
    """
    if mode is Mode.WAITING:
        return "; ".join(preflight(seen, params)) or reason
    if evaded:
        return f"{reason}; out of the way of obstacle {evaded}"
    if mode not in PLANNED:
        return reason
    if 2.0 * seen.effectless_time > params.effect_brake:
        return f"the aircraft does not follow the commands: {seen.effectless_time:.1f} s"
    return battery_sentence(seen, params) or flown
