# SPDX-License-Identifier: MIT
"""The guard on the simulated M100, with a stand-in solver that only follows a velocity."""

import dataclasses
import math

import numpy as np

from nmpc_control.guard import Guard
from nmpc_control.guard_inbox import GuardInbox
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import Mode
from nmpc_control.params import load_parameters
from nmpc_control.prediction import step
from nmpc_control.state import GRAVITY, VELOCITY, Goal, Plan
from uav_sim.m100 import SimulatedM100
from uav_sim.preset import load_preset

PARAMS = load_guard_parameters()
TICK = 0.02  # [s]
SOLVE = 0.06  # [s]
HEIGHT = 20.0  # [m]


def following(velocity, gain=1.0, tilt=0.436):
    """Return a solver whose plans turn to a velocity (3,) [m/s], within the inputs' bounds."""
    return steered(lambda x, vehicle: gain * (np.asarray(velocity) - x[VELOCITY]), tilt)


def stopping_late(wall, speed, deceleration, left):
    """Return a solver that flies east and stops ``left`` [m] before a wall, as late as it can."""

    def acceleration(x, vehicle):
        v = x[VELOCITY]
        room = wall - vehicle.radius - left - x[0] - v[0] * vehicle.pitch.time_constant
        wanted = min(speed, math.sqrt(2.0 * deceleration * max(room, 0.0)))
        slowing = deceleration if wanted < speed and room > 0.0 else 0.0
        return [1.5 * (wanted - v[0]) - slowing, -v[1], -v[2]]

    return steered(acceleration)


def steered(acceleration, tilt=0.436):
    """Return a solver whose plans follow an acceleration (3,) [m/s^2] of state and vehicle."""

    def solver(t, x, vehicle, horizon=35, dt=0.1):
        states, inputs = [x], []
        for _ in range(horizon):
            x = states[-1]
            a = np.asarray(acceleration(x, vehicle)) + vehicle.drag * x[VELOCITY]
            cy, sy = math.cos(x[5]), math.sin(x[5])
            forward, left, up = cy * a[0] + sy * a[1], cy * a[1] - sy * a[0], GRAVITY + a[2]
            u = [up, -math.atan2(left, up) / vehicle.roll.gain]
            u += [math.atan2(forward, up) / vehicle.pitch.gain, 0.0]
            inputs.append(np.clip(u, [5.0, -tilt, -tilt, -1.0], [15.0, tilt, tilt, 1.0]))
            states.append(np.array(step(x, inputs[-1], dt, vehicle)))
        return Plan(t, dt, vehicle.delay, np.array(states), np.array(inputs)), Goal.TRAJECTORY

    return solver


class GuardedM100:
    """One flight: the guard streams at its rate, the solver's plans come unless it is None."""

    def __init__(self, plant, velocity, solver, params=PARAMS, gps=True, wind=(0, 0, 0)):
        flight = load_parameters(plant)
        self.vehicle = flight.vehicle
        self.guard = Guard(params, flight.vehicle, flight.limits)
        self.inbox = GuardInbox(params)
        self.aircraft = SimulatedM100(load_preset(plant))
        self.aircraft.place([0.0, 0.0, HEIGHT], velocity, authority=True)
        self.aircraft.plant.wind = tuple(map(float, wind))
        self.inbox.authority = True
        self.gps = gps
        self.solver = solver
        self.obstacles_stale = ""
        self.path, self.times, self.outputs = [], [], []
        self._count = 0
        while self.inbox.estimator.estimate(self.t) is None:
            self._listen()
        self.guard.mode = Mode.FLYING
        if params.disturbance.horizontal > 0.0:  # as learnt on the flight so far
            learnt = self.vehicle.drag * np.array(wind)
            self.guard._disturbance.acceleration = learnt
        self.tick()

    @property
    def t(self):
        return self.aircraft.t

    @property
    def known(self):
        """The vehicle with what the guard has learnt."""
        return self.guard.override.vehicle

    @property
    def obstacles(self):
        return self.inbox.obstacles

    @obstacles.setter
    def obstacles(self, obstacles):
        self.inbox.obstacles = tuple(obstacles)

    @property
    def speed(self):
        return float(np.linalg.norm(self.aircraft.truth.velocity))

    def estimate(self):
        return self.inbox.estimator.estimate(self.t)

    def in_effect(self):
        """Return the state (10,) when a command sent now takes effect."""
        return self.guard._sent.state_in_effect(self.t, self.estimate())

    def clearance(self, obstacle):
        """Return the least clearance [m] to an obstacle since the flight began, on truth."""
        distance = obstacle.distance(np.array(self.path), np.array(self.times))
        return float(distance.min()) - self.vehicle.radius

    def tick(self):
        """Let the guard act once, and the aircraft fly on for its period."""
        if self.solver is not None and self._count % round(SOLVE / TICK) == 0:
            self.inbox.add_plan(*self.solver(self.t, self.in_effect(), self.known))
        self._count += 1
        inputs = self.inbox.inputs(self.t)
        telemetry = dataclasses.replace(
            inputs.telemetry,
            gps_health=5 if self.gps else 0,
            needs_gps=self.gps,
            battery_age=0.0,
            battery=1.0,
        )
        inputs = dataclasses.replace(
            inputs, telemetry=telemetry, obstacles_stale=self.obstacles_stale
        )
        output = self.guard.tick(inputs)
        if output.axes is not None:
            self.aircraft.setpoint("generic", output.axes)
        self.outputs.append(output)
        for _ in range(round(TICK / self.aircraft.preset.step)):
            self._listen()
        return output

    def run(self, seconds):
        """Tick for a time [s]; return the last output."""
        for _ in range(round(seconds / TICK)):
            output = self.tick()
        return output

    def until_at_rest(self, limit=15.0):
        """Tick until the aircraft stands, at most ``limit`` [s]."""
        end = self.t + limit
        self.tick()
        while self.speed > 0.1 and self.t < end:
            self.tick()

    def _listen(self):
        inbox, estimator = self.inbox, self.inbox.estimator
        take = {
            "attitude": estimator.add_attitude,
            "imu": lambda t, value: estimator.add_imu(t, value.angular_velocity),
            "velocity": estimator.add_velocity,
            "local_position": estimator.add_position,
            "rc": inbox.add_rc,
            "flight_status": inbox.add_flight_status,
            "gps_health": inbox.add_gps_health,
            "height_above_takeoff": lambda t, value: inbox.add_height(value),
        }
        for packet in self.aircraft.step():
            if packet.topic in take:
                take[packet.topic](packet.t, packet.value)
        self.path.append(self.aircraft.truth.position)
        self.times.append(self.t)
