# SPDX-License-Identifier: MIT
"""Stretches of flight prepared for simulation: held commands in, measured samples to compare."""

from dataclasses import dataclass, replace
from typing import List, NamedTuple, Sequence

import numpy as np

from nmpc_control.analysis.identification.log import Log
from nmpc_control.analysis.identification.response import (
    GRID,
    LONGEST_DEAD_TIME,
    Order,
    held_mean,
    respond,
)

SETTLING = 1.5  # [s] after which the state at the start of a stretch is forgotten


class Stretch(NamedTuple):
    """A part of a log, without gaps, in which the same commander was obeyed."""

    log: Log
    start: float  # [s]
    end: float  # [s]


@dataclass(frozen=True)
class Passage:
    """One stretch: what was commanded on a grid, and what is compared with it."""

    grid: np.ndarray  # (m + 1,) [s]
    command_times: np.ndarray  # (c,) [s]
    commands: np.ndarray  # (c, k) one column for each axis
    times: np.ndarray  # (n,) [s] of the samples that count
    values: np.ndarray  # (n, k) measured; means over ``window`` before the time where that is not 0
    number: int  # of the passage: keeps blocks of different passages apart
    window: float = 0.0  # [s]

    def only(self, chosen: np.ndarray) -> "Passage":
        """Return the passage with some of its samples (n,) counting."""
        return replace(self, times=self.times[chosen], values=self.values[chosen])

    def inputs(self, limit: float = np.inf) -> np.ndarray:
        """Return the inputs (m, k) on the grid, the norm of the axes limited."""
        commands = self.commands
        if np.isfinite(limit):
            norm = np.linalg.norm(commands, axis=1, keepdims=True)
            commands = commands * np.minimum(1.0, limit / np.maximum(norm, 1e-12))
        return held_mean(self.command_times, commands, self.grid)

    def outputs(self, order: Order, shape: Sequence[float], u: np.ndarray) -> np.ndarray:
        """Return what ``sample`` reads: the response of unit gain to u (m,), or its integral."""
        x = respond(order, shape, u)
        if not self.window:
            return x
        return np.concatenate([[0.0], np.cumsum(0.5 * GRID * (x[1:] + x[:-1]))])

    def sample(self, x: np.ndarray, dead_time: float) -> np.ndarray:
        """Return outputs (m + 1,) at the samples' times (n,), a dead time [s] later."""
        late = self.times - dead_time
        now = np.interp(late, self.grid, x)
        if not self.window:
            return now
        return (now - np.interp(late - self.window, self.grid, x)) / self.window

    def blocks(self, length: float) -> np.ndarray:
        """Return the number (n,) of the block of a length [s] that each sample is in."""
        return self.number * 10**6 + (self.times / length).astype(int)


def attitude_passages(
    stretches: Sequence[Stretch], start: float = -np.inf, end: float = np.inf
) -> List[Passage]:
    """Return roll and pitch commands and responses; samples outside of [start, end] [s] not."""
    return _passages(stretches, slice(1, 3), slice(0, 2), 0.0, start, end)


def yaw_passages(
    stretches: Sequence[Stretch], window: float, start: float = -np.inf, end: float = np.inf
) -> List[Passage]:
    """Return yaw rate commands and the mean rates of turn over a window [s] that followed."""
    return _passages(stretches, slice(3, 4), slice(2, 3), window, start, end)


def _passages(
    stretches: Sequence[Stretch],
    command: slice,
    angle: slice,
    window: float,
    start: float,
    end: float,
) -> List[Passage]:
    found = []
    for number, (log, begin, finish) in enumerate(stretches):
        attitude = log.attitude
        first, last = max(begin + SETTLING, start), min(finish, end)
        counts = (attitude.times >= first) & (attitude.times <= last)
        if not counts.any():
            continue
        times, values = attitude.times[counts], attitude.values[counts, angle]
        if window:
            before = np.interp(times - window, attitude.times, attitude.values[:, angle].ravel())
            values = (values - before[:, None]) / window
        origin = max(begin, first - SETTLING) - LONGEST_DEAD_TIME
        grid = origin + GRID * np.arange(int(np.ceil((last - origin) / GRID)) + 1)
        sent, commands = log.commands.times, log.commands.values[:, command]
        is_given = np.isfinite(commands).all(axis=1)
        if not is_given[(sent >= begin) & (sent <= last)].all():
            continue  # part of it commands something else: an angle of yaw, say
        sent, commands = sent[is_given], commands[is_given]
        near = slice(max(0, np.searchsorted(sent, grid[0]) - 1), np.searchsorted(sent, last) + 1)
        sent, commands = sent[near], commands[near]
        if not len(sent):
            continue
        if sent[0] > grid[0]:  # what was commanded before the stream began is not known
            sent = np.concatenate([[grid[0]], sent[1:]])
        found.append(Passage(grid, sent, commands, times, values, number, window))
    return found
