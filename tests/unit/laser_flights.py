# SPDX-License-Identifier: MIT
"""An aircraft on a given path scans a simulated world; its laser tracker is told what it would be.

``fly`` goes through time scan by scan. Telemetry is late by what the tracker's parameters say.
"""

import dataclasses
import math

import numpy as np

from nmpc_control.laser_tracking.parameters import load_laser_parameters
from nmpc_control.laser_tracking.poses import PoseHistory
from nmpc_control.laser_tracking.scan import Scan
from nmpc_control.laser_tracking.tracker import LaserTracker
from nmpc_control.rotations import quaternion_from_rpy
from uav_sim.laser import Laser, load_laser
from uav_sim.world import World

PARAMETERS = load_laser_parameters()
START = 100.0  # [s] stamps are not zero
TICK = 0.005  # [s]
HERE = (0.0, 0.0, 3.0)


def changed(**sections):
    """Return the parameters with some values of some sections changed."""
    parts = {k: dataclasses.replace(getattr(PARAMETERS, k), **v) for k, v in sections.items()}
    return dataclasses.replace(PARAMETERS, **parts)


def hovering(t):
    """Position [m] and roll, pitch, yaw [rad] of an aircraft that stands in the air."""
    return np.array(HERE), np.zeros(3)


def rocking(t):
    """Weave sideways and along at up to 2 m/s, tilting and turning as a multirotor does."""
    w = 1.0
    position = np.array([1.0 * math.sin(w * t), 1.5 * math.cos(w * t), 3.0 + 0.2 * math.sin(t)])
    acceleration = -w * w * np.array([position[0], position[1]])
    yaw = 0.4 * math.sin(0.7 * t)
    c, s = math.cos(yaw), math.sin(yaw)
    forward, left = (
        c * acceleration[0] + s * acceleration[1],
        c * acceleration[1] - s * acceleration[0],
    )
    return position, np.array([-left / 9.81, forward / 9.81, yaw])


def cylinder(name, position, velocity=(0.0, 0.0, 0.0), radius=0.4, **others):
    """Return a standing cylinder of 6 m as the simulator's YAML has it."""
    x, y = position
    entry = {"id": name, "shape": "cylinder", "position": [x, y, 3.0], "radius": radius}
    return {**entry, "height": 6.0, "velocity": list(velocity), **others}


class Flight:
    """One aircraft with laser and tracker in a world; ``step`` goes on to the next scan."""

    def __init__(self, obstacles, pose=hovering, laser="utm_30lx", parameters=PARAMETERS, seed=1):
        self.world = World.from_list(obstacles, 0.5)
        self.laser = Laser(load_laser(laser), str(seed))
        self.tracker = LaserTracker(parameters)
        self.poses = PoseHistory(parameters.pose)
        self.delay = PARAMETERS.pose.delay
        self.pose = pose
        self.alter = lambda scan: scan  # what becomes of a scan on its way
        self.noise = (0.0, 0.0, 0.0)  # [m], [m/s], [rad] sigma of telemetry
        self._random = np.random.default_rng(seed)
        self._ticks = 0

    @property
    def t(self):
        """Time [s] of the flight."""
        return self._ticks * TICK

    def step(self):
        """Go on to the next scan; return its time [s]."""
        while True:
            t = self.t
            if self._ticks % 2 == 0:
                self._tell(t)
            self.world.observe(t, tuple(self.pose(t)[0]))
            is_due = self.laser.due(t)
            self._ticks += 1
            if is_due:
                position, rpy = self.pose(t)
                self.ranges = self.laser.scan(position, rpy, self.world.states())
                self.tracker.update(self.alter(self.scan(t)), self.poses)
                return t

    def run(self, duration, settle=0.0):
        """Go on for a duration [s]; after ``settle`` [s] yield time and obstacles of each scan."""
        end, begin = self.t + duration, self.t + settle
        while self.t < end:
            t = self.step()
            if t >= begin:
                yield t, self.tracker.obstacles()

    def scan(self, t):
        """Return the newest ranges as a scan."""
        p, angles = self.laser.parameters, self.laser.angles
        limits = (float(angles[-1]), p.angle_increment, 0.0, p.range_min, p.range_max)
        return Scan(START + t, p.angle_min, *limits, self.ranges)

    def truth(self):
        """Return position [m] and velocity [m/s] (2,) of what is there, by name."""
        states = self.world.states()
        return {s.obstacle.id: (np.array(s.position[:2]), np.array(s.velocity[:2])) for s in states}

    def _tell(self, t):
        """Give the tracker the telemetry that arrives at ``t`` [s]."""
        shown, h, noise = t - self.delay, 1e-3, self._random.normal
        (position, rpy), (ahead, turned) = self.pose(shown), self.pose(shown + h)
        stamp, estimator = START + t, self.poses.estimator
        estimator.add_imu(stamp, _body_rates(rpy, (turned - rpy) / h))
        if self._ticks % 4 == 0:
            estimator.add_velocity(
                stamp, (ahead - position) / h + noise(0.0, 1.0, 3) * self.noise[1]
            )
            estimator.add_position(stamp, position + noise(0.0, 1.0, 3) * self.noise[0])
        heard = rpy + noise(0.0, 1.0, 3) * self.noise[2]
        self.poses.add_attitude(stamp, quaternion_from_rpy(*heard))


def errors(flight, duration, settle):
    """Return per name the errors (k, 2) of position [m] and velocity [m/s], and the ids it had.

    Every true obstacle is compared with the nearest track; one without a track within 1 m counts
    as an error of 1 m.
    """
    found, ids = {}, {}
    for _, tracks in flight.run(duration, settle):
        for name, (position, velocity) in flight.truth().items():
            near = min(tracks, key=lambda o: np.hypot(*(o.position[:2] - position)), default=None)
            off = 1.0 if near is None else float(np.hypot(*(near.position[:2] - position)))
            speed = 1.0 if near is None else float(np.hypot(*(near.velocity[:2] - velocity)))
            found.setdefault(name, []).append((min(off, 1.0), speed))
            ids.setdefault(name, set()).add(near.id if near is not None and off < 1.0 else None)
    return {name: np.array(rows) for name, rows in found.items()}, ids


def _body_rates(rpy, rates):
    (roll, pitch, _), (dr, dp, dy) = rpy, rates
    return (
        dr - dy * math.sin(pitch),
        dp * math.cos(roll) + dy * math.sin(roll) * math.cos(pitch),
        dy * math.cos(roll) * math.cos(pitch) - dp * math.sin(roll),
    )
