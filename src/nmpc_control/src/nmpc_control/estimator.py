# SPDX-License-Identifier: MIT
"""State at one time from telemetry of different times; bad samples are refused and counted."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Dict, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.rotations import nearest_angle, rpy_from_quaternion
from nmpc_control.state import NX, POSITION, VELOCITY, YAW_RATE

MAX_EXTRAPOLATION = 0.5  # [s] samples are brought forward no farther; their age tells the rest
MAX_BEND = 0.2  # [s] the same with an acceleration: longest drop-out of motion capture
QUATERNION_TOLERANCE = 0.05  # [1] deviation of the norm from 1
MIN_COS_PITCH = 0.05  # [1] keeps the Euler rates finite at +-90 degrees of pitch

Sample = Tuple[float, Tuple[float, ...]]
_STRAIGHT: Sample = (-math.inf, (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class StateEstimate:
    """The state (10,) at time ``t`` [s], and how old each of its sources is."""

    t: float  # [s]
    vector: np.ndarray  # (10,) order of state.py; yaw is continuous
    position_age: float  # [s]
    velocity_age: float  # [s]
    attitude_age: float  # [s] of the older of quaternion and body rates

    @property
    def age(self) -> float:
        """Age [s] of the oldest source."""
        return max(self.position_age, self.velocity_age, self.attitude_age)


class Estimator:
    """The newest sample of each source, brought to one time; exact for constant velocity."""

    def __init__(self) -> None:
        """Begin without samples."""
        self.rejected: Dict[str, int] = Counter()  # samples refused per source
        self._yaw = 0.0
        self._samples: Dict[str, Sample] = {}
        self._bend = _STRAIGHT  # acceleration that came with a velocity of the same stamp

    def add_attitude(self, t: float, quaternion: Sequence[float]) -> bool:
        """Take a quaternion (x, y, z, w), body FLU to world ENU, of ``t`` [s]; False if refused."""
        norm = math.sqrt(sum(q * q for q in quaternion)) if len(quaternion) == 4 else math.nan
        if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
            self.rejected["attitude"] += 1
            return False
        roll, pitch, yaw = rpy_from_quaternion([q / norm for q in quaternion])
        yaw = nearest_angle(yaw, self._yaw)
        if not self._add("attitude", t, (roll, pitch, yaw)):
            return False
        self._yaw = yaw
        return True

    def add_imu(self, t: float, angular_velocity: Sequence[float]) -> bool:
        """Take body rates (3,) [rad/s] about FLU axes of time ``t`` [s]; False if refused."""
        return self._add("imu", t, angular_velocity)

    def add_velocity(self, t: float, velocity: Sequence[float]) -> bool:
        """Take a velocity (3,) [m/s] in the world frame of time ``t`` [s]; False if refused."""
        return self._add("velocity", t, velocity)

    def add_position(self, t: float, position: Sequence[float]) -> bool:
        """Take a position (3,) [m] in the world frame of time ``t`` [s]; False if refused."""
        return self._add("position", t, position)

    def add_motion(
        self,
        t: float,
        position: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
    ) -> bool:
        """Take position (3,) [m], velocity (3,) [m/s] and how it changes (3,) [m/s^2] at once.

        They replace those of ``add_position`` and ``add_velocity``; False if refused.
        """
        values = (position, velocity, acceleration)
        if not all(len(v) == 3 and all(map(math.isfinite, v)) for v in values):
            self.rejected["position"] += 1
            return False
        taken = self._add("position", t, position) and self._add("velocity", t, velocity)
        if taken:
            self._bend = (t, tuple(map(float, acceleration)))
        return taken

    def attitude_at(self, t: float) -> Optional[Tuple[float, float, float]]:
        """Return roll, pitch, yaw [rad] at ``t`` [s], or None before attitude and body rates."""
        if "attitude" not in self._samples or "imu" not in self._samples:
            return None
        t_attitude, (roll, pitch, yaw) = self._samples["attitude"]
        rates = _euler_rates(roll, pitch, self._samples["imu"][1])
        since = _extrapolation(t - t_attitude)
        return roll + since * rates[0], pitch + since * rates[1], yaw + since * rates[2]

    def age(self, source: str, t: float) -> float:
        """Return the age [s] at ``t`` of attitude, imu, velocity or position; inf if none."""
        return max(0.0, t - self._samples[source][0]) if source in self._samples else math.inf

    def forget(self) -> None:
        """Drop all samples, as after a jump of the clock; the counts and the yaw's turn remain."""
        self._samples.clear()
        self._bend = _STRAIGHT

    def estimate(self, t: float) -> Optional[StateEstimate]:
        """Return the state at time ``t`` [s], or None while a source has never been heard."""
        if len(self._samples) < 4:
            return None
        t_position, position = self._samples["position"]
        t_velocity, velocity = self._samples["velocity"]
        t_bend, acceleration = self._bend
        _, rates = self._samples["imu"]
        roll, pitch, yaw = self.attitude_at(t)
        since = _extrapolation(t - t_position)

        x = np.empty(NX)
        x[POSITION] = [p + since * v for p, v in zip(position, velocity)]
        x[3:6] = roll, pitch, yaw
        x[VELOCITY] = velocity
        if t_bend == t_velocity == t_position:
            bent = min(max(since, -MAX_BEND), MAX_BEND)
            share = bent * (since - 0.5 * bent)  # the velocity stays once it is bent no more
            x[POSITION] += [share * a for a in acceleration]
            x[VELOCITY] += [bent * a for a in acceleration]
        x[YAW_RATE] = _euler_rates(roll, pitch, rates)[2]
        attitude_age = max(self.age("attitude", t), self.age("imu", t))
        return StateEstimate(t, x, self.age("position", t), self.age("velocity", t), attitude_age)

    def _add(self, source: str, t: float, values: Sequence[float]) -> bool:
        values = tuple(float(value) for value in values)
        if len(values) != 3 or not all(map(math.isfinite, (t, *values))):
            self.rejected[source] += 1
            return False
        if source in self._samples and t <= self._samples[source][0]:
            return False
        self._samples[source] = (t, values)
        return True


def _extrapolation(since: float) -> float:
    return min(max(since, -MAX_EXTRAPOLATION), MAX_EXTRAPOLATION)


def _euler_rates(roll: float, pitch: float, rates: Sequence[float]) -> Tuple[float, float, float]:
    p, q, r = rates
    cos_pitch = math.copysign(max(abs(math.cos(pitch)), MIN_COS_PITCH), math.cos(pitch))
    yaw_rate = (q * math.sin(roll) + r * math.cos(roll)) / cos_pitch
    return p + yaw_rate * math.sin(pitch), q * math.cos(roll) - r * math.sin(roll), yaw_rate
