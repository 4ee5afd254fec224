# SPDX-License-Identifier: MIT
"""Measures the simulator's share of a core at real time, beside a bare 50 Hz node in the same run.

    .venv/bin/python tests/ros/simulator_load.py [seconds] [name:=value of simulator.launch ...]

The simulator has the clients of a flight: as many listeners to all topics as CLIENTS says, one of
which sends setpoints at 50 Hz. Not a test: other load on the machine changes the figures.
"""

import os
import sys
import tempfile
import time
from pathlib import Path
from xmlrpc.client import ServerProxy

from ros_session import RosSession

CLIENTS = 3  # controller, guard, recorder
BARE = """
import rospy
from std_msgs.msg import Empty
rospy.init_node("bare")
publisher = rospy.Publisher("bare", Empty, queue_size=10)
rate = rospy.Rate(50)
while not rospy.is_shutdown():
    publisher.publish()
    rate.sleep()
"""
CLIENT = """
import sys
import rospy
from sensor_msgs.msg import Joy
rospy.init_node("client", anonymous=True)
for name, kind in rospy.get_published_topics():
    if "dji_sdk" in name or "uav_sim" in name or name == "/obstacles":
        rospy.Subscriber(name, rospy.AnyMsg, lambda message: None, queue_size=10, tcp_nodelay=True)
publisher = rospy.Publisher("dji_sdk/flight_control_setpoint_generic", Joy, queue_size=10)
rate = rospy.Rate(50)
while not rospy.is_shutdown():
    if sys.argv[1] == "sends":
        publisher.publish(Joy(axes=[0.0, 0.0, 38.4, 0.0, 43.0]))
    rate.sleep()
"""


def busy(pid: int) -> float:
    """Return the CPU time [s] of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def pid_of(session: RosSession, node: str) -> int:
    """Return the process of a node."""
    master = ServerProxy(session.environment["ROS_MASTER_URI"])
    return ServerProxy(master.lookupNode("/load", node)[2]).getPid("/load")[2]


def main() -> None:
    """Print the shares of one core [percent]."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    with tempfile.TemporaryDirectory() as directory:
        session = RosSession(Path(directory))
        try:
            session.launch(
                "uav_sim", "simulator.launch", **dict(a.split(":=", 1) for a in sys.argv[2:])
            )
            session.wait_for_node("/uav_sim")
            session.start(sys.executable, "-c", BARE)
            for k in range(CLIENTS):
                session.start(sys.executable, "-c", CLIENT, "listens" if k else "sends")
            session.wait_for_node("/bare")
            time.sleep(5.0)
            pids = {name: pid_of(session, name) for name in ("/uav_sim", "/bare")}
            before, begin = {name: busy(pid) for name, pid in pids.items()}, time.monotonic()
            time.sleep(duration)
            elapsed = time.monotonic() - begin
            for name, pid in pids.items():
                share = 100.0 * (busy(pid) - before[name]) / elapsed
                sys.stdout.write(f"{name} {share:.1f} % of one core over {elapsed:.0f} s\n")
        except OSError as error:
            sys.exit(f"{error}\n{session.output()}")
        finally:
            session.stop()


if __name__ == "__main__":
    main()
