# SPDX-License-Identifier: MIT
"""Scans in, tracked cylinders out."""

import math
from collections import Counter
from dataclasses import replace
from typing import Dict, Iterable, List, Tuple

import numpy as np

from nmpc_control.laser_tracking.association import assign
from nmpc_control.laser_tracking.clusters import clusters
from nmpc_control.laser_tracking.detection import Detection, detect
from nmpc_control.laser_tracking.parameters import LaserTrackerParameters
from nmpc_control.laser_tracking.poses import PoseHistory
from nmpc_control.laser_tracking.scan import Beam, Scan, ScanError, require_usable
from nmpc_control.laser_tracking.track import Track
from nmpc_control.laser_tracking.view import View, look
from nmpc_control.obstacle import Obstacle

RESTART = 1.0  # [s] back or ahead: another clock or another time, nothing known holds
AHEAD = 0.05  # [s] by which a scan may be from the future
_BEHIND = 0.3  # [m] past the centre that beams have to get to count as having gone through
_ABOVE = 0.2  # [m] outside the heights at which it was seen, in which it would still be seen
_WALL_APART = 0.4  # [m] nearer than this two pieces of wall are one


class LaserTracker:
    """Everything that is known of the surroundings; one call of ``update`` for each scan."""

    def __init__(self, parameters: LaserTrackerParameters) -> None:
        self.parameters = parameters
        self.counts: Dict[str, int] = Counter()  # scans taken, and scans refused by kind
        self.t = -math.inf  # [s] of the newest scan
        self._tracks: List[Track] = []
        self._shift = np.zeros(3)  # [m] from where tracks are to where they are told to be
        self._named = 0

    def forget(self) -> None:
        """Drop all tracks, as after a jump of the clock; names are not used again."""
        self._tracks, self.t = [], -math.inf

    def update(self, scan: Scan, poses: PoseHistory, now: float = math.inf) -> None:
        """Take a scan.

        Args:
            scan: as it came.
            poses: of the aircraft, up to the time of the scan.
            now: [s] a scan from later is refused.

        Raises:
            ScanError: it cannot be used; it is counted, and tracks stay as they were.
        """
        try:
            if scan.t > now + AHEAD:
                raise ScanError("stamp", f"scan from {scan.t - now:.2f} s in the future")
            self._update(scan, poses)
        except ScanError as error:
            self.counts[error.kind] += 1
            raise

    @property
    def confirmed(self) -> Tuple[Track, ...]:
        """The tracks that have a name."""
        return tuple(track for track in self._tracks if track.number is not None)

    def obstacles(self) -> Tuple[Obstacle, ...]:
        """Return the confirmed tracks as vertical cylinders at the time of the newest scan."""
        ground = self.parameters.echoes.ground_height
        found = []
        for track in self.confirmed:
            top = track.heights[1] + self.parameters.shapes.headroom
            bottom = min(ground, track.heights[0])
            found.append(
                Obstacle(
                    id=f"laser_{track.number}",
                    position=np.array([*track.x[:2], 0.5 * (top + bottom)]) + self._shift,
                    size=np.array([track.reported_radius, top - bottom]),
                    shape="cylinder",
                    velocity=np.array([*track.reported_velocity, 0.0]),
                    stamp=track.t,
                    growth=track.growth,
                )
            )
        return tuple(found)

    def _update(self, scan: Scan, poses: PoseHistory) -> None:
        require_usable(scan, self.parameters.echoes)
        if abs(scan.t - self.t) > RESTART:
            self.forget()
        if scan.t <= self.t:
            raise ScanError("stamp", f"scan {1e3 * (self.t - scan.t):.0f} ms older than the last")
        known = poses.at(scan.times)
        if known is None:
            raise ScanError("pose", "scan refused: where the aircraft was is not known")
        dt = scan.t - self.t if self._tracks else 0.0
        self.t, self._shift = scan.t, poses.shift
        view = look(scan, known, self.parameters)
        found = self._detect(view)
        for track in self._tracks:
            track.predict(scan.t)
        pairs = assign(self._tracks, found, self.parameters.tracks)
        for j, i in pairs.items():
            self._tracks[i].update(self._refined(view, found[j], self._tracks[i]), dt)
        seen = set(pairs.values())
        for i, track in enumerate(self._tracks):
            if i not in seen:
                track.miss(dt, self._is_clear(view, track))
        self._bury()
        self._bear(found[j] for j in range(len(found)) if j not in pairs)
        self.counts["scans"] += 1

    def _detect(self, view: View) -> List[Detection]:
        shapes = self.parameters.shapes
        parts = clusters(view, shapes)
        parts.sort(key=lambda part: float(view.reach[part].min()))
        prior = (shapes.radius, shapes.radius_sigma)
        found: List[Detection] = []
        for part in parts:
            if len(found) >= shapes.max_detections:
                break
            found += detect(view, part, prior, self.parameters)
        return found[: shapes.max_detections]

    def _refined(self, view: View, found: Detection, track: Track) -> Detection:
        """Return a partly hidden cylinder fitted again with the radius that its track knows."""
        sigma = math.sqrt(track.radius_variance)
        if (
            found.beams is None
            or track.is_wall
            or sigma > 0.5 * self.parameters.shapes.radius_sigma
        ):
            return found
        prior = (track.radius, max(sigma, 0.02))
        again = detect(view, found.beams, prior, self.parameters)
        if len(again) != 1 or again[0].is_wall:
            return found
        return replace(again[0], radius=track.radius)  # its radius is no second evidence

    def _is_clear(self, view: View, track: Track) -> bool:
        """Return whether most beams at a track went on behind it: it is not there any more."""
        offset = track.x[:2] - view.origins[0, :2]
        distance = max(float(np.hypot(*offset)), 1e-3)
        half = math.asin(min(0.9, 0.7 * track.radius / distance))
        aside = np.abs(np.remainder(view.bearings - math.atan2(*offset[::-1]) + np.pi, 2 * np.pi))
        near = np.abs(aside - np.pi) <= max(half, view.increment)
        if not near.any():
            return False
        z = view.origins[near, 2] + distance * view.slopes[near]
        low, high = track.heights
        would_meet = (z > low - _ABOVE) & (z < high + _ABOVE)
        through = (view.reach[near] > distance + _BEHIND) & (view.kinds[near] != Beam.UNKNOWN)
        return bool(np.mean(through & would_meet) > 0.5)

    def _bury(self) -> None:
        """Drop tracks that are over, and those that have become a second one of another."""
        alive = [track for track in self._tracks if not track.is_over]
        fresh = [track for track in alive if track.hit_time == track.t]
        self._tracks = [
            track
            for track in alive
            if track.hit_time == track.t
            or track.number is None
            or track.t - track.hit_time < self.parameters.tracks.missed_time
            or not any(_is_same(other, track.x[:2], track.is_wall) for other in fresh)
        ]

    def _bear(self, found: Iterable[Detection]) -> None:
        """Begin tracks of what is new, and give names to those that have lasted."""
        p = self.parameters.tracks
        known = [track for track in self._tracks if track.number is not None]
        for detection in found:
            if len(self._tracks) >= p.max_tracks:
                break
            if not any(_is_same(track, detection.centre, detection.is_wall) for track in known):
                self._tracks.append(Track(self.t, detection, p))
        for track in self._tracks:
            if track.number is None and track.deserves_number:
                self._named += 1
                track.number = self._named


def _is_same(track: Track, centre: np.ndarray, is_wall: bool) -> bool:
    """Return whether something with its centre there (2,) [m] would be inside a track."""
    apart = float(np.hypot(*(track.x[:2] - centre)))
    if track.is_wall or is_wall:
        return track.is_wall is is_wall and apart < _WALL_APART
    return apart < track.radius
