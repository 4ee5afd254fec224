# SPDX-License-Identifier: MIT
"""What must be good before automatic flight starts; a plain sentence for each thing that is not."""

import math
from typing import Tuple

from nmpc_control.dji import TRUSTED_GPS_HEALTH, RcMode
from nmpc_control.mode_inputs import ModeInputs, ModeParameters


def preflight(i: ModeInputs, p: ModeParameters) -> Tuple[str, ...]:
    """Return what stands against a start, one plain sentence each; empty if nothing does."""
    has_rc, has_status = i.rc_age <= p.rc_timeout, i.status_age <= p.status_timeout
    has_battery, has_gps = i.battery_age <= p.battery_timeout, i.gps_age <= p.status_timeout
    plans = f"{i.verified_plans} of {p.warm_up_plans} plans verified in a row"
    checks = (
        (i.attitude_age > p.attitude_timeout, f"attitude is {_age(i.attitude_age)}"),
        (i.velocity_age > p.velocity_timeout, f"velocity is {_age(i.velocity_age)}"),
        (i.position_age > p.position_timeout, f"position is {_age(i.position_age)}{_missing(i)}"),
        (not has_rc, f"RC is {_age(i.rc_age)}"),
        (has_rc and i.rc is not RcMode.F, f"the RC switch is not in F but {i.rc.value}"),
        (
            p.needs_switch and has_rc and i.rc is RcMode.F and not i.switched_to_f,
            "the RC switch was not seen going to F: take it away and back",
        ),
        (has_rc and not i.sticks <= p.stick_centre, "the sticks are not centred"),
        (not has_status, f"flight status is {_age(i.status_age)}"),
        (
            has_status and not (i.on_ground or i.in_air),
            f"the flight controller says {i.flight_status.name.lower()}",
        ),
        (not has_battery, f"the battery's state is {_age(i.battery_age)}"),
        (
            has_battery and not i.battery >= p.battery_start,
            f"the battery is at {100 * i.battery:.0f} %, {100 * p.battery_start:.0f} % are needed",
        ),
        (i.needs_gps and not has_gps, f"GPS health is {_age(i.gps_age)}"),
        (
            i.needs_gps and has_gps and i.gps_health <= TRUSTED_GPS_HEALTH,
            f"GPS health is {i.gps_health}, more than {TRUSTED_GPS_HEALTH} is needed",
        ),
        (
            i.verified_plans < p.warm_up_plans,
            f"{plans} ({i.plan_finding})" if i.plan_finding else plans,
        ),
    )
    return tuple(sentence for stands_against, sentence in checks if stands_against) + i.objections


def _age(seconds: float) -> str:
    return "missing" if math.isinf(seconds) else f"{seconds:.2f} s old"


def _missing(i: ModeInputs) -> str:
    """Return the hint that local_position needs a reference, where it never came."""
    no_reference = i.needs_gps and math.isinf(i.position_age)
    return ": dji_sdk has no local position reference yet" if no_reference else ""
