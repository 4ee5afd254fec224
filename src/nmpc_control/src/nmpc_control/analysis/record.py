# SPDX-License-Identifier: MIT
"""What is known of one flight, as plain arrays: a bag or a simulation fills it, metrics read it."""

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional, Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle

# Columns of FlightRecord.solver and of FlightRecord.status; those of commands are in state.py.
ITERATIONS, SOLVE_TIME, FOUND = 0, 1, 2
MODE, PLANS_REJECTED, DEADLINE_MISSES, RUNG, AUTHORITY = range(5)  # the last two may be absent

Metrics = Dict[str, Any]  # figures by name; names end in their unit


@dataclass(frozen=True)
class Series:
    """Samples over time, sorted; times may repeat."""

    times: np.ndarray  # (n,) [s]
    values: np.ndarray  # (n,) or (n, k)

    def __post_init__(self) -> None:
        times = np.array(self.times, dtype=float)
        values = np.array(self.values, dtype=float)
        if times.ndim != 1 or values.ndim not in (1, 2) or len(times) != len(values):
            raise ValueError(f"{len(values)} values of {values.ndim} axes for {len(times)} times")
        order = np.argsort(times, kind="stable")
        object.__setattr__(self, "times", times[order])
        object.__setattr__(self, "values", values[order])

    def __len__(self) -> int:
        return len(self.times)

    def between(self, start: float, end: float) -> "Series":
        """Return the samples with start <= time <= end [s]."""
        inside = (self.times >= start) & (self.times <= end)
        return Series(self.times[inside], self.values[inside])

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at times (m,) [s], linear between samples, held outside of them."""
        if self.values.ndim == 1:
            return np.interp(times, self.times, self.values)
        columns = [np.interp(times, self.times, column) for column in self.values.T]
        return np.stack(columns, axis=-1)

    def held_at(self, times: np.ndarray) -> np.ndarray:
        """Return the values at times (m,) [s] of the newest sample, of the first one before it."""
        newest = np.searchsorted(self.times, times, side="right") - 1
        return self.values[np.maximum(newest, 0)]


@dataclass(frozen=True)
class Reference:
    """The scenario's own reference, densely sampled, and when its clock started."""

    start: float  # [s] time of the first motion
    path: Series  # times (m,) [s] from the start, positions (m, 3) [m]

    @property
    def duration(self) -> float:
        """Duration [s] of the reference."""
        return float(self.path.times[-1])

    @property
    def length(self) -> float:
        """Length [m] of the reference."""
        return float(np.linalg.norm(np.diff(self.path.values, axis=0), axis=1).sum())

    def position_at(self, times: np.ndarray) -> np.ndarray:
        """Return the positions (m, 3) [m] at times (m,) [s] of the flight's clock."""
        return self.path.at(times - self.start)


@dataclass(frozen=True)
class ObstacleTrack:
    """An obstacle that was observed more than once, or not all the time."""

    obstacle: Obstacle
    centres: Optional[Series] = None  # observed positions (k, 3) [m]; None: the obstacle's own
    begin: float = -np.inf  # [s] it is not there before
    end: float = np.inf  # [s] nor after
    first_velocity: Optional[np.ndarray] = None  # (3,) [m/s] when first observed; None: as later

    @property
    def observed(self) -> Optional[np.ndarray]:
        """Times [s] at which a moving obstacle was observed; None of one that stands still."""
        if self.centres is not None:
            return self.centres.times
        return None if self.obstacle.stamp is None else np.array([self.obstacle.stamp])

    def centre_at(self, times: np.ndarray) -> np.ndarray:
        """Return the centres (m, 3) [m] at times (m,) [s].

        Before the first and after the last observation an obstacle moves at the velocity it had.
        """
        if self.centres is not None:
            times, velocity = np.asarray(times, dtype=float), self.obstacle.velocity
            first = velocity if self.first_velocity is None else self.first_velocity
            early = np.minimum(times - self.centres.times[0], 0.0)[:, None]
            late = np.maximum(times - self.centres.times[-1], 0.0)[:, None]
            return self.centres.at(times) + early * first + late * velocity
        if self.obstacle.stamp is None:
            return np.tile(np.asarray(self.obstacle.position, dtype=float), (len(times), 1))
        age = np.asarray(times)[:, None] - self.obstacle.stamp
        return self.obstacle.position + age * self.obstacle.velocity


@dataclass(frozen=True)
class FlightRecord:
    """One flight; every part may be missing (None). One clock; positions in the world frame."""

    bag: Optional[str] = None  # name of the file
    flight: Tuple[int, int] = (1, 1)  # which flight of how many in the bag, counted from 1
    scenario: Optional[str] = None
    source: Optional[str] = None  # "simulation", "hil" or "flight"
    position: Optional[Series] = None  # (n, 3) [m] estimate that the controller used
    velocity: Optional[Series] = None  # (n, 3) [m/s] estimate or telemetry
    attitude: Optional[Series] = None  # (n, 3) [rad] roll, pitch, yaw
    true_position: Optional[Series] = None  # (n, 3) [m]
    reference: Optional[Reference] = None
    tracked_reference: Optional[Series] = None  # (n, 3) [m] what the controller compared with
    obstacles: Optional[Tuple[ObstacleTrack, ...]] = None  # empty: known that there are none
    commands: Optional[Series] = (
        None  # (n, 4) thrust [percent], roll, pitch [rad], yaw rate [rad/s]; NaN: not given
    )
    solver: Optional[Series] = None  # (n, 3) iterations, solve time [s], found
    status: Optional[Series] = (
        None  # (n, 3 or 5) mode, plans rejected, deadline misses, rung, authority
    )
    rc: Optional[Series] = None  # (n, 6) sticks, mode switch, landing gear switch as dji_sdk sends
    battery: Optional[Series] = None  # (n, 1) charge [percent]
    stamps: Mapping[str, np.ndarray] = field(default_factory=dict)  # [s] of each topic's messages
    goals: Tuple[Tuple[str, float, float], ...] = ()  # scenario, start, end [s] of each action goal
    log: Tuple[Tuple[float, int, str, str], ...] = ()  # [s], level, node, text
    parameters: Optional[str] = None  # of the controller, as it published them
    start_time: float = 0.0  # [s] what the clock of the record counts from
    airborne: Optional[Tuple[float, float]] = None  # [s] first and last moment in the air
    automatic: Optional[Tuple[float, float]] = None  # [s] from take-off to landing, of this flight
    phase_end: Optional[float] = None  # [s] the trajectory's phase ended; None: with the data
    between: Optional[Tuple[float, float]] = None  # [s] evaluate this; None: the scenario's phase
    reported_collisions: Optional[int] = None  # counted by the simulator
    missing: Tuple[str, ...] = ()  # plain sentences: what could not be read, and why
