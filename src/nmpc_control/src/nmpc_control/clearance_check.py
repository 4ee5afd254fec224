# SPDX-License-Identifier: MIT
"""Whether a plan comes too near to obstacles.

How much larger an obstacle may be by the time it is met is the planner's concern. The guard looks
again at every tick, and one that refused to hover because what it knows will be old would gain
nothing.
"""

import math
from dataclasses import replace
from typing import Optional, Sequence, Tuple, Union

import numpy as np

from nmpc_control.approach import Approach, approach
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import ObstacleField
from nmpc_control.params import Vehicle
from nmpc_control.state import POSITION, VELOCITY, Plan
from nmpc_control.verdict import NOT_INSIDE, Finding, Inside, PlanCheckParameters, Verdict

ALIKE = 0.03  # [m] a way around something is as near for long: its speed there is the greatest
ENOUGH = 1.0  # [m] clearances below it are told exactly, whichever minimum is asked for

Obstacles = Union[Sequence[Obstacle], ObstacleField]


def as_field(obstacles: Obstacles) -> ObstacleField:
    """Return obstacles as arrays."""
    return obstacles if isinstance(obstacles, ObstacleField) else ObstacleField(obstacles)


def check_clearance(
    plan: Plan,
    t: float,
    vehicle: Vehicle,
    obstacles: Obstacles,
    params: PlanCheckParameters,
    before: Inside = NOT_INSIDE,
    way: Optional[Approach] = None,
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
        way: that of an earlier verdict on the same plan, where the obstacles are still the same.
    """
    known = as_field(obstacles)
    if known.unusable:
        sentence = f"obstacle {known.unusable[0]} is nowhere: its numbers are not finite"
        return Verdict(Finding.CLEARANCE, sentence, math.nan, plan, math.nan)
    stages = plan.times
    start = min(max(t, stages[0]), stages[-1])
    if way is None:
        reach = max(params.minimum_clearance, ENOUGH)
        way = approach(*_path(plan, stages, start), t, known, vehicle.radius, reach)
    else:
        way = way.rest(start, t)
    return _judged(way, max(t, stages[0]) + params.clearance_horizon, params, before, plan)


def _path(plan: Plan, stages: np.ndarray, start: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return the positions (K, 3) [m] of a plan from ``start`` [s] on, and their times (K,) [s]."""
    rest = stages > start
    here = [np.interp(start, stages, plan.states[:, i]) for i in range(3)]
    points = np.concatenate([[here], plan.states[rest][:, POSITION]])
    return points, np.concatenate([[start], stages[rest]])


def _said(plan: Plan) -> str:
    """Return that the plan is verified, and what its solver remarks on it, as held up by what."""
    remark = plan.status.partition(", ")[2]
    return f"the plan is verified, {remark}" if remark else "the plan is verified"


def _speed_there(plan: Plan, times: np.ndarray) -> float:
    """Return the greatest speed [m/s] of a plan at some times (k,) [s]."""
    speeds = np.linalg.norm(plan.states[:, VELOCITY], axis=1)
    return float(np.interp(times, plan.times, speeds).max())


def _judged(
    way: Approach, until: float, params: PlanCheckParameters, before: Inside, plan: Plan
) -> Verdict:
    ahead = way.clearance[:, way.times <= until]
    now, nearest, last = way.clearance[:, 0], ahead.min(axis=1, initial=math.inf), ahead[:, -1]
    is_inside = now - way.growth < params.minimum_clearance
    inside = Inside({way.ids[i]: float(now[i]) for i in np.nonzero(is_inside)[0]})
    near = (ahead - way.growth[:, None]).min(axis=0, initial=math.inf)
    speed = _speed_there(plan, way.times[: len(near)][near <= near.min() + ALIKE])
    too_near = near < params.minimum_clearance
    verdict = Verdict(
        Finding.OK,
        _said(plan),
        clearance=float(way.grown.min(initial=math.inf)),
        flown=plan,
        nearest=float((nearest - way.growth).min(initial=math.inf)),
        speed=speed,
        inside=inside,
        conflict=float(way.times[too_near.argmax()]) if too_near.any() else math.inf,
        way=way,
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
