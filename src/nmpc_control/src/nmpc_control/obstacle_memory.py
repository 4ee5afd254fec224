# SPDX-License-Identifier: MIT
"""What is known of obstacles: those of the scenario, and those that senders report.

Every sender speaks for its own list only. What it says is judged entry by entry: a bad one is
counted and leaves the last good knowledge of its obstacle in place, which grows old. One that
stands still never ages. One that moves grows: at the rate its sender gave, and at least at the
default rate once nothing was heard of it for ``age_limit``; after ``stale_after`` it is stale,
which the guard answers by braking, until something new is heard or the sender is forgotten. So is
one that is too old, or in a frame that was not known, when it is heard of first: where it is now is
not known either.
"""

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_params import ObstacleParameters
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting, to_obstacle

DUPLICATE, FUTURE, PAST, BACKWARDS, NO_ROOM, UNPLACED = (
    "duplicate id",
    "from the future",
    "too old",
    "backwards in time",
    "no room",
    "frame",  # not known at the time of the entry
)


class Summary(NamedTuple):
    """Figures for people."""

    known: int  # [1]
    moving: int  # [1]
    oldest: float  # [s] age of the oldest information about a moving one; 0 without any
    senders: Tuple[str, ...]  # of whom something is known
    rejected: Dict[str, int]  # [1] entries by kind


@dataclass
class _Track:
    sighting: Sighting
    obstacle: Obstacle
    is_aged: bool = False  # whether it grows as one of whom nothing is heard

    @property
    def moves(self) -> bool:
        return self.obstacle.stamp is not None


class ObstacleMemory:
    """Not for several threads at once: whoever shares it locks it."""

    def __init__(self, params: ObstacleParameters) -> None:
        self.params = params
        self.rejected: "Counter[str]" = Counter()
        self.heard = -math.inf  # [s] when the newest message came
        self._known: Dict[str, Obstacle] = {}
        self._tracks: Dict[str, Dict[str, _Track]] = {}  # by sender and id
        self._heard: Dict[str, float] = {}  # [s] by sender of whom something is known
        self._unseen: Dict[str, Dict[str, str]] = {}  # why, of what moves, by sender and id
        self._owner: Dict[str, str] = {}  # sender whose obstacle carries the bare id
        self._obstacles: Tuple[Obstacle, ...] = ()
        self._due = -math.inf  # [s] when the obstacles next change by themselves

    def set_known(self, obstacles: Sequence[Obstacle]) -> None:
        """Replace those that are known without being heard of, as from a scenario.

        They stand still. One of the same id takes the place of the known while a sender reports it:
        one that moved and is seen no more may be where the scenario says.
        """
        still = [o if o.stamp is None else replace(o, stamp=None) for o in obstacles]
        self.reject(NO_ROOM, max(0, len(still) - MAX_OBSTACLES))
        self._known = {o.id: o for o in still[-MAX_OBSTACLES:]}
        self._due = -math.inf

    def hear(
        self, t: float, sender: str, judged: Iterable[Tuple[Sighting, str]]
    ) -> List[Tuple[str, str]]:
        """Take a sender's new list; return ids of entries that were not believed, and why not.

        Args:
            t: [s] now.
            sender: its name.
            judged: entries in the world frame, each with what ``obstacle_sighting.fault`` found.
        """
        before = self._tracks.get(sender, {})
        room = MAX_OBSTACLES - len(self._known) - sum(map(len, self._tracks.values()))
        after: Dict[str, _Track] = {}
        refused: List[Tuple[str, str]] = []
        unseen: Dict[str, str] = {}
        for sighting, found in judged:
            old = before.get(sighting.id)
            if not found and sighting.id in after:
                found = DUPLICATE
            if not found and sighting.moves:
                if sighting.stamp > t + self.params.future_tolerance:
                    refused.append((sighting.id, FUTURE))  # a wrong clock hides no obstacle
                    sighting = sighting._replace(stamp=t)
                found = self._out_of_time(t, sighting, old)
            elif not found:
                sighting = sighting._replace(stamp=0.0)  # which says nothing about one that stands
            if not found and old is None:
                room -= 1
                found = NO_ROOM if room < 0 else ""
            if found:
                refused.append((sighting.id, found))
                if found in (PAST, UNPLACED) and sighting.moves:
                    age = f"{t - sighting.stamp:.1f} s old"
                    unseen[sighting.id] = age if found == PAST else "of no use: frame not known"
            elif old is not None and old.sighting == sighting:
                after[sighting.id] = old
            else:
                after[sighting.id] = self._track(sender, sighting)
        for name, found in refused:
            self.rejected[found] += 1
            if name in before:
                after.setdefault(name, before[name])
        self.heard = t
        self._replace(t, sender, before, after)
        moving = {name for name, track in after.items() if track.moves}
        self._set_unseen(sender, {n: why for n, why in unseen.items() if n not in moving})
        return refused

    def reject(self, kind: str, count: int = 1) -> None:
        """Count what could not even be read; the knowledge about its sender's obstacles ages."""
        if count:
            self.rejected[kind] += count

    def forget(self, sender: str, name: str = "") -> int:
        """Forget one obstacle of a sender, or all of them; return how many there were."""
        before = self._tracks.get(sender, {})
        after = {n: track for n, track in before.items() if name and n != name}
        self._replace(self._heard.get(sender, -math.inf), sender, before, after)
        unseen = self._unseen.get(sender, {})
        left = {n: why for n, why in unseen.items() if name and n != name}
        self._set_unseen(sender, left)
        return len({*before, *unseen} - {*after, *left})

    def start_anew(self) -> None:
        """Forget what carries a time, as after a jump of the clock; what stands still stays."""
        for sender, before in list(self._tracks.items()):
            after = {name: track for name, track in before.items() if not track.moves}
            self._replace(-math.inf, sender, before, after)
        self._unseen.clear()
        self.heard = self._due = -math.inf

    def obstacles(self, t: float) -> Tuple[Obstacle, ...]:
        """Return what is known at ``t`` [s]: the same tuple for as long as nothing changes."""
        if t >= self._due:
            current = tuple(self._current(t))
            if list(map(id, current)) != list(map(id, self._obstacles)):
                self._obstacles = current
            ages = (self._limit(k) for k in self._moving() if self._limit(k) > t)
            self._due = min(ages, default=math.inf)
        return self._obstacles

    def stale(self, t: float) -> str:
        """Return in one sentence of whom too little was heard at ``t`` [s]; empty if of nobody."""
        for sender, tracks in self._tracks.items():
            for name, track in tracks.items():
                if not track.moves or t - track.obstacle.stamp <= self.params.stale_after:
                    continue
                silence = t - self._heard[sender]
                if silence > self.params.stale_after:
                    return f"{sender} reported moving obstacles and is silent for {silence:.1f} s"
                age = t - track.obstacle.stamp
                return f"what {sender} says of obstacle {name} is {age:.1f} s old"
        for sender, unseen in self._unseen.items():
            name, why = next(iter(unseen.items()))
            return f"what {sender} says of obstacle {name} is {why}"
        return ""

    def _set_unseen(self, sender: str, unseen: Dict[str, str]) -> None:
        self._unseen.pop(sender, None)
        if unseen:
            self._unseen[sender] = unseen

    def summary(self, t: float) -> Summary:
        """Return figures for people at ``t`` [s]."""
        stamps = [track.obstacle.stamp for track in self._moving()]
        known, oldest = len(self.obstacles(t)), t - min(stamps, default=t)
        return Summary(known, len(stamps), oldest, tuple(self._tracks), dict(self.rejected))

    def _out_of_time(self, t: float, s: Sighting, old: Optional[_Track]) -> str:
        """Return what is wrong with the time of a moving entry; news said again is only old."""
        last = old.sighting.stamp if old is not None and old.moves else -math.inf
        if t - s.stamp > self.params.stale_after and s.stamp != last:
            return PAST
        return BACKWARDS if s.stamp < last else ""

    def _track(self, sender: str, sighting: Sighting) -> _Track:
        owner = self._owner.setdefault(sighting.id, sender)
        name = sighting.id if owner == sender else f"{sighting.id}@{sender}"
        return _Track(sighting, to_obstacle(sighting, name))

    def _replace(
        self, t: float, sender: str, before: Dict[str, _Track], after: Dict[str, _Track]
    ) -> None:
        for name in before.keys() - after.keys():
            if self._owner.get(name) == sender:
                del self._owner[name]
        if after:
            self._tracks[sender], self._heard[sender] = after, t
        else:
            self._tracks.pop(sender, None)
            self._heard.pop(sender, None)
        self._due = -math.inf

    def _moving(self) -> List[_Track]:
        return [k for tracks in self._tracks.values() for k in tracks.values() if k.moves]

    def _limit(self, track: _Track) -> float:
        return track.obstacle.stamp + self.params.age_limit

    def _current(self, t: float) -> Iterable[Obstacle]:
        heard = {name for tracks in self._tracks.values() for name in tracks}
        for name, obstacle in self._known.items():
            if name not in heard:
                yield obstacle
        for tracks in self._tracks.values():
            for track in tracks.values():
                if track.moves and not track.is_aged and t >= self._limit(track):
                    growth = max(track.sighting.growth, self.params.default_growth)
                    track.obstacle = replace(track.obstacle, growth=growth)
                    track.is_aged = True
                yield track.obstacle
