# SPDX-License-Identifier: MIT
"""One source of positions: what of it is believed, and the motion that follows from it.

A sample far off the expected place is not believed. Samples that go on to agree with each other are
the new truth after ``jump_time``: the source's origin has moved, or it was wrong until now. One
that repeats itself to the last digit while the velocity leads away is frozen, and not believed
before it changes.
"""

import math
from collections import Counter
from typing import Dict, NamedTuple, Optional, Sequence

import numpy as np

from nmpc_control.motion_filter import Motion, MotionFilter
from nmpc_control.source_params import SourceParameters

COAST = 0.3  # [s] a velocity of the filter is carried on with its acceleration no longer than this
GAP = 1.0  # [s] after a longer silence nothing is expected any more
KNOWN = 0.2  # [m/s] standard deviation below which a velocity counts as known
STILL = np.zeros(3)
DRIFT_MEMORY = 5.0  # [s] in which a way of the velocity is forgotten: at rest it drifts, too


class _Doubt(NamedTuple):
    since: float  # [s]
    t: float  # [s]
    position: np.ndarray  # (3,) [m]


class PositionTrack:
    """Takes samples; ``at(t)`` tells the motion; stamps are those of the telemetry's time."""

    def __init__(self, parameters: SourceParameters) -> None:
        """Begin without samples."""
        self.parameters = parameters
        self.counts: Dict[str, int] = Counter()  # bad, late, frozen, outliers; jumps accepted
        self._filter: Optional[MotionFilter] = None
        if parameters.velocity == "filter":
            self._filter = MotionFilter(parameters.sigma, parameters.jerk)
        self.forget()

    @property
    def filters(self) -> bool:
        """Whether the velocity is that of the filter, not the telemetry's."""
        return self._filter is not None

    def forget(self) -> None:
        """Drop all samples, as after a jump of the clock; the counts remain."""
        self._t = -math.inf
        self._motion: Optional[Motion] = None
        self._doubt: Optional[_Doubt] = None
        self._told = (-math.inf, np.full(3, math.nan))  # [s], [m] newest, believed or not
        self._led = STILL  # [m] by the velocity since the samples differed last, on each axis
        self._frozen = np.zeros(3, dtype=bool)  # axes on which they must differ again

    def age(self, t: float) -> float:
        """Return the age [s] at ``t`` of the newest sample that was believed; inf without."""
        return max(0.0, t - self._t)

    def add(self, t: float, position: Sequence[float], velocity: Optional[np.ndarray]) -> bool:
        """Take a position (3,) [m] of time ``t`` [s]; False if it is not believed.

        Args:
            t: when the telemetry shows the aircraft there.
            position: in the world frame.
            velocity: (3,) [m/s] of the telemetry; None where it is not known.
        """
        place = np.array([float(value) for value in position])
        if place.shape != (3,) or not (math.isfinite(t) and np.all(np.isfinite(place))):
            self.counts["bad"] += 1
            return False
        if t <= self._t:
            self.counts["late"] += 1
            return False
        if self._is_frozen(t, place, velocity):
            self.counts["frozen"] += 1
            return False
        if self._motion is None or t - self._t > GAP:
            self._begin(t, place, velocity)
            return True
        expected = self._at(t)
        reach = self.parameters.gate + self.parameters.gate_speed * (t - self._t)
        if np.linalg.norm(place - expected.position) > reach:
            if not self._is_new_truth(t, place, expected.velocity):
                self.counts["outliers"] += 1
                return False
            self.counts["jumps"] += 1
            self._moved(t, place, expected, velocity)
            return True
        self._doubt = None
        self._follow(t, place, velocity)
        return True

    def at(self, t: float) -> Optional[Motion]:
        """Return the motion at ``t`` [s]; None while it is not known.

        The filter's velocity is carried on with its acceleration for a short while.
        """
        if self._motion is None or (self._filter and self._filter.speed_sigma > KNOWN):
            return None
        return self._at(t)

    def _at(self, t: float) -> Motion:
        since = t - self._t
        bent = min(since, COAST)
        motion = self._motion.after(bent)
        return motion._replace(position=motion.position + (since - bent) * motion.velocity)

    def _is_frozen(self, t: float, place: np.ndarray, velocity: Optional[np.ndarray]) -> bool:
        """Return whether a sample is the old one again though the aircraft has moved on.

        At rest the two agree again; what was frozen stays so until it changes.
        """
        (before, last), self._told = self._told, (t, place)
        differs = place != last
        if self._frozen.any():
            if not differs[self._frozen].all():
                return True
            self._frozen[:] = False
        fading = math.exp(-max(0.0, t - before) / DRIFT_MEMORY)
        way = STILL if velocity is None else DRIFT_MEMORY * (1.0 - fading) * velocity
        self._led = np.where(differs, 0.0, self._led * fading + way)
        if np.linalg.norm(self._led) <= self.parameters.still:
            return False
        self._frozen = np.abs(self._led) > self.parameters.still / 2.0
        return True

    def _begin(self, t: float, place: np.ndarray, velocity: Optional[np.ndarray]) -> None:
        self._doubt, self._t = None, t
        if self._filter:
            self._filter.begin(t, place)
            self._motion = self._filter.motion
        else:
            self._motion = Motion(place, STILL if velocity is None else velocity, STILL)

    def _follow(self, t: float, place: np.ndarray, velocity: Optional[np.ndarray]) -> None:
        self._t = t
        if self._filter:
            self._filter.update(t, place)
            self._motion = self._filter.motion
        else:
            speed = self._motion.velocity if velocity is None else velocity
            self._motion = Motion(place, speed, STILL)

    def _moved(
        self, t: float, place: np.ndarray, expected: Motion, velocity: Optional[np.ndarray]
    ) -> None:
        """Go on at a new place with the motion as it was."""
        self._doubt = None
        if self._filter:
            self._filter.move_to(self._filter.motion.position + place - expected.position)
        self._follow(t, place, velocity)

    def _is_new_truth(self, t: float, place: np.ndarray, velocity: np.ndarray) -> bool:
        doubt, p = self._doubt, self.parameters
        if doubt is not None and t - doubt.t <= p.jump_time:
            off = place - doubt.position - (t - doubt.t) * velocity
            if np.linalg.norm(off) <= p.gate + p.gate_speed * (t - doubt.t):
                self._doubt = _Doubt(doubt.since, t, place)
                return t - doubt.since >= p.jump_time
        self._doubt = _Doubt(t, t, place)
        return False
