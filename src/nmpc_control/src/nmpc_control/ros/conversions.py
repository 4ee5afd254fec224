# SPDX-License-Identifier: MIT
"""Messages to core types and back; positions in metres in the world frame (ENU), angles in radians.

What comes in is judged before it is believed: sizes, shapes, frames, finite numbers. MessageError
says in one line what is wrong. Nothing here reaches the solver, the guard uses this module too.
"""

import math
from typing import Optional, Protocol, Sequence, Tuple

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

MAX_OBSTACLES = 256  # [1] in one message
_SHAPES = {
    ObstacleMsg.SPHERE: ("sphere", 1),
    ObstacleMsg.CYLINDER: ("cylinder", 2),
    ObstacleMsg.BOX: ("box", 3),
}
_SHAPE_VALUES = {name: value for value, (name, _) in _SHAPES.items()}


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
    )
    return plan, Goal(message.goal)


def plan_to_msg(step: Solved, header: Header, deadline_misses: int) -> PlanMsg:
    """Return the message of a control step; the header's stamp is the plan's time."""
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
        deadline_misses=deadline_misses,
    )


def prediction_to_msg(step: Solved, header: Header) -> Prediction:
    """Return the plan in a form that people and tools can read."""
    plan = step.plan
    times = plan.t + plan.delay + plan.dt * np.arange(plan.horizon + 1)
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


def obstacles_from_msg(
    message: ObstacleArray, frame_id: Optional[str] = None
) -> Tuple[Obstacle, ...]:
    """Return the obstacles of a message; one that does not move carries no time.

    Args:
        message: as received.
        frame_id: the frame that is expected; None accepts any.

    Raises:
        MessageError: another frame, too many, or one with impossible numbers: then none is taken.
    """
    if frame_id is not None:
        _require_frame(message.header, frame_id)
    if len(message.obstacles) > MAX_OBSTACLES:
        raise MessageError(f"{len(message.obstacles)} obstacles, at most {MAX_OBSTACLES} are taken")
    return tuple(_obstacle(o, message.header.stamp.to_sec()) for o in message.obstacles)


def obstacles_to_msg(obstacles: Sequence[Obstacle], header: Header) -> ObstacleArray:
    """Return a message of the obstacles where they are at the header's stamp."""
    t = header.stamp.to_sec()
    return ObstacleArray(
        header=header,
        obstacles=[
            ObstacleMsg(
                id=obstacle.id,
                shape=_SHAPE_VALUES[obstacle.shape],
                size=list(obstacle.size),
                position=Point(*obstacle.position_at(t)),
                velocity=Vector3(*obstacle.velocity),
            )
            for obstacle in obstacles
        ],
    )


def _obstacle(message: ObstacleMsg, stamp: float) -> Obstacle:
    shape, length = _SHAPES.get(message.shape, (None, 0))
    if shape is None:
        raise MessageError(f"obstacle {message.id!r} with unknown shape {message.shape}")
    size = np.array(message.size, dtype=float)
    position = np.array([message.position.x, message.position.y, message.position.z])
    velocity = np.array([message.velocity.x, message.velocity.y, message.velocity.z])
    if len(size) != length or not (np.isfinite(size).all() and (size > 0.0).all()):
        expected = f"{length} positive number{'s' if length > 1 else ''}"
        raise MessageError(f"{shape} {message.id!r} with size {size.tolist()}, expected {expected}")
    if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
        raise MessageError(f"{shape} {message.id!r} with position or velocity that is not finite")
    moves = bool(velocity.any())
    if moves and stamp <= 0.0:
        raise MessageError(f"{shape} {message.id!r} moves, but its message has no stamp")
    return Obstacle(message.id, position, size, shape, velocity, stamp if moves else None)


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
