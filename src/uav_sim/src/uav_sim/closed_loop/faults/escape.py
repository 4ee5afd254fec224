# SPDX-License-Identifier: MIT
"""Whether a collision could have been avoided by anybody.

The same flight again, bit for bit, up to where the case begins. From there one setpoint is sent on
and on in place of the guard's: as much tilt as DJI allows to one of eight sides, with the thrust
that carries it or all there is, full or least thrust level, or DJI's own brake. If each of them
collides too, the collision counts as unavoidable. What of the case concerns the aircraft goes wrong
here too: setpoints that are lost save nobody.
"""

import math
from dataclasses import replace
from typing import Dict

from nmpc_control import dji
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.params import load_parameters
from nmpc_control.state import GRAVITY
from uav_sim.closed_loop.faults.flight import PLANT, Flight, fly
from uav_sim.closed_loop.faults.matrix import Case

SIDES = 8
AFTER = 1.0  # [s] for which an escape must go on beyond the collision


def escapes() -> Dict[str, dji.Axes]:
    """Return the setpoints that are tried, by name."""
    limits, vehicle = load_guard_parameters().setpoint_limits, load_parameters(PLANT).vehicle
    carrying = vehicle.thrust_map.percent(GRAVITY / math.cos(limits.tilt))
    flag = float(dji.ATTITUDE_THRUST)
    found: Dict[str, dji.Axes] = {
        "brake": (0.0, 0.0, 0.0, 0.0, float(dji.VELOCITY)),
        "up": (0.0, 0.0, limits.thrust_max, 0.0, flag),
        "down": (0.0, 0.0, limits.thrust_min, 0.0, flag),
    }
    for k in range(SIDES):
        angle = 2.0 * math.pi * k / SIDES
        roll, pitch = limits.tilt * math.sin(angle), limits.tilt * math.cos(angle)
        side = f"tilt {math.degrees(angle):.0f}"
        found[side] = (roll, pitch, carrying, 0.0, flag)
        found[f"{side}, full thrust"] = (roll, pitch, limits.thrust_max, 0.0, flag)
    return found


def way_out(case: Case, situation: str, flight: Flight) -> str:
    """Return which escape a flight that collided has left out; empty: none would have helped."""
    hit = min(c.t for c in flight.loop.aircraft.collisions)
    short = replace(case, watch=max(hit - flight.t0, 0.0) + AFTER)
    for name, axes in escapes().items():
        if not fly(short, situation, escape=axes).loop.aircraft.collisions:
            return name
    return ""
