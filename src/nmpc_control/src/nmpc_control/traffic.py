# SPDX-License-Identifier: MIT
"""Other vehicles as obstacles: where each said that it would be, with the time at which it said so.

One that falls silent is reported on with its last words, so that its radius grows and whoever reads
it reacts to its silence: it may hover in the way with a dead radio. Only an operator ends that.

A path is taken over gradually (``settling``): two that set out at each other and each answer the
other's last plan would else both step aside and both come back for ever.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Dict, List, Optional

import numpy as np

from nmpc_control.obstacle import Obstacle

SETTLING = 0.3  # [s] a few plans long
LATER = 0.3  # [s] by which odometry must be newer than a prediction to replace it


@dataclass(frozen=True)
class TrafficParameters:
    """What is assumed of other vehicles."""

    radius: float = field(metadata={"min": 1e-2})  # [m] of the hull
    growth: float = field(metadata={"min": 0.0})  # [m/s] of the radius with the age
    settling: float = field(default=SETTLING, metadata={"min": 0.0})  # [s] of the low-pass on paths


@dataclass(frozen=True)
class Course:
    """What a vehicle says of itself."""

    stamp: float  # [s] of the position
    position: np.ndarray  # (3,) [m]
    velocity: np.ndarray  # (3,) [m/s]
    path: Optional[np.ndarray] = None  # (M, 3) [m] at stamp + (i + 1) * path_dt
    path_dt: float = 0.0  # [s]


class Traffic:
    """Newest course of every other vehicle, in one frame."""

    def __init__(self, params: TrafficParameters) -> None:
        self.params = params
        self._predicted: Dict[str, Course] = {}
        self._measured: Dict[str, Course] = {}

    def predict(self, name: str, course: Course) -> None:
        """Take a vehicle's prediction; what its path changes by is believed within a few more."""
        self._predicted[name] = _settled(self._predicted.get(name), course, self.params.settling)

    def measure(self, name: str, course: Course) -> None:
        """Take a vehicle's odometry, which counts where its prediction has ended."""
        self._measured[name] = course

    def report(self) -> List[Obstacle]:
        """Return the vehicles as obstacles, each with the time of its own words, however old."""
        obstacles = []
        for name in sorted({*self._predicted, *self._measured}):
            course = self._newest(name)
            path, path_dt = course.path, course.path_dt
            if path is None and not course.velocity.any():
                path, path_dt = course.position[None], 1.0  # or it would count as a thing for ever
            obstacles.append(
                Obstacle(
                    id=name,
                    position=course.position,
                    size=np.array([self.params.radius]),
                    velocity=course.velocity,
                    stamp=course.stamp,
                    path=path,
                    path_dt=path_dt,
                    growth=self.params.growth,
                )
            )
        return obstacles

    def forget(self) -> None:
        """Forget all, as when told to, or after a jump of the clock; who speaks is known again."""
        self._predicted.clear()
        self._measured.clear()

    def _newest(self, name: str) -> Course:
        predicted, measured = self._predicted.get(name), self._measured.get(name)
        if predicted is None or measured is None:
            return predicted or measured
        return measured if measured.stamp - predicted.stamp > LATER else predicted


def _settled(last: Optional[Course], new: Course, settling: float) -> Course:
    """Return the new course with a path between the last one's and its own.

    At its beginning the path is the new one's: where the vehicle is now is not a matter of plans.
    """
    if last is None or last.path is None or new.path is None or not len(last.path):
        return new
    passed = new.stamp - last.stamp
    if not 0.0 <= passed <= LATER or last.path_dt <= 0.0 or new.path_dt <= 0.0:
        return new
    ahead = new.path_dt * np.arange(1, len(new.path) + 1)
    known = np.concatenate([[last.position], last.path])
    since = last.path_dt * np.arange(len(known))
    before = np.stack([np.interp(passed + ahead, since, known[:, i]) for i in range(3)], axis=1)
    kept = math.exp(-passed / settling) if settling > 0.0 else 0.0
    part = kept * np.minimum(1.0, ahead / LATER)[:, None]
    return replace(new, path=new.path + part * (before - new.path))
