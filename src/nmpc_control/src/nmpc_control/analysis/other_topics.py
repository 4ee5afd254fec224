# SPDX-License-Identifier: MIT
"""What else a bag tells: goals, stamps of all topics, and positions that others than we published.

The paper's published code reads ``world_position`` or the Vicon frame ``mat2`` in ``/tf``, and
publishes where it should be as ``tune/ref_position``.
"""

from typing import Dict, List, Optional, Tuple

import numpy as np

from nmpc_control.analysis.record import Reference, Series
from nmpc_control.analysis.recording import Recording
from nmpc_control.analysis.topics import ROLES

_BODY_FRAMES = ("vicon_frame", "mat2", "base_link")


def goals(recording: Recording) -> Tuple[Tuple[str, float, float], ...]:
    """Return scenario, start and end [s] of each goal: to its result, the next one or the end."""
    starts = recording.events.get("goal", [])
    ends = {event.content.id: event.time for event in recording.events.get("result", [])}
    last = max((s.times[-1] for s in recording.rows.values()), default=np.inf)
    found = []
    for event, following in zip(starts, [*starts[1:], None]):
        end = ends.get(event.content.id, following.time if following else float(last))
        found.append((event.content.text, event.time, end))
    return tuple(found)


def stamps(recording: Recording) -> Dict[str, np.ndarray]:
    """Return the stamps [s] of the messages of every topic that is a row of numbers."""
    names = {role: ROLES[role].suffix if role in ROLES else role for role in recording.rows}
    return {names[role]: series.times for role, series in recording.rows.items()}


def other_position(recording: Recording, missing: List[str]) -> Optional[Series]:
    """Return the best position (n, 3) [m] of a bag without the controller's estimate."""
    rows = recording.rows
    for role in ("world_position", "tf", "local_position"):
        name, found = ROLES[role].suffix, rows.get(role)
        if role == "tf":
            frame, found = _tracked(recording)
            name = f"/tf of {frame}"
        if found is not None and len(found):
            missing.append(f"no nmpc/odometry: position is {name}, not the controller's estimate")
            return found
    return None


def _tracked(recording: Recording) -> Tuple[str, Optional[Series]]:
    """Return the body frame that /tf gives most often, and its position in the world (n, 3)."""
    found: Dict[str, Dict[float, Tuple[float, ...]]] = {frame: {} for frame in _BODY_FRAMES}
    for event in recording.events.get("tf", []):
        for parent, child, position in event.content:
            if child in found and np.isfinite(position).all() and parent != child:
                found[child][event.time] = position
    frame = max(found, key=lambda name: len(found[name]))
    samples = found[frame]
    return frame, Series(list(samples), list(samples.values())) if samples else None


def published_reference(points: Series, automatic: Optional[Tuple[float, float]]) -> Reference:
    """Return a reference from the points that a controller published while it flew."""
    inside = points if automatic is None else points.between(*automatic)
    inside = inside if len(inside) else points
    start = float(inside.times[0])
    return Reference(start, Series(inside.times - start, inside.values))


def battery_percent(battery: Optional[Series], remarks: List[str]) -> Optional[Series]:
    """Return the state of charge in percent, which other drivers than DJI's give from 0 to 1."""
    if battery is None or not np.isfinite(battery.values).any() or (battery.values > 1.0).any():
        return battery
    remarks.append("battery_state is taken as a share of 1")
    return Series(battery.times, 100.0 * battery.values)
