#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""An operator in whose flight processes end and topics fall silent; what was seen, as JSON.

Usage: process_client.py SITUATION..., one after the other, each a function below with `:ARGUMENT`
where it takes one. Each begins hovering; the client sees to that first.
"""

import json
import math
import os
import signal
import sys
import time
from xmlrpc.client import Error, ServerProxy

import rospy
from guard_client import MODES, Client
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger

from nmpc_control.ros.known_service import KnownService
from nmpc_msgs.msg import Plan
from nmpc_msgs.srv import ClearFault, InjectFault, RemoveObstacle

CALLER = "/process_client"
SERVICES = ("start", "hover", "land")
GONE = 2.0  # [s] of wall time after which what roslaunch starts again would be back


class Watcher(Client):
    """Keeps when commands and those of a bare 50 Hz process came, and finds NaN."""

    def __init__(self):
        self.came = {"commands": [], "bare": []}  # [s] steady clock
        self.not_finite = []
        super().__init__()
        rospy.Subscriber(
            "dji_sdk/flight_control_setpoint_generic",
            Joy,
            lambda m: self._note("commands", m.axes),
            queue_size=100,
            tcp_nodelay=True,
        )
        rospy.Subscriber(
            "bare_stream",
            Joy,
            lambda m: self._note("bare", m.axes),
            queue_size=100,
            tcp_nodelay=True,
        )
        rospy.Subscriber("nmpc/plan", Plan, self._on_plan, queue_size=100)
        self.inject = rospy.ServiceProxy("uav_sim/inject_fault", InjectFault)
        self.clear = rospy.ServiceProxy("uav_sim/clear_fault", ClearFault)
        self.forget = rospy.ServiceProxy("remove_obstacle", RemoveObstacle)
        self.services = {name: KnownService(name, Trigger) for name in SERVICES}

    def _note(self, name, numbers):
        self.came[name].append(time.monotonic())
        if not all(map(math.isfinite, numbers)):
            self.not_finite.append(name)

    def _on_plan(self, message):
        if message.found and not all(map(math.isfinite, (*message.states, *message.inputs))):
            self.not_finite.append("plan")

    def ask(self, service):
        """Call a service of the guard, also when the master is gone."""
        deadline = time.monotonic() + 20.0
        while not self.services[service].find() and time.monotonic() < deadline:
            time.sleep(0.1)
        answer = self.services[service]()
        return [answer.success, answer.message]

    def settle(self):
        """Return when it hovers; starts where that is needed."""
        self.wait_for(lambda: self.position is not None)
        self.wait_for(lambda: self.statuses and self.mode not in ("WAITING", "MANUAL"))
        if self.mode not in ("HOVERING", "BRAKING", "FLYING"):
            self.start()
        self.wait("HOVERING", 40.0)
        for service in self.services.values():
            service.find()

    def start(self):
        """Ask until it is granted: plans have to be verified first."""
        answers = []

        def granted():
            answers.append(self.ask("start"))
            time.sleep(0.1)
            return answers[-1][0]

        self.wait_for(granted, 20.0)
        return answers[-1]

    def wait_for(self, condition, timeout=30.0):
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                sys.exit(f"not within {timeout} s; last {self.statuses[-1:]}")
            time.sleep(0.01)

    @property
    def mode(self):
        return MODES[self.statuses[-1].mode]

    def report(self, since, seconds):
        """Return what was seen in some seconds after the status number ``since``."""
        begun, wall = time.monotonic(), time.monotonic() - 0.1
        while time.monotonic() < begun + seconds:
            time.sleep(0.02)
        statuses = self.statuses[since:]
        names = [MODES[s.mode] for s in statuses]
        return {
            "modes": [name for i, name in enumerate(names) if i == 0 or name != names[i - 1]],
            "codes": list(dict.fromkeys(s.reason_code for s in statuses)),
            "reason": statuses[-1].reason if statuses else "",
            "gap_ms": self.gap("commands", wall),
            "bare_gap_ms": self.gap("bare", wall),
            "commands": sum(t > wall for t in self.came["commands"]),
            "not_finite": self.not_finite,
        }

    def gap(self, name, since):
        came = [t for t in self.came[name] if t > since]
        return 1e3 * max((b - a for a, b in zip(came, came[1:])), default=math.inf)

    def fault(self, kind, parameters, seconds, after):
        """Inject a fault for some seconds; report until it hovers again, by ``after`` if needed."""
        since = len(self.statuses)
        injected = self.inject(kind, parameters, 0.0, 0.0)
        seen = self.report(since, seconds)
        self.clear(injected.id)
        if after:
            self.wait_for(lambda: self.mode in after)
        self.settle()
        seen["then"] = self.report(since, 0.2)["modes"]
        return seen


def pid_of(node):
    """Return the process of a node of this test's own master, None where it is gone."""
    try:
        code, _, uri = rospy.get_master().lookupNode(node)
        return ServerProxy(uri).getPid(CALLER)[2] if code == 1 else None
    except (OSError, Error, rospy.ROSException):
        return None


def is_back(node):
    """Whether anything has started an ended node again after a while."""
    time.sleep(GONE)
    return pid_of(node) is not None


def position_silent(client):
    """GPS position stops coming for a second and a half."""
    return client.fault("topic_dropped", "{topic: local_position}", 1.5, ())


def attitude_silent(client):
    """Attitude stops coming; the flight controller holds the aircraft."""
    return client.fault("topic_dropped", "{topic: attitude}", 1.5, ("RELEASED",))


def rc_silent(client):
    """The RC is not heard of."""
    return client.fault("topic_dropped", "{topic: rc}", 1.0, ("READY",))


def authority_taken(client):
    """The pilot leaves F."""
    return client.fault("authority_taken", "{by: pilot}", 1.0, ("READY",))


def app_takes_authority(client):
    """A mobile app takes authority in flight, and no topic shows it; nobody gives it back."""
    client.go_to(client.position[0] + 12.0, 0.0, 3.0)
    client.wait("FLYING")
    rospy.sleep(1.5)
    return client.fault("authority_taken", "{by: app}", 6.0, ("RELEASED",))


def solver_stalls(client):
    """The controller is stopped for 1.5 s, and goes on."""
    since, process = len(client.statuses), pid_of("/nmpc_controller")
    os.kill(process, signal.SIGSTOP)
    seen = client.report(since, 1.5)
    os.kill(process, signal.SIGCONT)
    client.wait("HOVERING")
    seen["then"] = client.report(since, 0.2)["modes"]
    seen["misses"] = client.statuses[-1].deadline_misses
    return seen


def node_ends(client, node, number):
    """A node gets a signal while the aircraft flies; nothing starts it again."""
    client.go_to(client.position[0] - 8.0, 0.0, 3.0)
    client.wait("FLYING")
    rospy.sleep(1.0)
    since, process = len(client.statuses), pid_of(f"/{node}")
    os.kill(process, getattr(signal, number))
    seen = client.report(since, 2.5)
    seen["back"] = is_back(f"/{node}")
    seen["mode"] = client.mode
    if node == "nmpc_traffic":  # where the others are is not known any more, until somebody says so
        client.wait_for(lambda: client.statuses[-1].reason_code == "held_back")
        seen["held_back"] = client.statuses[-1].reason
        seen["forgotten"] = client.forget(f"/{node}", "").success
    return seen


def guard_is_stopped(client):
    """The guard stands still for 0.8 s, longer than the simulator waits for a setpoint."""
    since, process = len(client.statuses), pid_of("/flight_guard")
    os.kill(process, signal.SIGSTOP)
    time.sleep(0.8)
    os.kill(process, signal.SIGCONT)
    return client.report(since, 2.0)


def guard_ends(client, number):
    """The guard gets a signal in flight; what it still does, and what the aircraft does then."""
    client.go_to(client.position[0] + 10.0, 0.0, 3.0)
    client.wait("FLYING")
    rospy.sleep(1.5)
    since, process = len(client.statuses), pid_of("/flight_guard")
    where, speed = list(client.position), client.statuses[-1].applied.pitch
    told = time.monotonic()
    os.kill(process, getattr(signal, number))
    client.wait_for(lambda: pid_of("/flight_guard") is None, 20.0)
    seen = client.report(since, 3.0)
    stopped, before = client.came["commands"][-1], list(client.position)
    time.sleep(1.0)
    seen.update(
        stream_ms=1e3 * (stopped - told),
        brakes=[s.rung for s in client.statuses[since:] if s.setpoint_sent][-1:],
        setpoints=[m.axes[4] for m in client.setpoints[-3:]],
        moved=math.dist(client.position, where),
        drift=math.dist(client.position, before),
        pitch=speed,
        task=client.land_task_ack() if number != "SIGKILL" else None,
        silent=client.came["commands"][-1] == stopped,
        back=is_back("/flight_guard"),
    )
    return seen


def master_ends(client):
    """The master is killed in flight; then fly on, land, start and hover once more."""
    client.go_to(client.position[0] + 6.0, 0.0, 3.0)
    client.wait("FLYING")
    since, master = len(client.statuses), rospy.get_master().getPid()[2]
    os.kill(master, signal.SIGKILL)
    seen = client.report(since, 4.0)
    client.wait("HOVERING", 20.0)
    seen["land"] = client.ask("land")
    client.wait("WAITING", 60.0)
    rospy.sleep(0.5)
    seen["authority"] = client.statuses[-1].authority
    seen["start"] = client.start()
    client.wait("HOVERING", 30.0)
    seen["codes"] = list(dict.fromkeys(s.reason_code for s in client.statuses[since:]))
    return seen


def link(client, bad, seconds, good):
    """What lies between guard and controller changes for some seconds (``link_relay.py``)."""
    settings = rospy.Publisher("link", String, queue_size=5)
    client.wait_for(lambda: settings.get_num_connections() > 0)
    since = len(client.statuses)
    settings.publish(json.dumps(bad))
    seen = client.report(since, seconds)
    settings.publish(json.dumps(good))
    client.settle()
    seen["then"] = client.report(since, 0.2)["modes"]
    return seen


def link_slow(client):
    """From telemetry to plan it takes 0.8 s."""
    return link(client, {"delay": 0.4}, 2.5, {"delay": 0.005})


def link_cut(client):
    """Nothing comes through for 1.5 s, then all of it at once."""
    return link(client, {"up": False}, 1.5, {"up": True})


def link_skewed(client, skew):
    """The workstation's clock is set wrong."""
    return link(client, {"skew": float(skew)}, 2.5, {"skew": 0.0})


def main():
    client, seen = Watcher(), {}
    for call in sys.argv[1:]:
        client.settle()
        name, *arguments = call.split(":")
        seen[call] = globals()[name](client, *arguments)
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
