# SPDX-License-Identifier: MIT
"""Other vehicles of the same sky are obstacles of this one."""

import pytest

from nmpc_control.errors import ConfigError

pytestmark = [pytest.mark.ros, pytest.mark.long]


def test_predictions_and_odometry_of_others_become_obstacles(ros):
    ros.start("rosrun", "nmpc_control", "nmpc_traffic", "__ns:=/dji1", "_others:=/dji2,/dji3")
    ros.wait_for_node("/dji1/nmpc_traffic")
    seen = ros.run_json("traffic_client.py")
    assert seen["ids"] == ["dji2", "dji3"]
    assert seen["path"] == pytest.approx([5.1, 5.2, 5.3, 0.1])
    size, x, speed, age = seen["dji2"]
    assert (size, x, speed) == ([0.5], 5.0, 1.0)
    assert 0.0 <= age < 0.5
    assert seen["dji3"] == pytest.approx([10.0, 1.0, -2.0, 0.0], abs=1e-6)
    assert seen["silent"] == [5.0, "dji2", 2]
    assert seen["left"] == ["dji3"], "the silent one is forgotten when an operator says so"


@pytest.mark.parametrize("others", ["", " , ", "/dji2,dji2", "/dji2,/dji1"])
def test_a_useless_list_of_others_is_refused(others):
    pytest.importorskip("nmpc_msgs", reason="the workspace is not built or not sourced")
    from nmpc_control.ros.traffic_node import other_namespaces

    assert other_namespaces("dji2, /fleet/dji3/", "/dji1/") == ["/dji2", "/fleet/dji3"]
    with pytest.raises(ConfigError, match="parameter: ~others"):
        other_namespaces(others, "/dji1/")
