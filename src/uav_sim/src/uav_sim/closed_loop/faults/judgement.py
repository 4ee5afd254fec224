# SPDX-License-Identifier: MIT
"""A flight of the matrix as a row of figures, judged by what is expected of it."""

import math
from typing import Any, Dict, List, Optional, Tuple

from nmpc_control.guard_data import GuardOutput
from nmpc_control.ladder import Rung
from nmpc_control.mode_inputs import AUTOMATIC, STREAMING, Mode
from uav_sim.closed_loop.faults.flight import Flight
from uav_sim.closed_loop.faults.matrix import AS_BEFORE, Case, Expectation

Row = Dict[str, Any]
TAKEOVER = 0.02  # [s] one period, in which the stream ends once the pilot's switch is heard
_LOOK_AFTER = 0.5  # [s] for which that is looked at
AGAINST_LANDING = 0.2  # [s] for which setpoints may go on: until the flight status is heard
_LANDED = "waiting landed"
_ON_PLANS = (Rung.NEW_PLAN, Rung.LAST_PLAN)


def row_of(case: Case, situation: str, flight: Flight, expected: Expectation) -> Row:
    """Return the row of a flight; ``passed`` leaves out whether a collision could be avoided."""
    outputs = [(t, o) for t, o in flight.loop.log.outputs if t > flight.t0 + 1e-9]
    ways = way(flight.before, outputs)
    last = outputs[-1][1] if outputs else flight.before
    since = flight.loop.pilot_heard if ways[:1] == ["manual pilot"] else None
    reacted = reaction(flight.before, outputs)
    row = {
        "fault": case.name,
        "situation": situation,
        "final_mode": last.mode.name.lower(),
        "reason": ways[-1].split(maxsplit=1)[1] if ways else "",
        "expected_mode": expected.mode or flight.before.mode.name.lower(),
        "expected": expected.end if not expected.by else f"{expected.by}, then {expected.end}",
        "before": f"{flight.before.mode.name.lower()} {flight.before.code}",
        "way": ways,
        "collision": bool(flight.loop.aircraft.collisions),
        "collided_with": sorted({c.id for c in flight.loop.aircraft.collisions}),
        "clearance_m": _finite(min(flight.loop.aircraft.clearance.values(), default=math.inf)),
        "nan_published": nan_count(flight),
        "command_gap_ms_max": round(1e3 * longest_gap(flight), 1),
        "reaction_s": None if reacted is None else round(reacted - (since or flight.t0), 3),
        "takeover_s": takeover(flight),
        "sinks_m": sinks(flight),
        "end_speed_m_s": end_speed(flight),
        "on_ground": flight.loop.aircraft.plant.on_ground,
        "against_landing_s": round(flight.loop.against_landing, 3),
        "unavoidable": None,
    }
    row["failures"] = failures(row, expected)
    row["passed"] = not row["failures"]
    return row


def failures(row: Row, expected: Expectation) -> List[str]:
    """Return what is not as expected, in words."""
    ways, found = row["way"], []
    if expected.end == AS_BEFORE:
        if ways:
            found.append(f"expected no change, got {', '.join(ways)}")
    elif [row["before"], *ways][-1] != expected.end:
        found.append(f"expected {expected.end} at last, got {ways[-1] if ways else 'no change'}")
    if expected.by and ways[:1] != [expected.by]:
        found.append(f"expected {expected.by} at first, got {ways[0] if ways else 'no change'}")
    if row["nan_published"]:
        found.append(f"{row['nan_published']} setpoints are not finite")
    if row["command_gap_ms_max"] > expected.gap_ms + 1e-6:
        found.append(f"no setpoint for {row['command_gap_ms_max']:g} ms")
    if math.isfinite(expected.within):
        late = row["reaction_s"]
        if late is None or late > expected.within + 1e-6:
            found.append(f"reacted after {late} s, {expected.within:g} s are allowed")
    if row["takeover_s"] > TAKEOVER + 1e-6:
        found.append(f"setpoints for {row['takeover_s']:g} s after the pilot was heard")
    if row["sinks_m"] > expected.sinks + 1e-6:
        found.append(f"sinks by {row['sinks_m']:g} m, {expected.sinks:g} m are allowed")
    if row["end_speed_m_s"] > expected.rests + 1e-6:
        found.append(f"moves at {row['end_speed_m_s']:g} m/s at the end")
    if (expected.lands or expected.end == _LANDED) and not row["on_ground"]:
        found.append("it is not on the ground at the end")
    if row["against_landing_s"] > AGAINST_LANDING + 1e-6:
        found.append(f"setpoints against DJI's landing for {row['against_landing_s']:g} s")
    if row["collision"] and not expected.unavoidable:
        found.append(f"collided with {', '.join(row['collided_with'])}")
    return found


def way(before: GuardOutput, outputs: List[Tuple[float, GuardOutput]]) -> List[str]:
    """Return modes with reason codes, one for each change."""
    names, last = [], (before.mode, before.code)
    for _, output in outputs:
        if (output.mode, output.code) != last:
            last = output.mode, output.code
            names.append(f"{output.mode.name.lower()} {output.code}".strip())
    return names


def reaction(before: GuardOutput, outputs: List[Tuple[float, GuardOutput]]) -> Optional[float]:
    """Return when [s] the guard first did something else, or told somebody to; None: never."""
    flew = before.rung in _ON_PLANS
    for t, output in outputs:
        same = (output.mode, output.code) == (before.mode, before.code)
        if not same or output.actions or flew != (output.rung in _ON_PLANS):
            return t
    return None


def takeover(flight: Flight) -> float:
    """Return for how long [s] setpoints went on after the pilot's switch was heard."""
    heard = flight.loop.pilot_heard
    if heard is None:
        return 0.0
    late = [t - heard for t, _ in flight.loop.sent if 0.0 < t - heard <= _LOOK_AFTER]
    return round(max(late, default=0.0), 3)


def sinks(flight: Flight) -> float:
    """Return by how much [m] the aircraft came below where it was as the case began, on truth."""
    heights = [truth.position[2] for truth in flight.loop.log.truths if truth.t >= flight.t0 - 0.01]
    return round(heights[0] - min(heights), 3)


def end_speed(flight: Flight) -> float:
    """Return the speed [m/s] at the end, on truth."""
    return round(math.sqrt(sum(v * v for v in flight.loop.aircraft.truth.velocity)), 3)


def nan_count(flight: Flight) -> int:
    """Return how many setpoints of the flight were not finite."""
    return sum(not all(map(math.isfinite, axes)) for _, axes in flight.loop.sent)


def longest_gap(flight: Flight) -> float:
    """Return the longest time [s] between two setpoints since the case began.

    Silence that a mode without setpoints has chosen, or DJI's own landing, is none.
    """
    longest, last = 0.0, None
    for t, output in flight.loop.log.outputs:
        if t < flight.t0 - 0.1:
            continue
        if output.axes is not None:
            longest, last = max(longest, t - (t if last is None else last)), t
        elif output.mode not in AUTOMATIC or output.mode is Mode.LANDING:
            last = None
    ended = flight.loop.log.outputs[-1][1].mode in STREAMING
    return max(longest, flight.loop.t - last) if last is not None and ended else longest


def _finite(value: float) -> Optional[float]:
    return round(value, 3) if math.isfinite(value) else None
