# SPDX-License-Identifier: MIT
"""Messages to core types and back; positions in metres in the world frame (ENU), angles in radians.

What comes in is judged before it is believed: sizes, shapes, frames, finite numbers. MessageError
says in one line what is wrong. Nothing here reaches the solver, the guard uses this module too.
"""

import math
from typing import Protocol, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from nmpc_control.errors import NmpcError
from nmpc_control.obstacle import Obstacle
from nmpc_control.plan_check import MAX_HORIZON
from nmpc_control.rotations import quaternion_from_rpy
from nmpc_control.state import ATTITUDE, NU, NX, POSITION, VELOCITY, YAW_RATE, Goal, Plan
from nmpc_msgs.msg import ControlInput, ObstacleArray, Prediction
from nmpc_msgs.msg import Obstacle as ObstacleMsg
from nmpc_msgs.msg import Plan as PlanMsg

_MOST_POINTS = 20  # [1] of a path that is published
_SHAPE_VALUES = {
    "sphere": ObstacleMsg.SPHERE,
    "cylinder": ObstacleMsg.CYLINDER,
    "box": ObstacleMsg.BOX,
}


class MessageError(NmpcError):
    """A message cannot be used; the text says why."""


class Solved(Protocol):
    """What of a control step is published as a plan."""

    plan: Plan
    goal: Goal
    stage_references: np.ndarray  # (N + 1, 10)
    reference_time: float  # [s]
    predicted_clearance: float  # [m]


def plan_from_msg(message: PlanMsg, frame_id: str) -> Tuple[Plan, Goal]:
    """Return plan and goal of a message.

    Raises:
        MessageError: another frame, an unknown goal, or array lengths that contradict the horizon.
    """
    _require_frame(message.header, frame_id)
    N = message.horizon
    if not 1 <= N <= MAX_HORIZON:
        raise MessageError(f"plan with a horizon of {N}, expected 1 to {MAX_HORIZON}")
    if len(message.states) != (N + 1) * NX or len(message.inputs) != N * NU:
        lengths = f"{len(message.states)} states and {len(message.inputs)} inputs"
        raise MessageError(f"plan with {lengths} for a horizon of {N}")
    if message.goal not in iter(Goal):
        raise MessageError(f"plan with unknown goal {message.goal}")
    plan = Plan(
        t=message.header.stamp.to_sec(),
        dt=message.dt,
        delay=message.delay,
        states=np.array(message.states, dtype=float).reshape(N + 1, NX),
        inputs=np.array(message.inputs, dtype=float).reshape(N, NU),
        found=message.found,
        status=message.solver_status,
        iterations=message.iterations,
        solve_time=message.solve_time,
        cost=message.cost,
        kkt_residual=message.kkt_residual,
        state_t=message.state_stamp.to_sec() or math.nan,
    )
    return plan, Goal(message.goal)


def plan_to_msg(
    step: Solved, header: Header, deadline_misses: int, state_stamp: float, tick_time: float
) -> PlanMsg:
    """Return the message of a control step; the header's stamp is the plan's time.

    Args:
        step: what was solved.
        header: of the message.
        deadline_misses: [1] since the node started.
        state_stamp: [s] of the newest telemetry that it was made from.
        tick_time: [s] wall time that the step has taken.
    """
    plan = step.plan
    return PlanMsg(
        header=header,
        found=plan.found,
        solver_status=plan.status,
        goal=int(step.goal),
        delay=plan.delay,
        dt=plan.dt,
        horizon=plan.horizon,
        states=plan.states.ravel().tolist(),
        inputs=plan.inputs.ravel().tolist(),
        references=step.stage_references[:, POSITION].ravel().tolist(),
        reference_time=step.reference_time,
        iterations=plan.iterations,
        solve_time=plan.solve_time,
        cost=plan.cost,
        kkt_residual=plan.kkt_residual,
        predicted_clearance=step.predicted_clearance,
        state_stamp=_time(state_stamp),
        tick_time=tick_time,
        deadline_misses=deadline_misses,
    )


def refusal_to_msg(sentence: str, header: Header, state_stamp: float) -> PlanMsg:
    """Return the message that says why there is no plan, with the stamp of what telemetry came."""
    return PlanMsg(
        header=header,
        found=False,
        solver_status=sentence,
        dt=1.0,
        horizon=1,
        states=[0.0] * 2 * NX,
        inputs=[0.0] * NU,
        references=[0.0] * 6,
        reference_time=math.nan,
        predicted_clearance=math.nan,
        state_stamp=_time(state_stamp),
    )


def prediction_to_msg(step: Solved, header: Header) -> Prediction:
    """Return the plan in a form that people and tools can read."""
    plan = step.plan
    times = plan.times
    stamps = [rospy.Time.from_sec(t) for t in times]
    return Prediction(
        header=Header(stamp=stamps[0], frame_id=header.frame_id),
        stamps=stamps,
        poses=[_pose(x) for x in plan.states],
        twists=[Twist(Vector3(*x[VELOCITY]), Vector3(0.0, 0.0, x[YAW_RATE])) for x in plan.states],
        inputs=[ControlInput(*u) for u in plan.inputs],
        references=[Point(*x[POSITION]) for x in step.stage_references],
    )


def odometry_to_msg(x: np.ndarray, header: Header, base_frame: str) -> Odometry:
    """Return a state (10,) as odometry: pose in the header's frame, twist in body axes.

    Of the angular velocity only what the yaw rate causes is known; roll and pitch rates count as 0.
    """
    roll, pitch, _ = x[ATTITUDE]
    yaw_rate = x[YAW_RATE]
    message = Odometry(header=header, child_frame_id=base_frame)
    message.pose.pose = _pose(x)
    message.twist.twist.linear = Vector3(*_to_body(x[VELOCITY], *x[ATTITUDE]))
    message.twist.twist.angular = Vector3(
        -yaw_rate * math.sin(pitch),
        yaw_rate * math.sin(roll) * math.cos(pitch),
        yaw_rate * math.cos(roll) * math.cos(pitch),
    )
    return message


def obstacles_to_msg(obstacles: Sequence[Obstacle], header: Header) -> ObstacleArray:
    """Return a message of the obstacles where they are at the header's stamp.

    Paths are given from then on, with at most 20 points; of one that stands still no velocity.
    """
    t = header.stamp.to_sec()
    return ObstacleArray(header=header, obstacles=[_obstacle_to_msg(o, t) for o in obstacles])


def _obstacle_to_msg(obstacle: Obstacle, t: float) -> ObstacleMsg:
    message = ObstacleMsg(
        id=obstacle.id,
        shape=_SHAPE_VALUES[obstacle.shape],
        size=list(obstacle.size),
        position=Point(*obstacle.position_at(t)),
    )
    if obstacle.stamp is not None:
        message.velocity = Vector3(*obstacle.velocity)
        message.uncertainty_growth = obstacle.growth
        if obstacle.path is not None:
            stride = -(-len(obstacle.path) // _MOST_POINTS)
            message.predicted_dt = stride * obstacle.path_dt
            ahead = np.arange(1, len(obstacle.path) // stride + 1) * message.predicted_dt
            message.predicted_path = [Point(*p) for p in obstacle.position_at(t + ahead)]
    return message


def _time(t: float) -> rospy.Time:
    """Return a stamp [s]; 0 where it is not known."""
    return rospy.Time.from_sec(t) if math.isfinite(t) else rospy.Time(0)


def _pose(x: np.ndarray) -> Pose:
    return Pose(Point(*x[POSITION]), Quaternion(*quaternion_from_rpy(*x[ATTITUDE])))


def _to_body(
    vector: Sequence[float], roll: float, pitch: float, yaw: float
) -> Tuple[float, float, float]:
    x, y, z = vector
    x, y = math.cos(yaw) * x + math.sin(yaw) * y, math.cos(yaw) * y - math.sin(yaw) * x
    x, z = math.cos(pitch) * x - math.sin(pitch) * z, math.cos(pitch) * z + math.sin(pitch) * x
    return x, math.cos(roll) * y + math.sin(roll) * z, math.cos(roll) * z - math.sin(roll) * y


def _require_frame(header: Header, frame_id: str) -> None:
    if header.frame_id != frame_id:
        raise MessageError(f"message in frame {header.frame_id!r}, expected {frame_id!r}")
