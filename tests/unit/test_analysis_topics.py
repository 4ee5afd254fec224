# SPDX-License-Identifier: MIT
"""Which topics of a bag belong to the vehicle."""

from types import SimpleNamespace

from nmpc_control.analysis.topics import ROLES, select


def connections(*topics_and_roles):
    return [
        SimpleNamespace(topic=topic, msgtype=ROLES[role].msgtype, msgcount=10)
        for topic, role in topics_and_roles
    ]


def test_the_simulators_own_obstacles_are_no_second_vehicle():
    chosen = select(
        connections(
            ("/nmpc/odometry", "odometry"),
            ("/obstacles", "sensed_obstacles"),
            ("/uav_sim/obstacles", "sensed_obstacles"),
            ("/uav_sim/ground_truth", "truth"),
        )
    )
    assert chosen.remarks == ()
    assert chosen.is_simulation


def test_two_vehicles_are_told():
    chosen = select(
        connections(("/dji1/nmpc/odometry", "odometry"), ("/dji2/nmpc/odometry", "odometry"))
    )
    assert any("several vehicles" in remark for remark in chosen.remarks)
