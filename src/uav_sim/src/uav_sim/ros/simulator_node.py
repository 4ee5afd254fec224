# SPDX-License-Identifier: MIT
"""Simulated M100 that speak dji_sdk, as a ROS node.

ROS parameters (private):
    preset: plant preset, a file in ``config/presets``.
    settings_file: YAML of values that win over those of ``common.yaml`` and the preset; or empty.
    scenario_file: YAML of which only ``obstacles`` and ``spawn`` are read; empty: neither.
        ``spawn`` is where the aircraft stands; with z > 0 it begins there hovering with motors on.
    disturbance: level, a file in ``config/disturbances``, or a path.
    laser: scanner, a file in ``config/lasers``, or a path; empty: none.
    seed: of all that is random.
    fault_file: YAML of faults, each with its time; empty: none.
    vehicles: several vehicles in namespaces, a list of mappings with name, spawn, and where they
        differ preset, disturbance, seed, yaw; empty: one vehicle in the node's own namespace.
    speed_factor: simulated seconds per second; 0 runs as fast as possible.
    paused: begin with time standing.
    frame_id: world frame of ground truth and obstacles.
    vicon_frame: child frame of motion capture, where the level of disturbance has it.
    publish_clock: publish ``/clock``, for ``/use_sim_time``; otherwise stamps are wall time.

What each vehicle publishes: ``vehicle.py``. Services for time: ``time_control.py``, for faults of
a vehicle: ``faults.py``.
"""

import os
import signal
import sys
from threading import Lock
from typing import Dict

import rospy
from rosgraph_msgs.msg import Clock

from uav_sim.errors import SimulatorError
from uav_sim.fleet import Fleet
from uav_sim.ros.conversions import to_time
from uav_sim.ros.dji_sdk_server import QUEUE
from uav_sim.ros.node_parameters import Settings, read_fleet, read_settings
from uav_sim.ros.time_control import TimeControl
from uav_sim.ros.vehicle import Vehicle


class SimulatorNode:
    """Advances the vehicles on the wall clock and publishes what comes out of them."""

    def __init__(self, fleet: Fleet, settings: Settings, namespaces: bool) -> None:
        self._fleet = fleet
        self._publishes_clock = settings.publish_clock
        self._lock = Lock()
        if settings.publish_clock:
            self._clock = rospy.Publisher("/clock", Clock, queue_size=QUEUE)
        self._vehicles: Dict[str, Vehicle] = {
            name: Vehicle(
                sim,
                fleet,
                self._lock,
                name if namespaces else "",
                settings.frame_id,
                settings.vicon_frame,
            )
            for name, sim in fleet.vehicles.items()
        }
        self._time = TimeControl(fleet, settings.speed_factor, settings.paused)

    def run(self) -> None:
        """Simulate until ROS shuts down."""
        while not rospy.is_shutdown():
            if self._time.wait():
                self._advance()
                self._time.done()
            else:
                for vehicle in self._vehicles.values():
                    vehicle.report()
            self._die_if_killed()

    def _advance(self) -> None:
        with self._lock:
            received = self._fleet.step()
            for name, vehicle in self._vehicles.items():
                received[name] += vehicle.surroundings()
        stamp = to_time(self._fleet.t) if self._publishes_clock else rospy.Time.now()
        # The clock is never behind a stamp; with every packet it costs all nodes half as much as
        # with every step.
        if self._publishes_clock and (self._fleet.in_phase or any(received.values())):
            self._clock.publish(stamp)
        for name, vehicle in self._vehicles.items():
            vehicle.publish(stamp, received[name])

    def _die_if_killed(self) -> None:
        if any(sim.faults.dead == "process" for sim in self._fleet.vehicles.values()):
            rospy.logfatal("killed by a fault")
            os.kill(os.getpid(), signal.SIGKILL)  # without a farewell, as a crash


def main() -> None:
    """Entry point; exit status 2 on a wrong parameter or file."""
    # rospy's own handler would join threads that wait for the lock which the main thread holds.
    rospy.init_node("uav_sim", disable_signals=True)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        settings = read_settings()
        fleet, namespaces = read_fleet()
    except SimulatorError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    if settings.publish_clock and not rospy.get_param("/use_sim_time", False):
        rospy.logwarn("/use_sim_time is not set: nodes will not follow the simulated clock")
    for name, sim in fleet.vehicles.items():
        vehicle = f"simulated M100 {name if namespaces else ''}".rstrip()
        rospy.loginfo(
            f"{vehicle}: {sim.preset.name}, {len(sim.world.obstacles)} obstacles, "
            f"speed factor {settings.speed_factor:g}"
        )
    try:
        SimulatorNode(fleet, settings, namespaces).run()
    except KeyboardInterrupt:
        pass
    finally:
        rospy.signal_shutdown("the simulator has ended")
