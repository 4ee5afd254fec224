# SPDX-License-Identifier: MIT
"""What is known of obstacles: those of the scenario, and those that senders report.

Every sender speaks for its own list only. What it says is judged entry by entry: a bad one is
counted and leaves the last good knowledge of its obstacle in place, which grows old. One that
stands still does not grow. One that moves does: at the rate its sender gave, and at least at the
default rate once nothing was heard of it for ``age_limit``; after ``stale_after`` it is stale,
which the guard answers by braking, until something new is heard or the sender is forgotten. So is
a sender that is silent or not understood for that long (``obstacle_senders``), and at once one of
whose entries something is heard first that cannot be used: where it is now is not known either.
"""

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Dict, Iterable, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_crowd import nearest
from nmpc_control.obstacle_params import ObstacleParameters
from nmpc_control.obstacle_senders import Senders, Unseen
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting, to_obstacle

DUPLICATE, FUTURE, PAST, BACKWARDS, NO_ROOM, UNPLACED = (
    "duplicate id",
    "from the future",
    "too old",
    "backwards in time",
    "no room",
    "frame",  # not known at the time of the entry
)
MAX_REMEMBERED = 4 * MAX_OBSTACLES  # [1] of all senders; the nearest MAX_OBSTACLES count
_CROWD_PERIOD = 0.5  # [s] between two looks at which those are


class Summary(NamedTuple):
    """Figures for people."""

    known: int  # [1]
    moving: int  # [1]
    oldest: float  # [s] age of the oldest information about a moving one; 0 without any
    senders: Tuple[str, ...]  # of whom something is known
    rejected: Dict[str, int]  # [1] entries by kind
    left_out: int = 0  # [1] farther than those that count


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
        self._senders = Senders(params.stale_after)
        self._owner: Dict[str, str] = {}  # sender whose obstacle carries the bare id
        self._obstacles: Tuple[Obstacle, ...] = ()
        self._due = -math.inf  # [s] when the obstacles next change by themselves
        self._place: Optional[np.ndarray] = None  # (3,) [m] of the aircraft, where there is a crowd

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
        self,
        t: float,
        sender: str,
        judged: Iterable[Tuple[Sighting, str]],
        latches: bool = False,
        received: float = math.inf,
    ) -> List[Tuple[str, str]]:
        """Take a sender's new list; return ids of entries that were not believed, and why not.

        Args:
            t: [s] now.
            sender: its name.
            judged: entries in the world frame, each with what ``obstacle_sighting.fault`` found.
            latches: its list is meant once and for good, so that its silence is no news.
            received: [s] when the list came, if that was before now.
        """
        before = self._tracks.get(sender, {})
        room = MAX_REMEMBERED - len(self._known) - sum(map(len, self._tracks.values()))
        after: Dict[str, _Track] = {}
        refused: List[Tuple[Sighting, str]] = []
        for sighting, found in judged:
            old = before.get(sighting.id)
            if not found and sighting.id in after:
                found = DUPLICATE
            if not found and sighting.moves:
                if sighting.stamp > t + self.params.future_tolerance:
                    refused.append((sighting, FUTURE))  # a wrong clock hides no obstacle
                    sighting = sighting._replace(stamp=t)
                found = self._out_of_time(t, sighting, old)
            elif not found:
                sighting = sighting._replace(stamp=0.0)  # which says nothing about one that stands
            if not found and old is None:
                room -= 1
                found = NO_ROOM if room < 0 else ""
            if found:
                refused.append((sighting, found))
            elif old is not None and old.sighting == sighting:
                after[sighting.id] = old
            else:
                after[sighting.id] = self._track(sender, sighting)
        taken = set(after)
        for sighting, found in refused:
            self.rejected[found] += 1
            if sighting.id in before:
                after.setdefault(sighting.id, before[sighting.id])
        unseen = self._unseen(t, refused, taken, after, self._senders.unseen(sender))
        self.heard = t
        self._replace(sender, before, after)
        self._senders.take(min(received, t), sender, latches, unseen)
        return [(sighting.id, found) for sighting, found in refused]

    def _unseen(
        self,
        t: float,
        refused: Sequence[Tuple[Sighting, str]],
        taken: Set[str],
        after: Dict[str, _Track],
        earlier: Unseen,
    ) -> Unseen:
        """Return of what of a list it is not known where it is, or not known any more."""
        result: Unseen = {}
        for s, found in refused:
            track = after.get(s.id)
            if found == FUTURE:
                continue
            if track is not None and found == DUPLICATE:
                if s.position == track.sighting.position:
                    continue
            elif track is not None and (track.moves or (s.id in taken and not s.moves)):
                continue  # it ages by its stamp, or was only said twice
            why = f"of no use: {found}"
            if found == PAST:
                why = f"{t - s.stamp:.1f} s old"
            elif found == UNPLACED:
                why = "of no use: frame not known"
            stands = track is not None and not s.moves and found != DUPLICATE
            late = earlier.get(s.id, ("", t + self.params.stale_after))[1]
            result[s.id] = why, late if stands else -math.inf
        return result

    def refuse(self, t: float, sender: str, kind: str, sentence: str) -> None:
        """Take note of a list that was refused as a whole: as if its sender were silent.

        Args:
            t: [s] now.
            sender: its name.
            kind: under which it is counted; empty: it was counted before.
            sentence: why, with the sender's name.
        """
        self.reject(kind, 1 if kind else 0)
        self._senders.refuse(t, sender, sentence)

    def knows(self, sender: str) -> bool:
        """Return whether something was heard of a sender that is not forgotten."""
        return sender in self._senders

    def reject(self, kind: str, count: int = 1) -> None:
        """Count entries of nobody's list that were not taken."""
        if count:
            self.rejected[kind] += count

    def forget(self, sender: str, name: str = "") -> int:
        """Forget one obstacle of a sender, or all of them; return how many there were."""
        before = self._tracks.get(sender, {})
        after = {n: track for n, track in before.items() if name and n != name}
        self._replace(sender, before, after)
        unseen = set(self._senders.unseen(sender))
        if name:
            self._senders.unseen(sender).pop(name, None)
        else:
            self._senders.forget(sender)
        return len({*before, *unseen} - {*after, *self._senders.unseen(sender)})

    def start_anew(self) -> None:
        """Forget what carries a time, as after a jump of the clock; what stands still stays."""
        for sender, before in list(self._tracks.items()):
            after = {name: track for name, track in before.items() if not track.moves}
            self._replace(sender, before, after)
        self._senders.start_anew()
        self.heard = self._due = -math.inf

    @property
    def is_crowded(self) -> bool:
        """Whether more may be known than count, so that it matters where the aircraft is."""
        return len(self._known) + sum(map(len, self._tracks.values())) > MAX_OBSTACLES

    def obstacles(self, t: float, place: Optional[np.ndarray] = None) -> Tuple[Obstacle, ...]:
        """Return what is known at ``t`` [s]: the same tuple for as long as nothing changes.

        Of a crowd the ``MAX_OBSTACLES`` that are nearest to ``place`` (3,) [m], which is looked at
        every half second; without a place to the last one.
        """
        self._place = self._place if place is None else place
        if t >= self._due:
            current = tuple(self._current(t))
            ages = (self._limit(k) for k in self._moving() if self._limit(k) > t)
            self._due = min(ages, default=math.inf)
            if len(current) > MAX_OBSTACLES:
                current = self._nearest(current, t)
                self._due = min(self._due, t + _CROWD_PERIOD)
            if list(map(id, current)) != list(map(id, self._obstacles)):
                self._obstacles = current
        return self._obstacles

    def stale(self, t: float) -> str:
        """Return in one sentence of whom too little was heard at ``t`` [s]; empty if of nobody."""
        for sender, tracks in self._tracks.items():
            for name, track in tracks.items():
                if not track.moves or t - track.obstacle.stamp <= self.params.stale_after:
                    continue
                silence = self._senders.silence(t, sender)
                if silence > self.params.stale_after:
                    return f"{sender} reported moving obstacles and is silent for {silence:.1f} s"
                age = t - track.obstacle.stamp
                return f"what {sender} says of obstacle {name} is {age:.1f} s old"
        return self._senders.finding(t)

    def summary(self, t: float) -> Summary:
        """Return figures for people at ``t`` [s]."""
        stamps = [track.obstacle.stamp for track in self._moving()]
        known, oldest = len(self.obstacles(t)), t - min(stamps, default=t)
        left_out = len(tuple(self._current(t))) - known
        names, rejected = tuple(map(self._senders.label, self._tracks)), dict(self.rejected)
        return Summary(known, len(stamps), oldest, names, rejected, left_out)

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

    def _replace(self, sender: str, before: Dict[str, _Track], after: Dict[str, _Track]) -> None:
        for name in before.keys() - after.keys():
            if self._owner.get(name) == sender:
                del self._owner[name]
        if after:
            self._tracks[sender] = after
        else:
            self._tracks.pop(sender, None)
        self._due = -math.inf

    def _moving(self) -> List[_Track]:
        return [k for tracks in self._tracks.values() for k in tracks.values() if k.moves]

    def _limit(self, track: _Track) -> float:
        return track.obstacle.stamp + self.params.age_limit

    def _nearest(self, crowd: Tuple[Obstacle, ...], t: float) -> Tuple[Obstacle, ...]:
        if self._place is None:
            return crowd[:MAX_OBSTACLES]
        return tuple(crowd[i] for i in nearest(crowd, MAX_OBSTACLES, self._place, t))

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
