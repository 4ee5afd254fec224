# SPDX-License-Identifier: MIT
"""The simulated M100 as a ROS node that speaks dji_sdk.

ROS parameters (private):
    preset: plant preset, a file in ``config/presets``.
    settings_file: YAML of values that win over those of ``common.yaml`` and the preset; or empty.
    scenario_file: YAML of which only ``obstacles`` and ``spawn`` are read; empty: neither.
        ``spawn`` is where the aircraft stands; with z > 0 it begins there hovering with motors on.
    speed_factor: simulated seconds per second; 0 runs as fast as possible.
    frame_id: world frame of ground truth and obstacles.
    publish_clock: publish ``/clock``, for ``/use_sim_time``; otherwise stamps are wall time.

Publishers beside those of dji_sdk:
    uav_sim/ground_truth (nav_msgs/Odometry): true state at 100 Hz, twist in ``base_link`` axes.
    uav_sim/collision (std_msgs/String): one line per contact of hull and obstacle; latched.
    obstacles (nmpc_msgs/ObstacleArray): at 10 Hz, where there are any.
"""

import sys
from dataclasses import dataclass
from threading import Lock
from typing import Tuple

import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from nmpc_msgs.msg import ObstacleArray
from uav_sim.config import load_yaml, number, numbers
from uav_sim.errors import ConfigError, SimulatorError
from uav_sim.m100 import SimulatedM100
from uav_sim.obstacle import Vector
from uav_sim.preset import load_preset
from uav_sim.ros.conversions import (
    collision_to_msg,
    obstacles_to_msg,
    to_time,
    truth_to_odometry,
)
from uav_sim.ros.dji_sdk_server import QUEUE, DjiSdkServer
from uav_sim.ros.pacer import Pacer
from uav_sim.ros.ports import Ports
from uav_sim.world import World

CLOCK_PERIOD, TRUTH_PERIOD, OBSTACLE_PERIOD = 0.005, 0.01, 0.1  # [s] of simulated time


@dataclass(frozen=True)
class Settings:
    """The node's own parameters."""

    speed_factor: float
    frame_id: str
    publish_clock: bool


class SimulatorNode:
    """Advances the simulator on the wall clock and publishes what comes out of it."""

    def __init__(self, sim: SimulatedM100, settings: Settings) -> None:
        self._sim = sim
        self._settings = settings
        self._lock = Lock()
        step = sim.preset.step
        self._clock_steps = max(1, round(CLOCK_PERIOD / step))
        self._truth_steps = round(TRUTH_PERIOD / step)
        self._obstacle_steps = round(OBSTACLE_PERIOD / step)
        self._steps = 0
        self._phase = sim.phase
        if settings.publish_clock:
            self._clock = rospy.Publisher("/clock", Clock, queue_size=QUEUE)
        self._truth = rospy.Publisher("uav_sim/ground_truth", Odometry, queue_size=QUEUE)
        self._collision = rospy.Publisher("uav_sim/collision", String, queue_size=QUEUE, latch=True)
        if sim.world.obstacles:
            self._obstacles = rospy.Publisher("obstacles", ObstacleArray, queue_size=1)
        self._server = DjiSdkServer(sim, self._lock, Ports())

    def run(self) -> None:
        """Simulate until ROS shuts down."""
        pacer, lost = Pacer(self._sim.preset.step, self._settings.speed_factor), 0.0
        while not rospy.is_shutdown():
            self._advance()
            pacer.wait()
            if pacer.lost > lost:
                lost = pacer.lost
                rospy.logwarn_throttle(5.0, f"the machine is too slow: {lost:.1f} s lost so far")

    def _advance(self) -> None:
        sim = self._sim
        with self._lock:
            packets = sim.step()
            t, truth, phase = sim.t, sim.truth, sim.phase
            collisions = sim.new_collisions
        self._steps += 1
        stamp = to_time(t) if self._settings.publish_clock else rospy.Time.now()
        if self._settings.publish_clock and self._steps % self._clock_steps == 0:
            self._clock.publish(stamp)
        if packets:
            self._server.publish(stamp, packets)
        frame_id = self._settings.frame_id
        if self._steps % self._truth_steps == 0:
            self._truth.publish(truth_to_odometry(stamp, truth, frame_id))
        if sim.world.obstacles and self._steps % self._obstacle_steps == 0:
            self._obstacles.publish(obstacles_to_msg(stamp, sim.world.states(), frame_id))
        for collision in collisions:
            message = collision_to_msg(collision)
            self._collision.publish(message)
            rospy.logerr(f"collision: {message.data}")
        if phase is not self._phase:
            self._phase = phase
            rospy.loginfo(f"the aircraft is {phase.value}, t = {t:.2f} s")


def main() -> None:
    """Entry point; exit status 2 on a wrong parameter or file."""
    rospy.init_node("uav_sim")
    try:
        sim, settings = _simulator(), _settings()
    except SimulatorError as error:
        rospy.logfatal(str(error))
        sys.exit(2)
    if settings.publish_clock and not rospy.get_param("/use_sim_time", False):
        rospy.logwarn("/use_sim_time is not set: nodes will not follow the simulated clock")
    rospy.loginfo(
        f"simulated M100 {sim.preset.name}: {len(sim.world.obstacles)} obstacles, "
        f"speed factor {settings.speed_factor:g}"
    )
    SimulatorNode(sim, settings).run()


def _settings() -> Settings:
    speed_factor = rospy.get_param("~speed_factor", 1.0)
    frame_id = rospy.get_param("~frame_id", "world")
    publish_clock = rospy.get_param("~publish_clock", True)
    if not isinstance(frame_id, str) or not frame_id:
        raise ConfigError("parameter", "frame_id", frame_id, "a frame's name")
    if not isinstance(publish_clock, bool):
        raise ConfigError("parameter", "publish_clock", publish_clock, "true or false")
    return Settings(number(speed_factor, "parameter", "speed_factor", 0.0), frame_id, publish_clock)


def _simulator() -> SimulatedM100:
    changes = rospy.get_param("~settings_file", "")
    preset = load_preset(
        rospy.get_param("~preset", "dji_hil"), load_yaml(changes) if changes else None, changes
    )
    path = rospy.get_param("~scenario_file", "")
    if not path:
        return SimulatedM100(preset)
    scenario = load_yaml(path)
    world = World.from_list(scenario.get("obstacles"), preset.radius, path)
    sim = SimulatedM100(preset, world)
    spawn = _spawn(scenario.get("spawn", [0.0, 0.0, 0.0]), path)
    sim.place(spawn, airborne=spawn[2] > 0.0)
    return sim


def _spawn(value: object, source: str) -> Tuple[float, ...]:
    spawn: Vector = numbers(value, source, "spawn", 3)
    if spawn[2] < 0.0:
        raise ConfigError(source, "spawn[2]", spawn[2], "a height not below the ground")
    return spawn
