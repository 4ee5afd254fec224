# SPDX-License-Identifier: MIT
"""One vehicle of the simulator as ROS sees it: dji_sdk, surroundings, ground truth, faults.

Publishers beside those of dji_sdk, below the vehicle's namespace:
    uav_sim/ground_truth (nav_msgs/Odometry): true state at 100 Hz, twist in ``base_link`` axes.
    uav_sim/obstacles (nmpc_msgs/ObstacleArray): true obstacles at 10 Hz, where there are any.
    uav_sim/collision (std_msgs/String): one line per contact of the hull; latched.
    uav_sim/faults (nmpc_msgs/FaultArray): active faults; latched.
    obstacles (nmpc_msgs/ObstacleArray): as sensed, at 10 Hz, where there are any.
    scan (sensor_msgs/LaserScan), and its frame on /tf: ``laser_port.py``; where there is a laser.
    /tf: world to ``vicon_frame``, where the level of disturbance has motion capture.
"""

from threading import Lock
from typing import Callable, Dict, List, Sequence

import rospy
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from tf2_ros import TransformBroadcaster

from nmpc_msgs.msg import ObstacleArray
from uav_sim.fleet import Fleet
from uav_sim.m100 import SimulatedM100
from uav_sim.ros.conversions import (
    collision_to_msg,
    obstacles_to_msg,
    pose_to_transform,
    truth_to_odometry,
)
from uav_sim.ros.dji_sdk_server import QUEUE, DjiSdkServer
from uav_sim.ros.faults import FaultServices
from uav_sim.ros.laser_port import LaserPort
from uav_sim.ros.ports import Ports
from uav_sim.telemetry import Packet

OBSTACLE_PERIOD = 10  # packets of ground truth from one list of obstacles to the next


class Vehicle:
    """Publishes what comes out of a simulated aircraft, step by step."""

    def __init__(
        self,
        sim: SimulatedM100,
        fleet: Fleet,
        lock: Lock,
        namespace: str,
        frame_id: str,
        vicon_frame: str,
    ) -> None:
        self._sim = sim
        self._fleet = fleet
        self._frame_id = frame_id
        ports = Ports(namespace)
        self._prefix = ports.prefix
        self._body_frame = ports.name("base_link")
        self._vicon_frame = ports.name(vicon_frame)
        self._samples = 0  # of ground truth
        self._phase = sim.phase
        self._truth = ports.publisher("uav_sim/ground_truth", Odometry, QUEUE)
        self._collision = ports.publisher("uav_sim/collision", String, QUEUE, latch=True)
        self._has_obstacles = bool(sim.world.scene.bodies(sim.world.name))
        if self._has_obstacles:
            self._true_obstacles = ports.publisher("uav_sim/obstacles", ObstacleArray, 1)
            self._obstacles = ports.publisher("obstacles", ObstacleArray, 1)
        self._transforms = TransformBroadcaster()
        self._publish: Dict[str, Callable[[rospy.Time, Packet], None]] = {
            "obstacles": self._publish_obstacles,
            "vicon": self._publish_pose,
            "scan": self._publish_scan,
        }
        self._laser = LaserPort(sim.laser, ports) if sim.laser is not None else None
        self._driver_ports = Ports(namespace)
        self._lock = lock
        self._start_driver()
        self._faults = FaultServices(sim, lock, ports)

    def surroundings(self) -> List[Packet]:
        """Return what others than dji_sdk report of this step, faults applied; call it locked."""
        sim = self._sim
        packets = [Packet("vicon", sim.t, pose) for pose in sim.new_poses]
        if self._has_obstacles and self._shows_obstacles:
            packets.append(Packet("obstacles", sim.t, sim.sensed_obstacles))
        if sim.new_scan is not None:
            packets.append(Packet("scan", sim.t, (sim.new_scan, sim.truth.rpy)))
        return sim.faults.filter(sim.t, packets)

    def publish(self, stamp: rospy.Time, packets: Sequence[Packet]) -> None:
        """Publish a step's packets, and what else is due after it."""
        sim = self._sim
        self.report()
        self._driver.publish(stamp, [p for p in packets if p.topic not in self._publish])
        for packet in packets:
            if packet.topic in self._publish:
                self._publish[packet.topic](stamp, packet)
        if self._fleet.in_phase:
            truth = truth_to_odometry(stamp, sim.truth, self._frame_id, self._body_frame)
            self._truth.publish(truth)
            if self._has_obstacles and self._shows_obstacles:
                states = obstacles_to_msg(stamp, sim.world.states(), self._frame_id)
                self._true_obstacles.publish(states)
            self._samples += 1
        for collision in sim.new_collisions:
            message = collision_to_msg(collision)
            self._collision.publish(message)
            rospy.logerr(f"{self._prefix}collision: {message.data}")
        if sim.phase is not self._phase:
            self._phase = sim.phase
            rospy.loginfo(f"{self._prefix}the aircraft is {sim.phase.value}, t = {sim.t:.2f} s")

    @property
    def _shows_obstacles(self) -> bool:
        return self._fleet.in_phase and self._samples % OBSTACLE_PERIOD == 0

    def report(self) -> None:
        """Show faults that have begun or ended; end and start the driver as they say."""
        self._faults.report()
        is_dead = self._sim.faults.dead == "driver"
        if is_dead and self._driver_lives:
            self._driver_lives = False
            self._driver_ports.close()
            rospy.logerr(f"{self._prefix}dji_sdk is dead: no topic and no service any more")
        elif not is_dead and not self._driver_lives:
            self._start_driver()
            rospy.logwarn(f"{self._prefix}dji_sdk is started again")

    def _start_driver(self) -> None:
        self._driver = DjiSdkServer(self._sim, self._lock, self._driver_ports)
        self._driver_lives = True

    def _publish_obstacles(self, stamp: rospy.Time, packet: Packet) -> None:
        sensed = self._time_of(stamp, packet.t)
        self._obstacles.publish(obstacles_to_msg(sensed, packet.value, self._frame_id))

    def _publish_pose(self, stamp: rospy.Time, packet: Packet) -> None:
        captured, pose = self._time_of(stamp, packet.value.t), packet.value
        transform = pose_to_transform(captured, pose, self._frame_id, self._vicon_frame)
        self._transforms.sendTransform(transform)

    def _publish_scan(self, stamp: rospy.Time, packet: Packet) -> None:
        self._laser.publish(self._time_of(stamp, packet.t), *packet.value)

    def _time_of(self, stamp: rospy.Time, t: float) -> rospy.Time:
        """Return the ROS time of a simulated time ``t`` [s] where it is ``stamp`` now."""
        return stamp - rospy.Duration.from_sec(self._sim.t - t)
