# SPDX-License-Identifier: MIT
"""Topics and services of one vehicle, in its namespace; they can end together."""

from typing import Any, Callable, List, Optional

import rospy


class Ports:
    """Makes publishers, subscribers and services with names below a namespace.

    rospy logs an exception in a callback and goes on with the next message or request.
    """

    def __init__(self, namespace: str = "") -> None:
        self.namespace = namespace  # of the vehicle; empty: the node's own
        self.prefix = f"{namespace}: " if namespace else ""  # of its lines in the log
        self._open: List[Any] = []

    def name(self, name: str) -> str:
        """Return a name as it is below the namespace."""
        return f"{self.namespace}/{name}" if self.namespace else name

    def publisher(self, name: str, kind: Any, queue_size: int, latch: bool = False) -> Any:
        """Return a new publisher."""
        port = rospy.Publisher(self.name(name), kind, queue_size=queue_size, latch=latch)
        self._open.append(port.unregister)
        return port

    def subscriber(
        self,
        name: str,
        kind: Any,
        callback: Callable[..., None],
        argument: Optional[Any] = None,
        queue_size: int = 10,
    ) -> None:
        """Have a callback called with every message, and with the argument unless it is None."""
        port = rospy.Subscriber(
            self.name(name), kind, callback, argument, queue_size=queue_size, tcp_nodelay=True
        )
        self._open.append(port.unregister)

    def service(self, name: str, kind: Any, handler: Callable[[Any], Any]) -> None:
        """Have a handler answer a service."""
        port = rospy.Service(self.name(name), kind, handler)
        self._open.append(port.shutdown)

    def close(self) -> None:
        """End all, as when the node behind them dies."""
        for close in self._open:
            close()
        self._open.clear()
