# SPDX-License-Identifier: MIT
"""What stands against a start beyond ages: thrust map, rest, place, headings, own loop."""

import math
from typing import Optional

import numpy as np

from nmpc_control.estimator import StateEstimate
from nmpc_control.loop_watch import LoopWatch
from nmpc_control.params import Limits, Vehicle
from nmpc_control.state import POSITION, VELOCITY
from nmpc_control.watch import WatchParameters

OF_SIMULATOR = "simulator"  # in `measured_on`: a model's map, not an airframe's


def thrust_map(vehicle: Vehicle, vertical_command: str, simulated: bool) -> str:
    """Return why thrust must not be commanded on this airframe; empty: it may be.

    Args:
        vehicle: with its thrust map.
        vertical_command: thrust, or velocity, which needs no map.
        simulated: whether the launch says that it flies a simulator.
    """
    measured_on = vehicle.thrust_map.measured_on
    where = f"vehicles/{vehicle.name}.yaml: thrust_map.measured_on"
    advice = "measure it, or fly with vertical_command: velocity"
    if vertical_command != "thrust":
        return ""
    if not measured_on.strip():
        return f"{where} is empty: {advice}"
    if OF_SIMULATOR in measured_on.lower() and not simulated:
        return f"{where} is a simulator's ({measured_on!r}), not of this airframe: {advice}"
    return ""


def place(
    estimate: Optional[StateEstimate], on_ground: bool, limits: Limits, p: WatchParameters
) -> str:
    """Return why the state is not one to start from; empty: it is, or there is none yet."""
    if estimate is None:
        return ""
    position, velocity = estimate.vector[POSITION], estimate.vector[VELOCITY]
    axes = slice(0, 2) if on_ground else slice(0, 3)  # the ground lies below the fence
    low, high = limits.fence_min - p.fence_margin, limits.fence_max + p.fence_margin
    if np.any((position < low)[axes]) or np.any((position > high)[axes]):
        return f"the position {np.round(position, 1)} m is outside of the fence"
    if not on_ground:
        return ""
    speed = float(np.linalg.norm(velocity))
    if speed > p.rest_speed:
        return f"the aircraft is not at rest: {speed:.1f} m/s"
    if abs(position[2]) > p.start_height:
        return f"the height is {position[2]:.1f} m although the aircraft stands on the ground"
    return ""


def headings(disagreement: float, p: WatchParameters) -> str:
    """Return whether motion capture's yaw and dji_sdk's differ [rad]; empty: no, or only one."""
    if not abs(disagreement) > p.yaw_agreement:  # NaN: only one
        return ""
    degrees = math.degrees(abs(disagreement))
    return f"the yaw of motion capture and of dji_sdk differ by {degrees:.0f} degrees"


def loop(watch: LoopWatch, p: WatchParameters) -> str:
    """Return whether the guard's own loop is too slow; empty: no."""
    wanted = 1.0 / watch.period
    if not watch.rate < p.loop_rate * wanted:  # NaN: not known yet
        return ""
    return (
        f"the computer is overloaded: commands would leave at {watch.rate:.0f} of {wanted:.0f} Hz"
    )
