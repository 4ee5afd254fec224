# SPDX-License-Identifier: MIT
"""Subscriptions that come back to life.

rospy can lose the news of a publisher that registers in the same moment as a subscriber and then
waits for it for ever; a topic that nobody is connected to is subscribed anew now and then.
"""

import threading
import time
from typing import Any, Callable, Dict, List, Optional, Tuple

import rospy

_PERIOD = 2.0  # [s] of wall time between two looks


class Subscriptions:
    """Newest-wins subscriptions of one node, looked after by a thread that nobody waits for."""

    def __init__(self) -> None:
        self._made: List[Tuple[Tuple[str, type, Callable[[Any], None]], Dict[str, Any]]] = []
        self._alive: List[rospy.Subscriber] = []
        self._hears: List[Optional[Callable[[], bool]]] = []
        threading.Thread(target=self._look_after, name="subscriptions", daemon=True).start()

    def add(
        self,
        topic: str,
        kind: type,
        callback: Callable[[Any], None],
        queue_size: int = 1,
        hears: Optional[Callable[[], bool]] = None,
    ) -> None:
        """Subscribe to a topic without delay on the wire.

        ``hears`` tells whether the sender is heard, where others publish on the topic, too.
        """
        options = {"queue_size": queue_size, "tcp_nodelay": True}
        self._alive.append(rospy.Subscriber(topic, kind, callback, **options))
        self._hears.append(hears)
        self._made.append(((topic, kind, callback), options))

    def _look_after(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(_PERIOD)
            for i, (arguments, options) in enumerate(list(self._made)):
                hears, connections = self._hears[i], self._alive[i].get_num_connections()
                is_deaf = connections == 0 or (hears is not None and not hears())
                if is_deaf and not rospy.is_shutdown():
                    self._alive[i].unregister()
                    self._alive[i] = rospy.Subscriber(*arguments, **options)
