# SPDX-License-Identifier: MIT
"""Which parts of a recording can be replayed: in the air, commanded, without touching the ground.

Without flight_status, who hardly moves for a second under too little thrust to fly stands on the
ground, and goes on standing there until the first motion.
"""

from typing import List, NamedTuple

import numpy as np

from nmpc_control.analysis.windows import runs
from uav_sim.closed_loop.replay.recorded import PITCH, THRUST, Recorded

IN_AIR = 3  # flight_status of an M100
SHORTEST = 2.0  # [s] of a segment
_CARRYING = 0.9  # [1] of the hover thrust; with less, speed changes by 1 m/s in a second
_SLOW, _STANDING = 0.3, 1.0  # [m/s], [s]
_MOVING = 0.05  # [m/s] lifted off
_CONTACT = 20.0  # [m/s^2] upwards between two samples while sinking: only the ground does that
_GAP = 0.25  # [s] between velocities, or since the last command


class Segment(NamedTuple):
    """A part of a flight by stamps of receipt."""

    start: float  # [s]
    end: float  # [s]

    @property
    def duration(self) -> float:
        """Its length [s]."""
        return self.end - self.start


def airborne_segments(
    recorded: Recorded, hover_percent: float, start: float = -np.inf, end: float = np.inf
) -> List[Segment]:
    """Return the segments between two times [s], split at ground contacts and gaps.

    Args:
        recorded: commands and motion.
        hover_percent: thrust [percent] of the aircraft's hover.
        start: nothing before this time [s] of the bag counts.
        end: nothing after it counts.
    """
    velocity = recorded.velocity.between(start, end)
    if len(velocity) < 2:
        return []
    usable = _is_flying(recorded, velocity.times, velocity.values, hover_percent)
    usable &= _is_commanded(recorded, velocity.times)
    vz = velocity.values[:, 2]
    dt = np.maximum(np.diff(velocity.times), 1e-3)
    broken = (dt > _GAP) | ((np.diff(vz) / dt > _CONTACT) & (vz[:-1] < 0.0))
    segments, first = [], None
    for i, is_usable in enumerate(usable):
        if first is not None and (not is_usable or broken[i - 1]):
            segments.append(Segment(velocity.times[first], velocity.times[i - 1]))
            first = None
        if is_usable and first is None:
            first = i
    if first is not None:
        segments.append(Segment(velocity.times[first], velocity.times[-1]))
    return [segment for segment in segments if segment.duration >= SHORTEST]


def _is_flying(
    recorded: Recorded, times: np.ndarray, velocity: np.ndarray, hover_percent: float
) -> np.ndarray:
    if recorded.flight_status is not None:
        return recorded.flight_status.held_at(times)[:, 0] == IN_AIR
    speed = np.linalg.norm(velocity, axis=1)
    thrust = recorded.commands.held_at(times)[:, THRUST]
    may_stand = (speed < _SLOW) & (thrust < _CARRYING * hover_percent)
    flying = np.ones(len(times), dtype=bool)
    for begin, end in runs(times, may_stand):
        if end - begin >= _STANDING:
            moves = np.flatnonzero((times >= end) & (speed > _MOVING))
            lift_off = times[moves[0]] if len(moves) else np.inf
            flying &= (times < begin) | (times >= lift_off)
    return flying


def _is_commanded(recorded: Recorded, times: np.ndarray) -> np.ndarray:
    commands = recorded.commands
    newest = np.searchsorted(commands.times, times, side="right") - 1
    age = times - commands.times[np.maximum(newest, 0)]
    given = np.isfinite(commands.values[np.maximum(newest, 0), : PITCH + 1]).all(axis=1)
    return (newest >= 0) & (age < _GAP) & given
