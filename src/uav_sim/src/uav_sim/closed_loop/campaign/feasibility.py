# SPDX-License-Identifier: MIT
"""Whether there was a way at all for a flight that did not succeed.

A way keeps the margin from what stands and the hull from what moves, at every moment, with full
knowledge of the future, within the input bounds of the controller's vehicle file. It is looked for
from 10 starts and then checked densely, by formulas of its own. A flight that arrived so shows by
itself that there is a way.
"""

from typing import Any, Dict, Iterator, List, Tuple

import numpy as np

from nmpc_control.params import Limits, Vehicle
from nmpc_control.state import GRAVITY
from uav_sim.closed_loop.campaign import clamped_spline as spline
from uav_sim.closed_loop.campaign.draw import CLOCK_START, HULL, MARGIN, Flight, Sketch
from uav_sim.closed_loop.campaign.flying import Row
from uav_sim.closed_loop.campaign.reach import way_through
from uav_sim.closed_loop.campaign.settings import Settings
from uav_sim.closed_loop.campaign.way import Spheres, improve

LONGER = (5.0, 2.0, 10.0, 15.0, 20.0)  # [s] than the leg at its speed, in the order of trial
DIRECTIONS = np.radians([0.0, 180.0, 90.0, -90.0, 45.0, 135.0, -45.0, -135.0])  # left, right, up..
DETOUR = 3.5  # [m] to one side
STARTS = 2 + len(DIRECTIONS)
_SEARCH_SPEED = 1.5  # times the leg's speed, on the grid
_RAMP = 0.2  # part of the time from the line to the detour
_SAMPLES = 50  # in each segment, for the check
_TOUCH = 0.02  # [m] hull to a moving surface that still is a way
_TOLERANCE = 1e-6


def judge(flight: Flight, row: Row, settings: Settings) -> Dict[str, Any]:
    """Return ``feasible`` and ``feasible_by`` of a row; None where it is not to be looked for."""
    if flight.sketch.is_closed:
        return {"feasible": False, "feasible_by": "drawn"}
    if (
        row["arrived"]
        and not row["collisions"]
        and (flight.sketch.changes or not row["margin_entered"])
    ):
        return {"feasible": True, "feasible_by": "flight"}
    if not settings.check:
        return {"feasible": None, "feasible_by": None}
    parameters = settings.parameters()
    start = find_way(flight.sketch, parameters.vehicle, parameters.limits, flight.heading)
    if start < 0:
        return {"feasible": False, "feasible_by": f"{STARTS} starts"}
    return {"feasible": True, "feasible_by": f"start {start}"}


def find_way(sketch: Sketch, vehicle: Vehicle, limits: Limits, heading: float = 0.0) -> int:
    """Return the number of the first start from which there is a way, -1 if there is none."""
    spheres = spheres_of(sketch)
    for number, (path, duration) in enumerate(starts(sketch, spheres)):
        points = improve(path, duration, spheres, vehicle, limits)
        if is_way(points, duration, spheres, vehicle, limits, heading):
            return number
    return -1


def spheres_of(sketch: Sketch) -> Spheres:
    """Return the spheres as of the clock's start, with the distance that must be kept."""
    centers = np.array([s.center for s in sketch.spheres]).reshape(-1, 3)
    velocities = [np.zeros(3) if s.velocity is None else s.velocity for s in sketch.spheres]
    gaps = [s.radius + HULL + (_TOUCH if sketch.changes else MARGIN) for s in sketch.spheres]
    v = np.array(velocities).reshape(-1, 3)
    return Spheres(centers + CLOCK_START * v, v, np.array(gaps))


def starts(sketch: Sketch, spheres: Spheres) -> Iterator[Tuple[np.ndarray, float]]:
    """Yield 10 paths (n, 3) [m] with their durations [s].

    Straight; around on eight sides; through the grid. Durations take turns: those at which the end
    of the leg is free.
    """
    durations = _durations(sketch, spheres)
    part = np.linspace(0.0, 1.0, 2 * spline.SEGMENTS + 1)
    line = np.outer(part, [sketch.length, 0.0, 0.0])
    aside = DETOUR * np.clip(np.minimum(part, 1.0 - part) / _RAMP, 0.0, 1.0)
    for i in range(STARTS - 1):
        path = line.copy()
        if i > 0:
            angle = DIRECTIONS[i - 1]
            path[:, 1:] += np.outer(aside, [np.cos(angle), np.sin(angle)])
        yield path, durations[i % len(durations)]
    for duration in durations:
        found = way_through(sketch.length, duration, spheres, _SEARCH_SPEED * sketch.speed)
        if found is not None:
            yield found, duration
            return


def _durations(sketch: Sketch, spheres: Spheres) -> List[float]:
    end, usual = np.array([[sketch.length, 0.0, 0.0]]), sketch.length / sketch.speed
    candidates = [usual + longer for longer in LONGER]
    free = [t for t in candidates if spheres.excess(np.array([t]), end).min(initial=np.inf) > 0.0]
    return free or candidates[:1]


def is_way(
    points: np.ndarray,
    duration: float,
    spheres: Spheres,
    vehicle: Vehicle,
    limits: Limits,
    heading: float = 0.0,
) -> bool:
    """Return whether control points (POINTS, 3) are a flight that keeps clear and can be flown.

    Args:
        points: in the frame of the leg.
        duration: [s].
        spheres: with the distances that must be kept.
        vehicle: lags, gains and drag.
        limits: bounds of inputs and speed.
        heading: [rad] of the leg; the aircraft's yaw is 0.
    """
    h = duration / spline.SEGMENTS
    local = np.linspace(0.0, 1.0, _SAMPLES + 1)  # both ends: the jerk jumps between segments
    p, v, a, j = (m @ points / h**i for i, m in enumerate(spline.matrices(local)))
    clear = spheres.excess(spline.times(local, h), p).min(initial=np.inf)
    if clear < _between(h / _SAMPLES, v, a, spheres):
        return False
    inputs = _inputs(*(_turned(derivative, heading) for derivative in (v, a, j)), vehicle)
    low, high = limits.input_min[:3] - _TOLERANCE, limits.input_max[:3] + _TOLERANCE
    fast = np.linalg.norm(v, axis=1).max() > limits.speed + _TOLERANCE
    return bool((inputs >= low).all() and (inputs <= high).all() and not fast)


def _between(dt: float, v: np.ndarray, a: np.ndarray, spheres: Spheres) -> float:
    """Return by how much [m] a gap can be smaller between two samples than at both."""
    chord = dt * (_largest(v) + _largest(spheres.velocities))
    return chord**2 / (8.0 * spheres.gaps.min(initial=np.inf)) + dt**2 / 8.0 * _largest(a)


def _largest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


def _inputs(v: np.ndarray, a: np.ndarray, j: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Return thrust [m/s^2], roll and pitch reference [rad] (M, 3) that fly this at yaw 0.

    From the model's v' = T e_z - g - b v with e_z = (cos phi sin theta, -sin phi, cos phi cos
    theta), and its lags, solved for the references.
    """
    f = a + vehicle.drag * v + [0.0, 0.0, GRAVITY]
    rate = j + vehicle.drag * a
    thrust = np.linalg.norm(f, axis=1)
    sine = -f[:, 1] / thrust
    roll, pitch = np.arcsin(sine), np.arctan2(f[:, 0], f[:, 2])
    thrust_rate = (f * rate).sum(axis=1) / thrust
    roll_rate = -(rate[:, 1] + sine * thrust_rate) / thrust / np.sqrt(1.0 - sine**2)
    pitch_rate = (rate[:, 0] * f[:, 2] - f[:, 0] * rate[:, 2]) / (f[:, 0] ** 2 + f[:, 2] ** 2)
    references = [
        (angle + lag.time_constant * angle_rate) / lag.gain
        for angle, angle_rate, lag in (
            (roll, roll_rate, vehicle.roll),
            (pitch, pitch_rate, vehicle.pitch),
        )
    ]
    return np.stack([thrust, *references], axis=1)


def _turned(vectors: np.ndarray, heading: float) -> np.ndarray:
    """Return vectors (M, 3) of the leg's frame in the world's."""
    c, s = np.cos(heading), np.sin(heading)
    return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
