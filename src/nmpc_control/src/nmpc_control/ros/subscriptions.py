# SPDX-License-Identifier: MIT
"""Subscriptions that come back to life.

rospy can lose the news of a publisher that registers in the same moment as a subscriber and then
waits for it for ever; a topic that nobody is connected to is subscribed anew now and then.
"""

import threading
import time
from typing import Any, Callable, Dict, List, Tuple

import rospy

_PERIOD = 2.0  # [s] of wall time between two looks


class Subscriptions:
    """Newest-wins subscriptions of one node, looked after by a thread that nobody waits for."""

    def __init__(self) -> None:
        self._made: List[Tuple[Tuple[str, type, Callable[[Any], None]], Dict[str, Any]]] = []
        self._alive: List[rospy.Subscriber] = []
        threading.Thread(target=self._look_after, name="subscriptions", daemon=True).start()

    def add(
        self, topic: str, kind: type, callback: Callable[[Any], None], queue_size: int = 1
    ) -> None:
        """Subscribe to a topic without delay on the wire."""
        options = {"queue_size": queue_size, "tcp_nodelay": True}
        self._alive.append(rospy.Subscriber(topic, kind, callback, **options))
        self._made.append(((topic, kind, callback), options))

    def _look_after(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(_PERIOD)
            for i, (arguments, options) in enumerate(list(self._made)):
                if self._alive[i].get_num_connections() == 0 and not rospy.is_shutdown():
                    self._alive[i].unregister()
                    self._alive[i] = rospy.Subscriber(*arguments, **options)
