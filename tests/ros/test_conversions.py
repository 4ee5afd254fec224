# SPDX-License-Identifier: MIT
"""What goes through messages comes back the same, and what cannot be right is refused in words."""

import math
from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")

import rospy
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import Header

from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_sighting import fault, to_obstacle
from nmpc_control.ros.conversions import (
    MessageError,
    obstacles_to_msg,
    odometry_to_msg,
    plan_from_msg,
    plan_to_msg,
    prediction_to_msg,
    refusal_to_msg,
)
from nmpc_control.ros.obstacle_wire import WireError, read_head, read_obstacles
from nmpc_control.rotations import rpy_from_quaternion
from nmpc_control.state import Goal, Plan
from nmpc_msgs.msg import Obstacle as ObstacleMsg
from nmpc_msgs.msg import ObstacleArray

STAMP = rospy.Time(12, 500_000_000)
HEADER = Header(stamp=STAMP, frame_id="world")


@pytest.fixture
def step():
    rng = np.random.default_rng(1)
    plan = Plan(
        t=STAMP.to_sec(),
        dt=0.1,
        delay=0.14,
        states=rng.normal(size=(4, 10)),
        inputs=rng.normal(size=(3, 4)),
        status="converged",
        iterations=2,
        solve_time=0.003,
        cost=1.5,
        kkt_residual=1e-4,
    )
    return SimpleNamespace(
        plan=plan,
        goal=Goal.TRAJECTORY,
        stage_references=rng.normal(size=(4, 10)),
        reference_time=3.5,
        predicted_clearance=0.7,
    )


def over_the_wire(message):
    """Return the message after being written and read as bytes."""
    buffer = BytesIO()
    message.serialize(buffer)
    return type(message)().deserialize(buffer.getvalue())


def test_a_plan_comes_back_the_same(step):
    message = over_the_wire(plan_to_msg(step, HEADER, 4, 12.25, 0.003))
    plan, goal = plan_from_msg(message, "world")
    assert goal is Goal.TRAJECTORY
    np.testing.assert_array_equal(plan.states, step.plan.states)
    np.testing.assert_array_equal(plan.inputs, step.plan.inputs)
    for name in (
        "t",
        "dt",
        "delay",
        "found",
        "status",
        "iterations",
        "solve_time",
        "cost",
        "kkt_residual",
    ):
        assert getattr(plan, name) == getattr(step.plan, name)
    np.testing.assert_array_equal(
        np.reshape(message.references, (4, 3)), step.stage_references[:, :3]
    )
    assert (message.reference_time, message.deadline_misses) == (3.5, 4)
    assert (plan.state_t, message.tick_time) == (12.25, 0.003)


def test_why_there_is_no_plan_can_be_read_as_one_that_is_not_found():
    message = over_the_wire(refusal_to_msg("the state is 0.42 s old", HEADER, 12.25))
    plan, _ = plan_from_msg(message, "world")
    assert (plan.found, plan.status, plan.state_t) == (False, "the state is 0.42 s old", 12.25)
    unknown, _ = plan_from_msg(over_the_wire(refusal_to_msg("", HEADER, math.nan)), "world")
    assert math.isnan(unknown.state_t)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"horizon": 4}, "40 states and 12 inputs for a horizon of 4"),
        ({"horizon": 0}, "horizon of 0"),
        ({"horizon": 4_000_000_000}, "expected 1 to 1000"),
        ({"states": [0.0] * 39}, "39 states"),
        ({"inputs": []}, "0 inputs"),
        ({"goal": 7}, "unknown goal 7"),
        ({"header": Header(frame_id="map")}, "frame 'map', expected 'world'"),
    ],
)
def test_plans_that_cannot_be_right_are_refused(step, change, words):
    message = plan_to_msg(step, HEADER, 0, math.nan, 0.0)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(MessageError, match=words):
        plan_from_msg(message, "world")


def test_a_prediction_has_one_entry_for_each_stage(step):
    message = over_the_wire(prediction_to_msg(step, HEADER))
    counts = [len(a) for a in (message.stamps, message.poses, message.twists, message.references)]
    assert counts == [4, 4, 4, 4]
    assert len(message.inputs) == 3
    times = [stamp.to_sec() for stamp in message.stamps]
    assert times == pytest.approx(12.5 + 0.14 + 0.1 * np.arange(4))


def test_odometry_has_its_twist_in_body_axes():
    roll, pitch, yaw, yaw_rate = 0.2, -0.3, 2.0, 0.7
    velocity = np.array([1.0, -2.0, 0.5])
    x = np.array([1.0, 2.0, 3.0, roll, pitch, yaw, *velocity, yaw_rate])
    message = odometry_to_msg(x, HEADER, "base_link")
    q = message.pose.pose.orientation
    assert rpy_from_quaternion([q.x, q.y, q.z, q.w]) == pytest.approx((roll, pitch, yaw))
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    R_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    R_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    R_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    R_world_body = R_z @ R_y @ R_x
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    assert [linear.x, linear.y, linear.z] == pytest.approx(R_world_body.T @ velocity)
    turning = R_world_body.T @ [0.0, 0.0, yaw_rate]
    assert [angular.x, angular.y, angular.z] == pytest.approx(turning)
    assert message.child_frame_id == "base_link"


def read(message):
    """Return the entries of a message as a node reads them."""
    buffer = BytesIO()
    message.serialize(buffer)
    return read_obstacles(buffer.getvalue(), read_head(buffer.getvalue()))


def test_obstacles_come_back_the_same_and_moving_ones_where_they_are_by_then():
    ball = Obstacle("ball", np.array([1.0, 2.0, 3.0]), np.array([0.5]))
    moving = Obstacle(
        "bird", np.zeros(3), np.array([1.0, 2.0]), "cylinder", np.array([1.0, 0.0, 0.0]), 10.5
    )
    box = Obstacle("box", np.ones(3), np.array([1.0, 2.0, 3.0]), "box")
    sightings = read(obstacles_to_msg([ball, moving, box], HEADER))
    assert [fault(s) for s in sightings] == ["", "", ""]
    back = [to_obstacle(s, s.id) for s in sightings]
    assert [o.id for o in back] == ["ball", "bird", "box"]
    assert [o.shape for o in back] == ["sphere", "cylinder", "box"]
    assert [o.stamp for o in back] == [None, 12.5, None]
    np.testing.assert_array_equal(back[1].position, [2.0, 0.0, 0.0])
    for one, other in zip((ball, moving, box), back):
        np.testing.assert_array_equal(one.size, other.size)
        np.testing.assert_allclose(one.position_at(20.0), other.position_at(20.0))


def test_a_long_path_is_published_from_now_on_with_few_points():
    path = np.stack([0.1 * np.arange(1, 61), np.zeros(60), np.ones(60)], axis=1)
    bird = Obstacle(
        "bird", np.array([0.0, 0, 1]), np.ones(1), "sphere", np.array([1.0, 0, 0]), 12.0
    )
    bird = replace(bird, path=path, path_dt=0.1, growth=0.2)
    (sighting,) = read(obstacles_to_msg([bird], HEADER))
    back = to_obstacle(sighting, "bird")
    assert (len(back.path), back.path_dt, back.growth) == (20, pytest.approx(0.3), 0.2)
    times = np.linspace(12.5, 18.0, 30)
    np.testing.assert_allclose(back.position_at(times), bird.position_at(times), atol=1e-9)


NUMBERS = st.floats(allow_nan=False)
POINTS = st.lists(st.builds(Point, NUMBERS, NUMBERS, NUMBERS), max_size=3)
OBSTACLES = st.builds(
    ObstacleMsg,
    id=st.text(max_size=5),
    shape=st.integers(0, 4),
    size=st.lists(NUMBERS, max_size=4),
    position=st.builds(Point, NUMBERS, NUMBERS, NUMBERS),
    velocity=st.builds(Vector3, NUMBERS, NUMBERS, NUMBERS),
    predicted_path=POINTS,
    predicted_dt=NUMBERS,
    uncertainty_growth=NUMBERS,
    stamp=st.sampled_from([rospy.Time(), rospy.Time(7, 250_000_000)]),
)


@given(st.lists(OBSTACLES, max_size=3), st.text(max_size=5))
def test_bytes_are_read_as_the_generated_code_wrote_them(obstacles, frame):
    message = ObstacleArray(Header(stamp=STAMP, frame_id=frame), obstacles)
    assert read_head(serialized(message))[:3] == (12.5, frame, len(obstacles))
    for sighting, o in zip(read(message), obstacles):
        assert (sighting.id, sighting.size) == (o.id, tuple(o.size))
        assert sighting.shape == dict(enumerate(("sphere", "cylinder", "box"))).get(o.shape, "")
        assert sighting.position == (o.position.x, o.position.y, o.position.z)
        assert sighting.velocity == (o.velocity.x, o.velocity.y, o.velocity.z)
        assert sighting.path == tuple(x for p in o.predicted_path for x in (p.x, p.y, p.z))
        assert (sighting.path_dt, sighting.growth) == (o.predicted_dt, o.uncertainty_growth)
        assert sighting.stamp == (o.stamp.to_sec() or 12.5)


def serialized(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@given(st.data())
def test_bytes_that_contradict_themselves_end_in_words(data):
    whole = ObstacleMsg(id="bird", size=[0.3], predicted_path=[Point()])
    sent = serialized(ObstacleArray(Header(frame_id="world"), [whole, whole]))
    cut = data.draw(st.integers(0, len(sent) - 1))
    with pytest.raises(WireError, match="ends"):
        read_obstacles(sent[:cut], read_head(sent[:cut]))
    place = data.draw(st.integers(0, len(sent) - 1))
    spoilt = sent[:place] + data.draw(st.binary(min_size=1, max_size=4)) + sent[place:]
    try:
        head = read_head(spoilt)
        if head.count < 1000:
            [fault(s) for s in read_obstacles(spoilt, head)]
    except WireError:
        pass
