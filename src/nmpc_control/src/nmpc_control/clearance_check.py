# SPDX-License-Identifier: MIT
"""How near a path in time comes to obstacles, all of them at once, and whether it is too near.

An obstacle is where it is expected at each time, and as much larger as its information is old now:
how much larger it may be by the time it is met is the planner's concern. The guard looks again
at every tick, and one that refused to hover because what it knows will be old would gain nothing.
"""

import math
from dataclasses import replace
from typing import NamedTuple, Sequence, Tuple, Union

import numpy as np

from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Vehicle
from nmpc_control.state import POSITION, VELOCITY, Plan
from nmpc_control.verdict import NOT_INSIDE, Finding, Inside, PlanCheckParameters, Verdict

SPACING = 0.05  # [m] of the points between two stages at which clearance is looked at
MAX_POINTS = 40  # [1] between two stages
ENOUGH = 1.0  # [m] clearances below it are told exactly, whichever minimum is asked for

Obstacles = Union[Sequence[Obstacle], ObstacleField]


class Approach(NamedTuple):
    """How near a path comes to the n obstacles that matter on it, at M times."""

    ids: Tuple[str, ...]
    times: np.ndarray  # (M,) [s]
    clearance: np.ndarray  # (n, M) [m] hull to surface where it is expected then
    growth: np.ndarray  # (n,) [m] by which it may be larger, by the age of the information now
    points: np.ndarray  # (M, 3) [m] centres of the hull

    @property
    def grown(self) -> np.ndarray:
        """Clearance (n, M) [m] from the surfaces as far out as they may be."""
        return self.clearance - self.growth[:, None]


def as_field(obstacles: Obstacles) -> ObstacleField:
    """Return obstacles as arrays."""
    return obstacles if isinstance(obstacles, ObstacleField) else ObstacleField(obstacles)


def approach(
    points: np.ndarray,
    times: np.ndarray,
    t: float,
    obstacles: ObstacleField,
    radius: float,
    reach: float,
) -> Approach:
    """Return how near a path comes to the obstacles that matter on it.

    These are all that it may pass at less than ``reach``, and the nearest one: spheres around all
    of them and the given points are looked at first, and only what these leave open point by point.

    Args:
        points: (K, 3) [m] centres of the hull; between them it flies straight.
        times: (K,) [s] of the points, not falling.
        t: [s] now, for the age of the information.
        obstacles: whose numbers are finite.
        radius: [m] of the hull.
        reach: [m] hull to surface.
    """
    for bound in (_bound_as_one, _bound_by_points):
        if len(obstacles) > 1:
            least = bound(points, times, t, obstacles) - radius
            obstacles = _narrowed(points, times, t, obstacles, radius, reach, least)
    return _refined(points, times, t, obstacles, radius)


def _narrowed(
    points: np.ndarray,
    times: np.ndarray,
    t: float,
    obstacles: ObstacleField,
    radius: float,
    reach: float,
    least: np.ndarray,
) -> ObstacleField:
    """Return those that matter, given what the clearances (n,) [m] are at least."""
    closest = int(np.argmin(least))
    only = obstacles.part(np.array([closest]))
    nearest = float(_refined(points, times, t, only, radius).grown.min())
    # what follows a path of its own may leave the straight line that the bound takes
    keep = (least < max(reach, nearest)) | obstacles.has_path
    keep[closest] = True
    if keep.all():
        return obstacles
    return obstacles.part(np.nonzero(keep)[0])


def _bound_as_one(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField
) -> np.ndarray:
    """Return the least distance (n,) [m] to surfaces by one sphere around the whole path."""
    middle = len(times) // 2
    ends = obstacles.centres(times[[0, middle, -1]])
    travel = _lengths(ends - ends[:, 1:2]).max(axis=1)
    extent = float(_lengths(points - points[middle]).max())
    distance = _lengths(ends[:, 1] - points[middle]) - extent - travel
    return distance - obstacles.bounding - obstacles.growth(np.array([t]))[:, 0]


def _bound_by_points(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField
) -> np.ndarray:
    """Return the least distance (n,) [m] to surfaces by spheres around them and each point."""
    relative = points - obstacles.centres(times)
    chord = _lengths(np.diff(relative, axis=1)).max(axis=1, initial=0.0)
    distance = _lengths(relative).min(axis=1) - chord / 2
    return distance - obstacles.bounding - obstacles.growth(np.array([t]))[:, 0]


def _refined(
    points: np.ndarray, times: np.ndarray, t: float, obstacles: ObstacleField, radius: float
) -> Approach:
    """Return the approach to all of the obstacles, at points at most ``SPACING`` apart."""
    chords = _lengths(np.diff(points - obstacles.centres(times), axis=1))
    count = math.ceil(min(max(1.0, float(chords.max(initial=0.0)) / SPACING), MAX_POINTS))
    stages = np.arange(len(times))
    fine = np.linspace(0, len(times) - 1, count * (len(times) - 1) + 1)
    fine_times = np.interp(fine, stages, times)
    fine_points = np.stack([np.interp(fine, stages, points[:, i]) for i in range(3)], axis=1)
    distance = obstacles.distances(fine_points, fine_times) + obstacles.growth(fine_times)
    growth = obstacles.growth(np.array([t]))[:, 0]
    return Approach(obstacles.ids, fine_times, distance - radius, growth, fine_points)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def check_clearance(
    plan: Plan,
    t: float,
    vehicle: Vehicle,
    obstacles: Obstacles,
    params: PlanCheckParameters,
    before: Inside = NOT_INSIDE,
) -> Verdict:
    """Return whether the plan from ``t`` [s] on keeps clear of the obstacles as predicted now.

    The hull must be free. Where it is nearer than the minimum now, it may not come nearer than
    where it came in less the tolerance, so that the way out is open; where it touches by the
    estimate, or has been pushed deeper than that, the plan must lead out. Being within what an
    obstacle may have grown to counts as being too near, not as touching it: staying is allowed.

    Args:
        plan: consistent, and beginning where the aircraft is.
        t: [s] now.
        vehicle: for the hull.
        obstacles: as known now.
        params: tolerances.
        before: where the aircraft was too near already, and since when.
    """
    known = as_field(obstacles)
    if known.unusable:
        sentence = f"obstacle {known.unusable[0]} is nowhere: its numbers are not finite"
        return Verdict(Finding.CLEARANCE, sentence, math.nan, plan, math.nan)
    stages = plan.t + plan.delay + plan.dt * np.arange(len(plan.states))
    start = min(max(t, stages[0]), stages[-1])
    rest = stages > start
    here = [np.interp(start, stages, plan.states[:, i]) for i in range(3)]
    points = np.concatenate([[here], plan.states[rest][:, POSITION]])
    times = np.concatenate([[start], stages[rest]])
    reach = max(params.minimum_clearance, ENOUGH)
    way = approach(points, times, t, known, vehicle.radius, reach)
    return _judged(way, max(t, stages[0]) + params.clearance_horizon, params, before, plan)


def _said(plan: Plan) -> str:
    """Return that the plan is verified, and what its solver remarks on it, as held up by what."""
    remark = plan.status.partition(", ")[2]
    return f"the plan is verified, {remark}" if remark else "the plan is verified"


def _judged(
    way: Approach, until: float, params: PlanCheckParameters, before: Inside, plan: Plan
) -> Verdict:
    ahead = way.clearance[:, way.times <= until]
    now, nearest, last = way.clearance[:, 0], ahead.min(axis=1, initial=math.inf), ahead[:, -1]
    is_inside = now - way.growth < params.minimum_clearance
    inside = Inside({way.ids[i]: float(now[i]) for i in np.nonzero(is_inside)[0]})
    speed = 0.0
    if len(way.ids):
        k = int(way.grown[:, : ahead.shape[1]].min(axis=0).argmin())
        speed = float(np.linalg.norm(plan.state_at(way.times[k])[VELOCITY]))
    too_near = (ahead - way.growth[:, None] < params.minimum_clearance).any(axis=0)
    verdict = Verdict(
        Finding.OK,
        _said(plan),
        clearance=float(way.grown.min(initial=math.inf)),
        flown=plan,
        nearest=float((nearest - way.growth).min(initial=math.inf)),
        speed=speed,
        inside=inside,
        conflict=float(way.times[too_near.argmax()]) if too_near.any() else math.inf,
    )
    for i, (name, growth) in enumerate(zip(way.ids, way.growth)):
        floor = before.clearance.get(name, now[i]) - params.growth_tolerance
        if now[i] < 0.0 or (is_inside[i] and now[i] < floor):
            if nearest[i] < now[i] - params.growth_tolerance or last[i] <= now[i]:
                sentence = f"the plan leads deeper into obstacle {name}"
                return replace(verdict, finding=Finding.COLLISION, sentence=sentence)
            continue
        tolerated = now[i] - params.growth_tolerance
        free, tolerated = (0.0, floor) if is_inside[i] else (growth, tolerated)
        if nearest[i] < free:
            sentence = f"the plan hits obstacle {name} by {free - nearest[i]:.2f} m"
            return replace(verdict, finding=Finding.COLLISION, sentence=sentence)
        if nearest[i] < min(params.minimum_clearance + growth, tolerated):
            sentence = f"the plan passes obstacle {name} at {nearest[i] - growth:.2f} m"
            return replace(verdict, finding=Finding.CLEARANCE, sentence=sentence)
    return verdict
