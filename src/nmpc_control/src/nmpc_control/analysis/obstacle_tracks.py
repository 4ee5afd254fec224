# SPDX-License-Identifier: MIT
"""Where every obstacle was, and how long, from messages that list all obstacles of a moment."""

from typing import Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.analysis.record import ObstacleTrack, Series
from nmpc_control.analysis.recording import Event
from nmpc_control.obstacle import Obstacle


def obstacle_tracks(
    messages: List[Event], start: float, end: float
) -> Optional[Tuple[ObstacleTrack, ...]]:
    """Return the obstacles known from the start [s] of a flight to its end [s].

    An obstacle that is absent from a newer message is gone. The first message counts from before
    the flight. None where no message tells.
    """
    ordered = sorted((message for message in messages if _time(message) <= end), key=_time)
    if not ordered:
        return None
    before = [i for i, message in enumerate(ordered) if _time(message) <= start]
    ordered = ordered[before[-1] :] if before else ordered
    seen: Dict[str, List[Tuple[float, Obstacle]]] = {}
    for message in ordered:
        for obstacle in message.content:
            seen.setdefault(obstacle.id, []).append((_time(message), obstacle))
    times = [_time(message) for message in ordered]
    return tuple(_track(observations, times) for observations in seen.values())


def _time(message: Event) -> float:
    return message.time if message.stamp is None else message.stamp


def _track(observations: List[Tuple[float, Obstacle]], times: List[float]) -> ObstacleTrack:
    first, earliest = observations[0]
    last, obstacle = observations[-1]
    begin = -np.inf if first <= times[0] else first
    end = next((t for t in times if t > last), np.inf)
    centres = np.array([o.position for _, o in observations])
    if np.ptp(centres, axis=0).max() > 0.0:
        seen = Series([t for t, _ in observations], centres)
        return ObstacleTrack(obstacle, seen, begin, end, earliest.velocity)
    moving = Obstacle(
        obstacle.id, obstacle.position, obstacle.size, obstacle.shape, obstacle.velocity, last
    )
    is_still = not np.any(obstacle.velocity)
    return ObstacleTrack(obstacle if is_still else moving, None, begin, end)
