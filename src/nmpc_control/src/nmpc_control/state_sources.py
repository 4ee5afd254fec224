# SPDX-License-Identifier: MIT
"""Feeds an estimator from one of several sources of position, and changes the source in flight.

Motion capture is stamped at capture, dji_sdk's telemetry on receipt, a latency later. All stamps
are brought to those of the telemetry: a position counts for the time at which attitude and velocity
show the aircraft there. After a change of source the difference between the two is added to the new
one and let go at a bounded rate, so that neither state nor plan check sees a jump.
"""

import math
from dataclasses import dataclass
from typing import Dict, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.estimator import Estimator
from nmpc_control.motion_filter import Motion
from nmpc_control.position_track import STILL, PositionTrack
from nmpc_control.rotations import rpy_from_quaternion, wrap_angle
from nmpc_control.source_params import VICON, SourcesParameters

QUATERNION_TOLERANCE = 0.05  # [1] deviation of the norm from 1


@dataclass(frozen=True)
class Switch:
    """A change of source: both nodes take the same one."""

    source: str
    t: float  # [s] when the difference begins to be let go
    offset: np.ndarray  # (3,) [m] added to the new source's position at first
    speed_offset: np.ndarray  # (3,) [m/s] the same of its velocity
    duration: float  # [s] in which both are let go


class StateSources:
    """Takes what all sources say; the estimator gets the state from the one flown on."""

    def __init__(self, parameters: SourcesParameters, estimator: Estimator) -> None:
        """Begin with the source that the parameters name."""
        self.parameters = parameters
        self.estimator = estimator
        self.tracks: Dict[str, PositionTrack] = {
            name: PositionTrack(parameters.of(name)) for name in parameters.heard
        }
        self._switch = _at_once(parameters.position_source, -math.inf)
        self._velocity: Optional[np.ndarray] = None
        self._velocity_t = -math.inf  # [s]
        self._yaw = (-math.inf, 0.0)  # [s], [rad] Vicon's less the telemetry's, smoothed

    @property
    def active(self) -> str:
        """Name of the source flown on."""
        return self._switch.source

    @property
    def last_switch(self) -> Switch:
        """The change of source that holds now; at first one without a difference."""
        return self._switch

    def forget(self, estimator: Optional[Estimator] = None) -> None:
        """Drop all samples, as after a jump of the clock; go on with another estimator if given."""
        self.estimator = estimator or self.estimator
        self.estimator.forget()
        for track in self.tracks.values():
            track.forget()
        self._switch = _at_once(self.active, -math.inf)
        self._velocity, self._velocity_t = None, -math.inf
        self._yaw = (-math.inf, 0.0)

    def add_velocity(self, t: float, velocity: Sequence[float]) -> bool:
        """Take the telemetry's velocity (3,) [m/s], world frame, of ``t`` [s]; False if refused."""
        values = np.array([float(value) for value in velocity])
        if values.shape != (3,) or not np.all(np.isfinite((t, *values))):
            self.estimator.rejected["velocity"] += 1
            return False
        if t > self._velocity_t:
            self._velocity, self._velocity_t = values, t
        if self.tracks[self.active].filters:
            return True
        return self.estimator.add_velocity(t, values + self._let_go(t)[1])

    def add_position(self, name: str, t: float, position: Sequence[float]) -> bool:
        """Take a position (3,) [m], world frame, stamped ``t`` [s] by a source.

        False where it is not believed, or nobody listens to that source.
        """
        track = self.tracks.get(name)
        if track is None:
            return False
        t += self.parameters.telemetry_latency - self.parameters.of(name).latency
        is_recent = t - self._velocity_t <= self.parameters.alive_time
        if not track.add(t, position, self._velocity if is_recent else None):
            return False
        if name == self.active:
            self._tell(t, track)
        return True

    def add_pose(self, t: float, position: Sequence[float], quaternion: Sequence[float]) -> bool:
        """Take a pose of Vicon: position as above, orientation (x, y, z, w), body FLU to world."""
        track = self.tracks.get(VICON)
        norm = math.sqrt(sum(q * q for q in quaternion)) if len(quaternion) == 4 else math.nan
        if track is not None and not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
            track.counts["bad"] += 1
            return False
        if not self.add_position(VICON, t, position):
            return False
        shown = t + self.parameters.telemetry_latency - self.parameters.vicon.latency
        self._compare_yaw(shown, rpy_from_quaternion([q / norm for q in quaternion])[2])
        return True

    def yaw_disagreement(self, t: float) -> Optional[float]:
        """Return Vicon's yaw less the telemetry's [rad], smoothed; None while one is not heard."""
        since, off = self._yaw
        return off if t - since <= self.parameters.alive_time else None

    def is_alive(self, name: str, t: float) -> bool:
        """Return whether a source is heard at ``t`` [s] and its motion known."""
        track = self.tracks.get(name)
        if track is None or track.age(t) > self.parameters.alive_time:
            return False
        has_velocity = t - self._velocity_t <= self.parameters.alive_time
        return track.at(t) is not None and (track.filters or has_velocity)

    def select(self, name: str, t: float, in_flight: bool = True) -> Tuple[bool, str]:
        """Change the source at ``t`` [s]; returns whether that was done, and a sentence.

        In flight both sources must be alive and agree, and their difference is let go slowly; on
        the ground the new one is taken as it is.
        """
        p = self.parameters.switching
        if name not in self.tracks:
            heard = ", ".join(self.tracks)
            return False, f"{name!r} is not listened to, only {heard}"
        if name == self.active:
            return False, f"{name} is the source already"
        if not in_flight:
            self.follow(_at_once(name, t))
            return True, f"position comes from {name}"
        for source in (name, self.active):
            if not self.is_alive(source, t):
                return False, f"{source} is {self._silence(source, t)}: the two cannot be compared"
        old, new = self._flown(t), self.tracks[name].at(t)
        offset, speed_offset = old.position - new.position, old.velocity - new.velocity
        distance, speed = np.linalg.norm(offset), np.linalg.norm(speed_offset)
        if distance > p.max_distance:
            bound = f"at most {p.max_distance:g} m are let go in flight"
            return False, f"{name} is {distance:.2f} m from {self.active}, {bound}"
        if speed > p.max_speed:
            bound = f"at most {p.max_speed:g} m/s"
            return False, f"{name} and {self.active} differ by {speed:.2f} m/s, {bound}"
        duration = max(p.blend_time, distance / p.blend_speed)
        begin = t + self.parameters.telemetry_latency  # no sample has been told of a later time
        self.follow(Switch(name, begin, offset, speed_offset, duration))
        return True, f"position comes from {name}; {distance:.2f} m let go in {duration:.1f} s"

    def follow(self, switch: Switch) -> None:
        """Take a change of source that was decided, here or in the other node."""
        if switch.source not in self.tracks:
            return
        self._switch = switch
        track = self.tracks[switch.source]
        if math.isfinite(track.age(switch.t)):
            self._tell(switch.t - track.age(switch.t), track)

    def refused(self) -> Dict[str, int]:
        """Return how many samples of which kind were not believed, and jumps that were."""
        return {
            f"{name} {kind}": count
            for name, track in self.tracks.items()
            for kind, count in sorted(track.counts.items())
        }

    def _flown(self, t: float) -> Motion:
        """Return the motion at ``t`` [s] that the estimator is told now, with its velocity."""
        track, (offset, speed_offset) = self.tracks[self.active], self._let_go(t)
        motion = track.at(t)
        return Motion(motion.position + offset, motion.velocity + speed_offset, motion.acceleration)

    def _tell(self, t: float, track: PositionTrack) -> None:
        motion, (offset, speed_offset) = track.at(t), self._let_go(t)
        if motion is None:
            return
        place = motion.position + offset
        if not track.filters:
            self.estimator.add_position(t, place)
            return
        self.estimator.add_motion(t, place, motion.velocity + speed_offset, motion.acceleration)

    def _let_go(self, t: float) -> Tuple[np.ndarray, np.ndarray]:
        """Return what is still added to position [m] and velocity [m/s] at ``t`` [s]."""
        switch = self._switch
        if t - switch.t >= switch.duration:
            return STILL, STILL
        left = 1.0 - max(0.0, t - switch.t) / switch.duration
        return left * switch.offset, left * switch.speed_offset

    def _silence(self, name: str, t: float) -> str:
        age = self.tracks[name].age(t)
        if math.isinf(age):
            return "missing"
        if age > self.parameters.alive_time:
            return f"{age:.2f} s old"
        return "without a known velocity"

    def _compare_yaw(self, t: float, yaw: float) -> None:
        attitude, (since, smooth) = self.estimator.attitude_at(t), self._yaw
        if attitude is None or self.estimator.age("attitude", t) > self.parameters.alive_time:
            return
        off = wrap_angle(yaw - attitude[2])
        if t - since > self.parameters.alive_time:
            self._yaw = (t, off)
            return
        share = 1.0 - math.exp(-(t - since) / self.parameters.yaw_time)
        self._yaw = (t, wrap_angle(smooth + share * wrap_angle(off - smooth)))


def _at_once(source: str, t: float) -> Switch:
    return Switch(source, t, STILL, STILL, 0.0)
