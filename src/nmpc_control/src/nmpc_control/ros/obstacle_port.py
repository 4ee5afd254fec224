# SPDX-License-Identifier: MIT
"""What a node hears of obstacles: bytes in, a tuple of ``Obstacle`` out.

A message is judged by its size and count before anything of it is read, and of each sender only
the newest is read, at most ``message_rate`` times a second, in a thread of its own: a flood must
not starve the loop beside it. Senders are told apart by the name of their node. A list in a frame
that is not known is tried again until its sender sends another one. On ``obstacles`` a sender that
is silent or not understood becomes stale; what a latched connection brings stands until replaced.

ROS Subscribers: obstacles (nmpc_msgs/ObstacleArray), in any frame that tf2 knows; the same type
nmpc/added_obstacles, from ``obstacle_services``; where asked for nmpc/known_obstacles, those of the
scenario, from nmpc_controller.
"""

import math
import threading
import time
import traceback
from functools import partial
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper

from nmpc_control.estimator import Estimator
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_memory import UNPLACED, ObstacleMemory
from nmpc_control.obstacle_params import load_obstacle_parameters
from nmpc_control.obstacle_sighting import MAX_OBSTACLES, Sighting, fault, moved, to_obstacle
from nmpc_control.ros.frames import FrameError, Frames, Place
from nmpc_control.ros.obstacle_wire import Head, WireError, read_head, read_obstacles
from nmpc_control.ros.subscriptions import Subscriptions
from nmpc_control.state import POSITION
from nmpc_msgs.msg import ObstacleArray

TOPIC, ADDED_TOPIC, KNOWN_TOPIC = "obstacles", "nmpc/added_obstacles", "nmpc/known_obstacles"
MAX_STAMPS = 64  # [1] different ones in a list that is not in the world frame, the newest
MAX_BYTES = 500_000  # [1] of one message: the most obstacles with paths of 60 points have 420,000
RETRY_PERIOD = 0.5  # [s] of wall time between two looks for a frame that is not known
_IDLE = 0.005  # [s] of wall time between two looks at what waits for its turn
_WARNING_PERIOD = 2.0  # [s] of wall time between warnings of one kind

Judged = List[Tuple[Sighting, str]]


class _Heard(NamedTuple):
    head: Head
    data: bytes
    latches: bool  # whether its sender means it once and for good
    t: float  # [s] when it came


class _Unplaced(NamedTuple):
    heard: _Heard
    retry: float  # [s] wall time
    counted: bool


class ObstaclePort:
    """Shared between the threads of ROS, its own, and the loop that asks."""

    def __init__(self, world_frame: str, left_out: Optional[Callable[[], int]] = None) -> None:
        """Begin with nothing; ``left_out`` tells how many found no slot, for the diagnostics."""
        self.frames = Frames(world_frame)
        self._params = load_obstacle_parameters()
        self._memory = ObstacleMemory(self._params)
        self._lock = threading.Lock()  # of the memory
        self._seen: Tuple[Tuple[Obstacle, ...], str] = (), ""
        self._left_out = left_out
        self._waiting: Dict[Tuple[str, str], _Heard] = {}  # by topic and sender
        self._read: Dict[Tuple[str, str], float] = {}  # [s] when each was read last
        self._unplaced: Dict[Tuple[str, str], _Unplaced] = {}  # used by one thread only
        self._forgotten: Set[Tuple[str, str]] = set()  # whose late lists are not to come back
        self._wake = threading.Condition()  # of what waits
        self._warned: Dict[str, float] = {}  # [s] wall time by kind
        self._diagnosed = 0  # rejections that the last diagnosis knew
        threading.Thread(target=self._work, name="obstacles", daemon=True).start()

    def subscribe(self, subscriptions: Subscriptions, known: bool) -> None:
        """Begin to listen; ``known`` also to the obstacles of the controller's scenario."""
        for topic in (TOPIC, ADDED_TOPIC, *((KNOWN_TOPIC,) if known else ())):
            subscriptions.add(topic, rospy.AnyMsg, partial(self._on_message, topic))

    def set_known(self, obstacles: Sequence[Obstacle]) -> None:
        """Replace those of the scenario."""
        with self._lock:
            self._memory.set_known(obstacles)

    def look(self, t: float, aircraft: Estimator) -> Tuple[Tuple[Obstacle, ...], str]:
        """Return what is known at ``t`` [s], and of whom too little was heard; waits for nobody.

        The obstacles are the same tuple for as long as nothing changes; of too many those nearest
        to the aircraft. While a list is being taken in, they are those of the last look.
        """
        if self._lock.acquire(blocking=False):
            try:
                memory = self._memory
                place = _place(aircraft, t) if memory.is_crowded else None
                self._seen = memory.obstacles(t, place), memory.stale(t)
            finally:
                self._lock.release()
        return self._seen

    def age(self, t: float) -> float:
        """Return the age [s] of the newest message that was taken; inf without."""
        return t - self._memory.heard

    def forget(self, sender: str) -> int:
        """Forget all that a sender reported; return how many obstacles that were."""
        with self._wake:
            self._waiting.pop((TOPIC, sender), None)
            self._forgotten.add((TOPIC, sender))
        with self._lock:
            return self._memory.forget(sender)

    def knows(self, sender: str) -> bool:
        """Return whether something was heard of a sender that is not forgotten."""
        with self._lock:
            return self._memory.knows(sender)

    def start_anew(self) -> None:
        """Forget what carries a time, as after a jump of the clock."""
        with self._lock:
            self._memory.start_anew()

    def diagnose(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        """Fill in the entry ``obstacles`` of /diagnostics."""
        t = rospy.Time.now().to_sec()
        with self._lock:
            summary, stale = self._memory.summary(t), self._memory.stale(t)
        total = sum(summary.rejected.values())
        new, self._diagnosed = total - self._diagnosed, total
        left_out = self._left_out() if self._left_out else 0
        words = [f"{summary.known} known, {summary.moving} of them moving"]
        words += [stale] if stale else []
        words += [f"{new} rejected since the last report"] if new else []
        words += [f"{left_out} in reach have no slot"] if left_out else []
        words += [f"{summary.left_out} farther ones left out"] if summary.left_out else []
        level = DiagnosticStatus.ERROR if stale else DiagnosticStatus.WARN
        status.summary(level if words[1:] else DiagnosticStatus.OK, "; ".join(words))
        status.add("known", str(summary.known))
        status.add("moving", str(summary.moving))
        status.add("oldest information [s]", f"{summary.oldest:.2f}")
        status.add("senders", ", ".join(summary.senders) or "none")
        for kind, count in sorted(summary.rejected.items()):
            status.add(f"rejected: {kind}", str(count))
        if self._left_out:
            status.add("without a slot", str(left_out))
        return status

    def _on_message(self, topic: str, message: rospy.AnyMsg) -> None:
        header, data = message._connection_header, message._buff
        sender = header.get("callerid", "somebody without a name")
        if header.get("md5sum") != ObstacleArray._md5sum:
            kind = header.get("type", "a type that it does not name")
            self._reject(sender, "type", f"{sender} sends {kind}, or another version of it")
            return
        try:
            head = read_head(data)
        except WireError as error:
            self._reject(sender, "unreadable", f"{sender} sends {error}")
            return
        if head.count > MAX_OBSTACLES:
            words = f"{sender} sends {head.count} obstacles, at most {MAX_OBSTACLES} are taken"
            self._reject(sender, "too many", words)
            return
        if len(data) > MAX_BYTES:
            words = f"{sender} sends {len(data)} bytes, {MAX_BYTES} are read"
            self._reject(sender, "too large", words)
            return
        latches = topic != TOPIC or header.get("latching") == "1"
        heard = _Heard(head, data, latches, rospy.Time.now().to_sec())
        with self._wake:
            self._waiting[topic, sender] = heard
            self._wake.notify()

    def _work(self) -> None:
        while not rospy.is_shutdown():
            if not self._take_in():
                time.sleep(_IDLE)

    def _take_in(self) -> bool:
        """Take in what may be read now, and look again for frames; return if anything came."""
        due = self._next()
        for key, heard in due:
            self._unplaced.pop(key, None)
            self._try(key, heard, counted=False)
        now = time.monotonic()
        for key, late in list(self._unplaced.items()):
            if now >= late.retry:
                del self._unplaced[key]
                self._try(key, late.heard, late.counted)
        return bool(due)

    def _try(self, key: Tuple[str, str], heard: _Heard, counted: bool) -> None:
        topic, sender = key
        try:
            self._take(topic, sender, heard)
        except WireError as error:
            self._reject(sender, "unreadable", f"{sender}: {error}")
        except FrameError as error:
            words = f"{sender}: {error}"
            if counted or self.frames.is_new:
                self._note(sender, words)
            else:
                self._reject(sender, "frame", words)
                counted = True
            retry = time.monotonic() + RETRY_PERIOD
            self._unplaced[key] = _Unplaced(heard, retry, counted)
        except Exception:  # noqa: BLE001 (one odd message must not blind an aircraft)
            self._reject(sender, "unreadable", f"{sender}: {traceback.format_exc(limit=-2)}")

    def _next(self) -> List[Tuple[Tuple[str, str], _Heard]]:
        """Return what may be read now, after waiting for something to come."""
        with self._wake:
            if not self._waiting:
                self._wake.wait(RETRY_PERIOD)
            now, period = rospy.Time.now().to_sec(), 1.0 / self._params.message_rate
            while self._forgotten:
                self._unplaced.pop(self._forgotten.pop(), None)
            self._read = {k: t for k, t in self._read.items() if 0.0 <= now - t < period}
            due = [key for key in self._waiting if key not in self._read]
            self._read.update(dict.fromkeys(due, now))
            return [(key, self._waiting.pop(key)) for key in due]

    def _take(self, topic: str, sender: str, heard: _Heard) -> None:
        judged = self.judge(heard.head, read_obstacles(heard.data, heard.head))
        if topic == KNOWN_TOPIC:
            self.set_known([to_obstacle(s, s.id) for s, found in judged if not found])
            with self._lock:
                self._memory.forget(sender)  # that a list before was refused
            return
        with self._lock:
            t = rospy.Time.now().to_sec()
            refused = self._memory.hear(t, sender, judged, heard.latches, heard.t)
        for name, kind in refused[:1]:
            others = f", and {len(refused) - 1} more" if refused[1:] else ""
            self._warn(kind, f"{sender}: {name!r}: {kind}{others}")

    def judge(self, head: Head, sightings: Sequence[Sighting]) -> Judged:
        """Return entries in the world frame, each with what is wrong with it; or FrameError."""
        judged = [(s, fault(s)) for s in sightings]
        if self.frames.is_world(head.frame_id):
            return judged
        places = self._places(head.frame_id, {s.stamp for s, bad in judged if not bad}, head.stamp)
        return [
            (moved(s, *places[s.stamp]), "")
            if not bad and s.stamp in places
            else (s, bad or UNPLACED)
            for s, bad in judged
        ]

    def _places(self, frame_id: str, stamps: Set[float], otherwise: float) -> Dict[float, Place]:
        """Return where a frame was at those of its newest stamps at which that is known.

        Raises:
            FrameError: it is known at none of them, or at ``otherwise`` [s] where there is none.
        """
        places: Dict[float, Place] = {}
        why: Optional[FrameError] = None
        for stamp in sorted(stamps or {otherwise}, reverse=True)[:MAX_STAMPS]:
            try:
                places[stamp] = self.frames.place(frame_id, stamp)
            except FrameError as error:
                why = error
        if why is not None and not places:
            raise why
        return places

    def _reject(self, sender: str, kind: str, sentence: str) -> None:
        self._note(sender, sentence, kind)
        self._warn(kind, sentence)

    def _note(self, sender: str, sentence: str, kind: str = "") -> None:
        """Let the memory know of a list that was refused, to be counted if of a kind."""
        with self._lock:
            t, memory = rospy.Time.now().to_sec(), self._memory
            memory.refuse(t, sender, kind, sentence.splitlines()[0])

    def _warn(self, kind: str, sentence: str) -> None:
        now = time.monotonic()
        if now - self._warned.get(kind, -math.inf) >= _WARNING_PERIOD:
            self._warned[kind] = now
            rospy.logwarn(f"obstacles rejected: {sentence}")


def _place(aircraft: Estimator, t: float) -> Optional[np.ndarray]:
    estimate = aircraft.estimate(t)
    return None if estimate is None else estimate.vector[POSITION]
