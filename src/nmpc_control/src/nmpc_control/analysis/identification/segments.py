# SPDX-License-Identifier: MIT
"""Who was flying when: parts of a log by kind, from what the log itself says."""

from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from nmpc_control.analysis.identification.log import SHORTEST, SILENCE, Log
from nmpc_control.analysis.identification.passages import Stretch
from nmpc_control.analysis.record import MODE
from nmpc_control.dji import RC_SWITCH_TOLERANCE, FlightStatus
from nmpc_control.mode_inputs import STREAMING

FLIGHT, LIMITED = "flight", "limited"  # obeyed; obeyed with much less tilt than commanded
KINDS: Dict[str, str] = {
    FLIGHT: "in the air, following the commands",
    LIMITED: "in the air, following a small part of the commanded tilt",
    "not_following": "in the air, attitude does not follow the commands",
    "ground": "on the ground",
    "take_off": "the flight controller takes off by itself",
    "landing": "the flight controller lands by itself",
    "manual": "somebody or something else was flying",
    "no_command": "no attitude command, or its stream is interrupted",
    "impact": "velocity jumps: contact with the ground or a sensor that jumps",
    "short": f"between such events, shorter than {SHORTEST:g} s",
}
RC_MODE_F = 8000.0  # raw; only there an M100 obeys its SDK
_MODE_AXIS = 4
_MOVING = 0.2  # [m/s] in the air where nothing else tells
_JUMP = (1.0, 40.0)  # [m/s] and [m/s^2] between two samples: beyond what an M100 can do
_AROUND_IMPACT = 0.3  # [s]


class Segment(NamedTuple):
    """A part of a bag."""

    bag: str
    start: float  # [s] since the bag's first message
    end: float  # [s]
    kind: str  # of KINDS


def labels(log: Log) -> np.ndarray:
    """Return the kind (n,) of each sample of the attitude, as far as response is not needed."""
    times = log.attitude.times
    kinds = np.full(len(times), FLIGHT, dtype=object)
    _mark_impacts(log, times, kinds)
    newest = np.searchsorted(log.commands.times, times, side="right") - 1
    age = np.where(newest >= 0, times - log.commands.times[np.maximum(newest, 0)], np.inf)
    commands = log.commands.values[np.maximum(newest, 0), 1:3]
    kinds[(age > SILENCE) | ~np.isfinite(commands).all(axis=1)] = "no_command"
    if log.rc is not None:
        mode = log.rc.held_at(times)[:, _MODE_AXIS]
        kinds[np.abs(mode - RC_MODE_F) > RC_SWITCH_TOLERANCE] = "manual"
    if log.status is not None:
        is_ours = np.isin(log.status.held_at(times)[:, MODE], STREAMING)
        kinds[~is_ours & (kinds == FLIGHT)] = "manual"
    _mark_ground(log, times, kinds)
    return kinds


def _mark_impacts(log: Log, times: np.ndarray, kinds: np.ndarray) -> None:
    if log.velocity is None or len(log.velocity) < 2:
        return
    step = np.linalg.norm(np.diff(log.velocity.values, axis=0), axis=1)
    duration = np.maximum(np.diff(log.velocity.times), 1e-3)
    is_jump = (step > _JUMP[0]) & (step / duration > _JUMP[1])
    for t in log.velocity.times[1:][is_jump]:
        kinds[np.abs(times - t) < _AROUND_IMPACT] = "impact"


def _mark_ground(log: Log, times: np.ndarray, kinds: np.ndarray) -> None:
    if log.flight_status is not None:
        status = log.flight_status.held_at(times)[:, 0]
        kinds[status == FlightStatus.TAKING_OFF] = "take_off"
        kinds[status == FlightStatus.LANDING] = "landing"
        aloft = (FlightStatus.TAKING_OFF, FlightStatus.IN_AIR, FlightStatus.LANDING)
        kinds[~np.isin(status, aloft)] = "ground"
    elif log.velocity is not None:
        speed = np.linalg.norm(log.velocity.values, axis=1)
        moving = log.velocity.times[speed > _MOVING]
        if len(moving):
            kinds[(times < moving[0]) | (times > moving[-1])] = "ground"
        else:
            kinds[:] = "ground"


def runs(times: np.ndarray, kinds: np.ndarray) -> List[slice]:
    """Return the runs of samples of one kind, ended by gaps in time too."""
    changes = (kinds[1:] != kinds[:-1]) | (np.diff(times) > SILENCE)
    edges = [0, *(np.flatnonzero(changes) + 1), len(times)]
    return [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:])]


def mark_short(times: np.ndarray, kinds: np.ndarray, among: Sequence[str]) -> None:
    """Mark runs of some kinds that are too short to simulate."""
    for run in runs(times, kinds):
        if kinds[run.start] in among and times[run.stop - 1] - times[run.start] < SHORTEST:
            kinds[run] = "short"


def segments(log: Log, kinds: np.ndarray) -> List[Segment]:
    """Return the log's parts by kind."""
    times = log.attitude.times
    return [
        Segment(log.bag, float(times[run.start]), float(times[run.stop - 1]), kinds[run.start])
        for run in runs(times, kinds)
    ]


def stretches(log: Log, kinds: np.ndarray, kind: str) -> List[Stretch]:
    """Return the stretches of one kind that can be simulated."""
    parts = [s for s in segments(log, kinds) if s.kind == kind and s.end - s.start >= SHORTEST]
    return [Stretch(log, s.start, s.end) for s in parts]
