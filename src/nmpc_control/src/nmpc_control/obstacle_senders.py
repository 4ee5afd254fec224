# SPDX-License-Identifier: MIT
"""When each sender of obstacles was last understood, and what it says that is of no use.

Who reports obstacles goes on doing so: a sender that is silent for ``stale_after``, or of which
nothing can be taken for that long, is stale, whatever it reported before, also nothing at all. Who
latches its list says it once and for good: silence is no news then, only what is refused of it.
"""

import math
from dataclasses import dataclass, field
from typing import Dict, Optional, Tuple

Unseen = Dict[str, Tuple[str, float]]  # by id: why it is not known, [s] from when on that counts


@dataclass
class _Sender:
    taken: Optional[float]  # [s] its last list, or first word, came; None: before the clock jumped
    latches: bool = False
    refusal: str = ""  # why its newest list was refused as a whole
    unseen: Unseen = field(default_factory=dict)


class Senders:
    """Those that were heard and are not forgotten."""

    def __init__(self, stale_after: float) -> None:
        """Begin with nobody; ``stale_after`` [s] is how long silence is borne."""
        self.stale_after = stale_after
        self._senders: Dict[str, _Sender] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._senders

    def label(self, name: str) -> str:
        """Return the name of a sender for people, with a word on one whose silence is no news."""
        return f"{name} (latched)" if self._senders[name].latches else name

    def take(self, t: float, name: str, latches: bool, unseen: Unseen) -> None:
        """Note a list that was taken and came at ``t`` [s]."""
        self._senders[name] = _Sender(t, latches, "", unseen)

    def refuse(self, t: float, name: str, sentence: str) -> None:
        """Note a list at ``t`` [s] that was refused as a whole, with the reason."""
        self._senders.setdefault(name, _Sender(t)).refusal = sentence

    def forget(self, name: str) -> None:
        """Expect nothing more of a sender."""
        self._senders.pop(name, None)

    def start_anew(self) -> None:
        """Count from the next look on, as after a jump of the clock."""
        for sender in self._senders.values():
            sender.taken = None
            kept = sender.unseen if sender.latches else {}  # nobody says that again
            sender.unseen = {name: (why, -math.inf) for name, (why, _) in kept.items()}

    def unseen(self, name: str) -> Unseen:
        """Return what is heard of but not known of a sender."""
        return self._senders[name].unseen if name in self._senders else {}

    def silence(self, t: float, name: str) -> float:
        """Return for how long [s] nothing of a sender was taken."""
        sender = self._senders[name]
        if sender.taken is None:
            sender.taken = t
        return t - sender.taken

    def finding(self, t: float) -> str:
        """Return in one sentence of whom too little is known at ``t`` [s]; empty: of nobody."""
        for name, sender in self._senders.items():
            for obstacle, (why, since) in sender.unseen.items():
                if t >= since:
                    return f"what {name} says of obstacle {obstacle} is {why}"
        for name, sender in self._senders.items():
            silence = self.silence(t, name)
            if silence <= self.stale_after:
                continue
            if sender.refusal:
                return f"{sender.refusal}, and nothing better comes for {silence:.1f} s"
            if not sender.latches:
                return f"{name} reported obstacles and is silent for {silence:.1f} s"
        return ""
