# SPDX-License-Identifier: MIT
"""A numeric stand-in for aircraft, flight controller and solver: what the guard's tests fly."""

import dataclasses
from collections import deque

import numpy as np

from nmpc_control.dji import (
    ATTITUDE_VERTICAL_VELOCITY,
    VELOCITY,
    FlightStatus,
    RcMode,
    input_from_axes,
)
from nmpc_control.estimator import StateEstimate
from nmpc_control.guard import Guard
from nmpc_control.guard_data import Action, GuardInputs
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.mode_inputs import Mode, ModeInputs, Request
from nmpc_control.params import load_parameters
from nmpc_control.prediction import step
from nmpc_control.state import GRAVITY, NU, Goal, Plan, hover_input, hover_state

TICK = 0.02  # [s]
_LOADED = load_guard_parameters()
PARAMS = dataclasses.replace(  # the switch stands in F from the beginning
    _LOADED, modes=dataclasses.replace(_LOADED.modes, needs_switch=False)
)
FLIGHT = load_parameters("dji_hil")
VEHICLE, LIMITS = FLIGHT.vehicle, FLIGHT.limits

GOOD = ModeInputs(
    attitude_age=0.01,
    velocity_age=0.02,
    position_age=0.02,
    rc_age=0.02,
    rc=RcMode.F,
    sticks=0.0,
    status_age=0.02,
    flight_status=FlightStatus.ON_GROUND,
    gps_age=0.02,
    gps_health=5,
    battery_age=0.1,
    battery=0.9,
)


def make_plan(x0, t, inputs=None, dt=0.1, horizon=60, vehicle=VEHICLE):
    """Return the plan that the guard's own model makes of constant or given inputs."""
    inputs = hover_input() if inputs is None else np.asarray(inputs, dtype=float)
    inputs = np.broadcast_to(inputs, (horizon, NU)).copy()
    states = [np.asarray(x0, dtype=float)]
    for u in inputs:
        states.append(np.array(step(states[-1], u, dt, vehicle)))
    return Plan(t=t, dt=dt, delay=vehicle.delay, states=np.array(states), inputs=inputs)


class Aircraft:
    """First-order attitude with dead time, a velocity hold as DJI's, tasks and authority."""

    def __init__(self, vehicle=VEHICLE, thrust_error=0.0):
        self.vehicle = vehicle
        self.thrust_error = thrust_error  # [m/s^2] that the thrust map does not know
        self.x = hover_state(np.zeros(3))
        self.status = FlightStatus.ON_GROUND
        self.authority = False
        self._sent = deque()
        self._acting = hover_input()

    def airborne(self, position, velocity=(0.0, 0.0, 0.0), yaw=0.0):
        self.x = hover_state(np.array(position, dtype=float), yaw)
        self.x[6:9] = velocity
        self.status = FlightStatus.IN_AIR
        return self

    def serve(self, actions):
        for action in actions:
            if action is Action.OBTAIN_AUTHORITY:
                self.authority = True
            elif action is Action.RELEASE_AUTHORITY:
                self.authority = False
            elif action is Action.TAKE_OFF and self.authority:
                self.airborne([0.0, 0.0, 1.2])
            elif action is Action.LAND:
                self.x = hover_state(np.zeros(3))
                self.status = FlightStatus.ON_GROUND

    def fly(self, t, axes):
        """Move on by one tick; ``axes`` None is silence."""
        if axes is not None:
            self._sent.append((t + self.vehicle.delay, axes))
        while self._sent and self._sent[0][0] <= t + 1e-9:
            self._acting = self._sent.popleft()[1]
        if self.status is not FlightStatus.IN_AIR:
            return
        u = np.array(self._acting)
        if len(u) == 5:
            u = self._input(u)
        u[0] += self.thrust_error
        self.x = np.array(step(self.x, u, TICK, self.vehicle))

    def _input(self, axes):
        if axes[4] == VELOCITY:
            self.x[6:9] += (axes[:3] - self.x[6:9]) * TICK / 0.3
            return hover_input()
        if axes[4] == ATTITUDE_VERTICAL_VELOCITY:
            self.x[8] += (axes[2] - self.x[8]) * TICK / 0.3
            return np.array([GRAVITY, axes[0], axes[1], axes[3]])
        return np.array(input_from_axes(axes, VEHICLE))


class Flight:
    """A guard flying the stand-in aircraft with a solver that may be told to misbehave."""

    def __init__(self, params=PARAMS, aircraft=None, solver=None):
        self.guard = Guard(params, VEHICLE, LIMITS)
        self.aircraft = aircraft or Aircraft()
        self.solver = solver or (lambda t, x: (make_plan(x, t), Goal.HOLD))
        self.t = 100.0
        self.change = {}  # telemetry that differs from good
        self.obstacles = ()
        self.stale = ""  # why the obstacles are not known well enough
        self.early = 0.0  # [s] by which a plan is looked at before its tick
        self.log = []  # (t, inputs, output)

    def tick(self, request=None, **changes):
        self.t = round(self.t + TICK, 6)
        x = self.aircraft.x.copy()
        telemetry = dataclasses.replace(
            GOOD,
            **{
                "flight_status": self.aircraft.status,
                "authority": self.aircraft.authority,
                "request": request,
                **self.change,
                **changes,
            },
        )
        offered, goal = None, Goal.HOLD
        if round(self.t / TICK) % 3 == 0 and self.solver is not None:
            offered, goal = self.solver(self.t, x)
        estimate = StateEstimate(
            self.t, x, telemetry.position_age, telemetry.velocity_age, telemetry.attitude_age
        )
        inputs = GuardInputs(
            t=self.t,
            telemetry=telemetry,
            estimate=estimate,
            height=x[2],
            plan=offered,
            goal=goal,
            obstacles=self.obstacles,
            obstacles_stale=self.stale,
        )
        if self.early and offered is not None:
            self.guard.look_at_plan(dataclasses.replace(inputs, t=self.t - self.early))
            inputs = dataclasses.replace(inputs, plan=None)
        output = self.guard.tick(inputs)
        self.aircraft.serve(output.actions)
        self.aircraft.fly(self.t, output.axes if self.aircraft.authority else None)
        self.log.append((self.t, inputs, output))
        return output

    def run(self, seconds, request=None, **changes):
        output = self.tick(request, **changes)
        for _ in range(round(seconds / TICK) - 1):
            output = self.tick(**changes)
        return output

    def hovering(self):
        """Return the flight after a start in the air, hovering on plans."""
        if self.aircraft.status is not FlightStatus.IN_AIR:
            self.aircraft.airborne([0.0, 0.0, 5.0])
        self.run(1.0)
        self.tick(Request.START)
        output = self.run(1.5)
        assert output.mode is Mode.HOVERING, output
        return self

    @property
    def speed(self):
        return float(np.linalg.norm(self.aircraft.x[6:9]))
