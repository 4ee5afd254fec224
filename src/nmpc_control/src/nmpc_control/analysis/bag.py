# SPDX-License-Identifier: MIT
"""From a bag to the record of one flight."""

from pathlib import Path
from typing import Dict, List, Optional, Tuple, Union

import numpy as np

from nmpc_control.analysis import recording as reading
from nmpc_control.analysis.messages import POSITION, QUATERNION, VELOCITY
from nmpc_control.analysis.obstacle_tracks import obstacle_tracks
from nmpc_control.analysis.other_topics import (
    battery_percent,
    goals,
    other_position,
    published_reference,
    stamps,
)
from nmpc_control.analysis.quaternions import rpy_of, to_world
from nmpc_control.analysis.record import FlightRecord, ObstacleTrack, Reference, Series
from nmpc_control.analysis.recording import Event, Progress, Recording
from nmpc_control.analysis.source import is_hardware_in_the_loop
from nmpc_control.analysis.topics import ROLES
from nmpc_control.analysis.windows import mode_runs, run_at, runs
from nmpc_control.dji import FlightStatus
from nmpc_control.errors import BagError
from nmpc_control.mode_inputs import AUTOMATIC

_IN_THE_AIR = (FlightStatus.TAKING_OFF, FlightStatus.IN_AIR, FlightStatus.LANDING)
_PAPER = ROLES["paper_reference"].suffix
_MOVING_SPEED = 0.2  # [m/s] in the air where nothing else tells

ALL = "all"  # flights of a bag

Period = Tuple[float, float]  # [s]


def read_flight(
    path: Union[str, Path],
    flight: Optional[int] = None,
    namespace: Optional[str] = None,
    progress: Optional[Progress] = None,
) -> FlightRecord:
    """Return the record of one flight in a bag.

    Args:
        path: The bag.
        flight: Which trajectory's flight, counted from 1; None for the last.
        namespace: Vehicle to read; None for the best recorded one.
        progress: Wraps the messages to show how far reading is.

    Raises:
        BagError: the bag cannot be read, holds nothing to evaluate, or not that many flights.
    """
    return read_flights(path, flight, namespace, progress)[0]


def read_flights(
    path: Union[str, Path],
    flight: Union[int, str, None] = None,
    namespace: Optional[str] = None,
    progress: Optional[Progress] = None,
) -> List[FlightRecord]:
    """Return the records of one or (``flight`` is "all") of all flights, as ``read_flight``."""
    path = Path(path)
    recording = reading.read(path, namespace, progress)
    count = len(_clock_starts(recording.events.get("trajectory", [])))
    if flight == ALL:
        return [_record(path.name, recording, number) for number in range(1, max(1, count) + 1)]
    if flight is not None and not 1 <= flight <= max(1, count):
        raise BagError(f"has {count} flights, expected at least {flight}")
    if flight is None and count > 1:
        recording.remarks.append(f"the bag holds {count} flights: this is the last of them")
    return [_record(path.name, recording, count if flight is None else int(flight))]


def _record(bag: str, recording: Recording, number: int) -> FlightRecord:
    missing = list(recording.remarks)
    trajectories = recording.events.get("trajectory", [])
    starts = _clock_starts(trajectories)
    start = starts[number - 1] if starts else None
    motion = _motion(recording, missing)
    status = recording.rows.get("status")
    airborne = _airborne(recording.rows, motion.get("velocity"), start, missing)
    automatic = _automatic(status, recording.rows.get("flight_status"), airborne, start, missing)
    tracked = recording.rows.get("reference", recording.rows.get("paper_reference"))
    reference = start and Reference(
        start.stamp, Series(start.content.times, start.content.positions)
    )
    if reference is None and "paper_reference" in recording.rows:
        reference = published_reference(recording.rows["paper_reference"], automatic)
        missing.append(f"no nmpc/trajectory: the reference is what {_PAPER} published")
    return FlightRecord(
        bag=bag,
        flight=(max(number, 1), max(len(starts), 1)),
        scenario=_name(start or (trajectories or [None])[-1]),
        source=_source(recording, missing),
        reference=reference,
        tracked_reference=tracked,
        obstacles=_obstacles(recording.events, start, automatic),
        commands=_commands(recording.rows, missing),
        solver=recording.rows.get("plan"),
        status=status,
        airborne=airborne,
        automatic=automatic,
        phase_end=_next_trajectory(trajectories, start),
        reported_collisions=_collisions(recording, automatic),
        rc=recording.rows.get("rc"),
        battery=battery_percent(recording.rows.get("battery"), missing),
        stamps=stamps(recording),
        goals=goals(recording),
        log=tuple((e.time, *e.content) for e in recording.events.get("log", ())),
        parameters=([e.content for e in recording.events.get("parameters", ())] or [None])[-1],
        start_time=recording.start_time,
        missing=tuple(missing),
        **motion,
    )


def _name(trajectory: Optional[Event]) -> Optional[str]:
    return (trajectory.content.name or None) if trajectory else None


def _clock_starts(trajectories: List[Event]) -> List[Event]:
    """Return the trajectories whose clock started, each once: latched messages come again."""
    started = {event.stamp: event for event in trajectories if event.stamp is not None}
    return [started[stamp] for stamp in sorted(started)]


def _next_trajectory(trajectories: List[Event], start: Optional[Event]) -> Optional[float]:
    if start is None:
        return None
    later = [e.time for e in trajectories if e.stamp != start.stamp and e.time > start.stamp]
    return min(later, default=None)


def _motion(recording: Recording, missing: List[str]) -> Dict[str, Optional[Series]]:
    rows = recording.rows
    motion: Dict[str, Optional[Series]] = {"position": None, "velocity": rows.get("velocity")}
    if "odometry" in rows:
        times, values = rows["odometry"].times, rows["odometry"].values
        motion["position"] = Series(times, values[:, POSITION])
        motion["velocity"] = _finite(
            Series(times, to_world(values[:, QUATERNION], values[:, VELOCITY]))
        )
        motion["attitude"] = _finite(Series(times, rpy_of(values[:, QUATERNION])))
    else:
        motion["position"] = other_position(recording, missing)
    if motion.get("attitude") is None:
        quaternions = next((rows[role] for role in ("attitude", "imu") if role in rows), None)
        if quaternions is not None:
            motion["attitude"] = _finite(
                Series(quaternions.times, rpy_of(quaternions.values[:, :4]))
            )
    if "truth" in rows:
        motion["true_position"] = Series(rows["truth"].times, rows["truth"].values[:, POSITION])
    return motion


def _finite(series: Series) -> Optional[Series]:
    is_finite = np.isfinite(series.values).all(axis=1)
    return Series(series.times[is_finite], series.values[is_finite]) if is_finite.any() else None


def _commands(rows: Dict[str, Series], missing: List[str]) -> Optional[Series]:
    if "setpoint" in rows or "mav_command" not in rows:
        return rows.get("setpoint")
    missing.append(
        "commands are of mav_msgs: their thrust is taken as percent, as an M100's driver expects it"
    )
    return rows["mav_command"]


def _source(recording: Recording, missing: List[str]) -> str:
    if recording.selection.is_simulation:
        return "simulation"
    verdict = is_hardware_in_the_loop(recording.rows["imu"]) if "imu" in recording.rows else None
    if verdict is None:
        missing.append(
            "no imu data in motion: hardware in the loop cannot be told from a real flight"
        )
    return "hil" if verdict else "flight"


def _longest_or_at(periods: List[Period], start: Optional[Event]) -> Optional[Period]:
    if start is not None:
        return run_at(periods, start.stamp)
    return max(periods, key=lambda period: period[1] - period[0], default=None)


def _airborne(
    rows: Dict[str, Series], velocity: Optional[Series], start: Optional[Event], missing: List[str]
) -> Optional[Period]:
    if "flight_status" in rows:
        status = rows["flight_status"]
        return _longest_or_at(runs(status.times, np.isin(status.values[:, 0], _IN_THE_AIR)), start)
    if velocity is None:
        return None
    moving = np.flatnonzero(np.linalg.norm(velocity.values, axis=1) > _MOVING_SPEED)
    if not len(moving):
        return None
    missing.append(
        f"no dji_sdk/flight_status: in the air is first to last motion above {_MOVING_SPEED} m/s"
    )
    return float(velocity.times[moving[0]]), float(velocity.times[moving[-1]])


def _automatic(
    status: Optional[Series],
    flight_status: Optional[Series],
    airborne: Optional[Period],
    start: Optional[Event],
    missing: List[str],
) -> Optional[Period]:
    period = _longest_or_at(mode_runs(status, AUTOMATIC), start)
    if period is None:
        if airborne is None or flight_status is None:
            return None
        missing.append(
            "no nmpc/status of this flight: total time is the time in the air, without what the "
            "transmitter's switch kept by hand"
        )
        return airborne
    if period[1] >= status.times[-1]:
        missing.append("the bag ends before the landing did: total time is up to its end")
    return period


def _obstacles(
    events: Dict[str, List[Event]], start: Optional[Event], automatic: Optional[Period]
) -> Optional[Tuple[ObstacleTrack, ...]]:
    messages = events.get("obstacles") or events.get("sensed_obstacles") or []
    end = automatic[1] if automatic else np.inf
    return obstacle_tracks(messages, start.stamp if start else -np.inf, end)


def _collisions(recording: Recording, automatic: Optional[Period]) -> Optional[int]:
    """Return how many collisions the simulator reported in the flight; None without a simulator."""
    if "truth" not in recording.rows and "collision" not in recording.events:
        return None
    first, last = automatic or (-np.inf, np.inf)
    reports = recording.events.get("collision", [])
    return len({event.content for event in reports if first <= event.time <= last})
