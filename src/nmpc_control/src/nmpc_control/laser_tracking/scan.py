# SPDX-License-Identifier: MIT
"""One scan, judged before it is believed, and what each of its beams says."""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from nmpc_control.errors import NmpcError
from nmpc_control.laser_tracking.parameters import EchoParameters

_WHOLE_TURN = 2.0 * math.pi


class ScanError(NmpcError):
    """A scan cannot be used; ``kind`` is a short name to count by, the text says why."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class Beam(IntEnum):
    """What one beam says."""

    UNKNOWN = 0  # nothing: not a number, too near, or no such range
    FREE = 1  # nothing within range
    ECHO = 2  # a surface
    GROUND = 3


@dataclass(frozen=True)
class Scan:
    """A scan as ``sensor_msgs/LaserScan`` has it; beams in the order of their time."""

    t: float  # [s] of the first beam
    angle_min: float  # [rad] 0 is ahead, counter-clockwise
    angle_max: float  # [rad]
    angle_increment: float  # [rad] negative where the scanner turns clockwise
    time_increment: float  # [s] between beams
    range_min: float  # [m]
    range_max: float  # [m]
    ranges: np.ndarray  # (n,) [m] REP 117: inf is nothing within range, -inf is too near

    @property
    def angles(self) -> np.ndarray:
        """Angles (n,) [rad]."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))

    @property
    def times(self) -> np.ndarray:
        """Times (n,) [s]."""
        return self.t + self.time_increment * np.arange(len(self.ranges))

    @property
    def is_closed(self) -> bool:
        """Whether the last beam is the neighbour of the first."""
        span = abs(self.angle_increment) * len(self.ranges)
        return span >= _WHOLE_TURN - 0.5 * abs(self.angle_increment)


def require_usable(scan: Scan, echoes: EchoParameters) -> None:
    """Raise ScanError unless the scan's header makes sense; its ranges may hold anything."""
    n = len(scan.ranges)
    if not 3 <= n <= echoes.max_beams:
        raise ScanError("beams", f"scan of {n} beams, expected 3 to {echoes.max_beams}")
    if not (math.isfinite(scan.t) and scan.t > 0.0):
        raise ScanError("stamp", f"scan with stamp {scan.t:g} s")
    increment = scan.angle_increment
    angles = (scan.angle_min, scan.angle_max, increment)
    if not all(map(math.isfinite, angles)) or abs(increment) < 1e-6:
        raise ScanError("angles", "scan with angles {:g} to {:g} rad by {:g}".format(*angles))
    span = (n - 1) * abs(increment)
    if span > _WHOLE_TURN + 2.0 * abs(increment):
        raise ScanError("angles", f"scan of {n} beams by {increment:g} rad: more than one turn")
    if abs(scan.angle_min + (n - 1) * increment - scan.angle_max) > 0.01 + 2.0 * abs(increment):
        words = f"{n} beams from {scan.angle_min:g} by {increment:g} rad"
        raise ScanError("angles", f"scan of {words} does not end at {scan.angle_max:g}")
    if not 0.0 <= n * scan.time_increment <= 1.0:
        raise ScanError("times", f"scan with time_increment {scan.time_increment:g} s")
    if not 0.0 <= scan.range_min < scan.range_max < math.inf:
        limits = f"{scan.range_min:g} to {scan.range_max:g} m"
        raise ScanError("limits", f"scan with ranges from {limits}")


@np.errstate(invalid="ignore")
def judge(scan: Scan, echoes: EchoParameters) -> np.ndarray:
    """Return what each beam says (n,), as far as that can be told without a pose."""
    r = scan.ranges
    farthest = min(scan.range_max, echoes.max_range)
    kinds = np.full(len(r), Beam.UNKNOWN)
    kinds[r > farthest] = Beam.FREE
    kinds[(r >= max(scan.range_min, echoes.min_range)) & (r <= farthest)] = Beam.ECHO
    return kinds
