# SPDX-License-Identifier: MIT
"""What comes on `obstacles` is believed as far as it deserves, by controller and guard alike."""

import pytest

pytestmark = [pytest.mark.ros, pytest.mark.long]

NODES = ("flight_guard", "nmpc_controller")


@pytest.fixture
def nodes(ros):
    """Controller and guard, without an aircraft."""
    for name in NODES:
        ros.start("rosrun", "nmpc_control", name, "_vehicle:=dji_hil")
    for name in NODES:
        ros.wait_for_node(f"/{name}")
    return ros


def test_bad_lists_are_counted_and_good_ones_are_taken_from_any_frame(nodes):
    seen = nodes.run_json("obstacle_client.py", "bad_lists", "other_frames", "services", timeout=90)
    check_bad_lists(seen["bad_lists"])
    check_other_frames(seen["other_frames"])
    check_services(seen["services"])
    log = nodes.output()
    assert "Traceback" not in log
    assert log.count("obstacles rejected: /obstacle_client: frame 'nowhere'") == 2
    assert "sends std_msgs/String, or another version of it" in log


def check_bad_lists(seen):
    for node in NODES:
        rejected = {k[10:]: int(v) for k, v in seen[node].items() if k.startswith("rejected")}
        assert rejected.pop("duplicate id") == 3
        assert rejected.pop("not finite") == 3
        rejected.pop("type", None)
        assert rejected == {
            "size": 1,
            "speed": 1,
            "id": 1,
            "position": 1,
            "frame": 2,
            "unreadable": 1,
            "too old": 1,
            "from the future": 1,
        }
        assert seen[node]["senders"] == "/obstacle_client"
    assert "/obstacle_client reported moving obstacles and is silent for 2." in seen["stale"]
    assert seen["bird"] == pytest.approx(30.0, abs=1.0)
    assert seen["afterwards"].startswith("0 known, 0 of them moving")


def check_other_frames(seen):
    assert seen["wall"] == [pytest.approx([2, 1, 3]), pytest.approx([10, 5, 1])]
    x, z, *velocity = seen["bird"]
    assert (x, z) == pytest.approx((-2.0, 2.0))
    assert velocity == pytest.approx([0.0, 1.0], abs=1e-9)
    assert seen["path"] == pytest.approx([-2.0, 2.0])


def check_services(seen):
    assert seen["known"] == ["crane", "mast", "mast@/obstacle_client", "tree"]
    assert seen["mast"] == 8.0
    assert seen["left"] == ["crane"]
    assert seen["answers"] == [
        [True, "added: sphere 'mast' at (20.00, 1.00, 2.00) m in world"],
        [True, "changed: sphere 'mast' at (8.00, 1.00, 2.00) m in world"],
        [True, "added: sphere 'crane' at (20.00, 1.00, 2.00) m in world"],
        [
            False,
            "'bird' is not added, it moves: only a node that goes on publishing `obstacles` can say"
            " where it is",
        ],
        [
            False,
            "'thin' cannot be used: size; [radius] of a sphere, [radius, height] of a cylinder, "
            "[x, y, z] of a box, in m and > 0",
        ],
        [False, "'tree' was not added here: who told of it, as the scenario, keeps it"],
        [True, "removed: 'mast'"],
        [
            True,
            "forgotten: 2 from /obstacle_client; its next message makes its own known again",
        ],
        [True, "removed: 'crane'"],
        [False, "none was added"],
        [False, "nothing is known from /nobody"],
    ]


def test_who_does_not_go_on_is_stale_unless_the_list_is_latched(nodes):
    seen = nodes.run_json("obstacle_client.py", "senders", timeout=90)["senders"]
    assert seen["latched"] == "1 known, 0 of them moving"
    assert "/obstacle_client reported obstacles and is silent for 2." in seen["silent"]
    assert seen["empty"] == "1 known, 0 of them moving"
    assert seen["removed"].startswith("forgotten: 0 from /obstacle_client")


@pytest.mark.alone
def test_a_flood_does_not_slow_the_guard_down(nodes):
    seen = nodes.run_json("obstacle_client.py", "flood", timeout=90)["flood"]
    before, during = seen["before"], seen["during"]
    assert seen["rejected"] > 50
    assert during["rate"] > 0.95 * before["rate"]
    assert during["p99"] < before["p99"] + 0.015
    assert during["longest"] < before["longest"] + 0.03
