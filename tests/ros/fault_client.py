# SPDX-License-Identifier: MIT
"""Injects faults into a simulator that hovers, and prints what each of them showed, as JSON."""

import json
import sys
import time

import rospy
from foreign_client import Client
from std_srvs.srv import SetBool

from nmpc_msgs.msg import FaultArray
from nmpc_msgs.srv import ClearFault, InjectFault, SetSpeed, StepTime

SERVICES = {
    "inject_fault": InjectFault,
    "clear_fault": ClearFault,
    "pause": SetBool,
    "step": StepTime,
    "set_speed": SetSpeed,
}


class FaultClient(Client):
    """A foreign client that can also reach into the simulator."""

    def __init__(self):
        super().__init__()
        for name, kind in SERVICES.items():
            rospy.wait_for_service(f"uav_sim/{name}", 20.0)
            self.call[name] = rospy.ServiceProxy(f"uav_sim/{name}", kind)
        self.active = None
        rospy.Subscriber("uav_sim/faults", FaultArray, self._on_faults)
        self.wait(lambda: self.active is not None, 5.0)

    def _on_faults(self, message):
        self.active = [fault.fault for fault in message.faults]

    def shows(self, kind, parameters, condition):
        """Return [injected, on the topic, effect, no effect once cleared]."""
        injected = self.call["inject_fault"](kind, parameters, 0.0, 0.0)
        listed = self.wait(lambda: kind in self.active, 2.0)
        during = self.wait(condition, 3.0)
        self.call["clear_fault"](injected.id)
        after = self.wait(lambda: not condition(), 3.0)
        return [injected.success, listed, during, after]

    def arrived(self, name):
        """Return how many messages of a topic come in 0.1 s."""
        before = self.count[name]
        rospy.sleep(0.1)
        return self.count[name] - before


def frozen(client):
    """Whether the stamps go on while the value stays, over 0.1 s."""
    before = client.newest["attitude"]
    rospy.sleep(0.1)
    now = client.newest["attitude"]
    return now.header.stamp > before.header.stamp and now.quaternion == before.quaternion


def refused(client):
    client.call["sdk_control_authority"](0)
    return client.call["sdk_control_authority"](1).ack_data == 6


def faults(client):
    """One fault after the other, each cleared again."""
    call, newest = client.call, client.newest
    call["set_local_pos_ref"]()
    client.wait(lambda: client.count["local_position"] > 0, 5.0)
    call["sdk_control_authority"](1)
    call["inject_fault"]("rc_sticks", "{yaw: 0.5}", 0.0, 0.0)  # something moves all the time
    return {
        "topic_dropped": client.shows(
            "topic_dropped", "{topic: velocity}", lambda: client.arrived("velocity") == 0
        ),
        "topic_nan": client.shows(
            "topic_nan",
            "{topic: velocity}",
            lambda: newest["velocity"].vector.x != newest["velocity"].vector.x,
        ),
        "topic_jump": client.shows(
            "topic_jump",
            "{topic: local_position, offset: [30, 0, 0]}",
            lambda: newest["local_position"].point.x > 20.0,
        ),
        "authority_refused": client.shows("authority_refused", "{ack: 6}", lambda: refused(client)),
        "rc_mode": client.shows("rc_mode", "{mode: P}", lambda: newest["rc"].axes[4] == -8000.0),
        "rc_off": client.shows("rc_off", "", lambda: newest["rc"].axes[5] == 0.0),
        "gps_lost": client.shows("gps_lost", "", lambda: newest["gps_health"].data == 0),
        "battery_low": client.shows(
            "battery_low", "{percent: 12}", lambda: newest["battery_state"].percentage == 12.0
        ),
        "topic_frozen": client.shows("topic_frozen", "{topic: attitude}", lambda: frozen(client)),
        "wind_gust": client.shows(
            "wind_gust",
            "{velocity: [12, 0, 0], rise: 0.1}",
            lambda: newest["velocity"].vector.x > 0.15,
        ),
    }


def bad_requests(client):
    """Return the words of refusals."""
    inject = client.call["inject_fault"]
    return [
        inject(*request).message
        for request in (
            ("frozen", "", 0.0, 0.0),
            ("topic_frozen", "topic: [", 0.0, 0.0),
            ("rc_mode", "{mode: X}", 0.0, 0.0),
            ("rc_off", "", float("nan"), 0.0),
        )
    ] + [client.call["clear_fault"]("nobody").message]


def passing(client):
    """Pause, step, speed: simulated time as the clock shows it."""
    call = client.call
    call["pause"](True)
    time.sleep(0.1)
    before = rospy.Time.now().to_sec()
    time.sleep(0.3)
    stood = rospy.Time.now().to_sec() - before
    stepped = call["step"](25)
    deadline = time.monotonic() + 2.0
    while rospy.Time.now().to_sec() < before + 0.245 and time.monotonic() < deadline:
        time.sleep(0.01)
    moved = rospy.Time.now().to_sec() - before
    call["set_speed"](3.0)
    call["pause"](False)
    begin, wall = rospy.Time.now().to_sec(), time.monotonic()
    time.sleep(1.0)
    speed = (rospy.Time.now().to_sec() - begin) / (time.monotonic() - wall)
    refusals = [call["step"](1).success, call["set_speed"](-1.0).success]
    call["set_speed"](1.0)
    return {
        "stood": stood,
        "stepped": [stepped.success, stepped.time - before, moved],
        "speed": speed,
        "refusals": refusals,
    }


def main():
    rospy.init_node("fault_client")
    client = FaultClient()
    result = {
        "faults": faults(client),
        "refused": bad_requests(client),
        "time": passing(client),
    }
    sys.stdout.write(json.dumps(result) + "\n")
    sys.stdout.flush()
    client.call["inject_fault"]("node_killed", "", 0.0, 0.0)


if __name__ == "__main__":
    main()
