# SPDX-License-Identifier: MIT
"""What the model lacks is learnt, within bounds, and only while the inputs are known."""

from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.controller import Controller
from nmpc_control.disturbance_estimate import DisturbanceEstimate, learnable, steady_input
from nmpc_control.guard import Guard
from nmpc_control.guard_params import load_guard_parameters
from nmpc_control.params import load_parameters, load_vehicle
from nmpc_control.prediction import derivative, predict
from nmpc_control.state import GRAVITY, VELOCITY, hover_state

PARAMETERS = load_parameters().disturbance
VEHICLE = load_vehicle("dji_hil")
WIND = np.array([1.6, -1.1, 0.7])  # [m/s^2]
DT = 0.05  # [s]


class Flight:
    """A vehicle under varied inputs and a constant acceleration, and what is learnt from it."""

    def __init__(self, wind=WIND, noise=0.0, parameters=PARAMETERS):
        self.estimate = DisturbanceEstimate(parameters)
        self.t, self.inputs = 10.0, []
        self._truth = replace(VEHICLE, disturbance=np.array(wind))
        self._x = hover_state(np.array([0.0, 0.0, 50.0]), yaw=0.8)
        self._rng, self._noise = np.random.default_rng(1), noise

    def run(self, seconds, learns=True):
        """Fly on; returns the estimates (M, 3) on the way."""
        learnt = []
        for _ in range(round(seconds / DT)):
            t = self.t
            u = [GRAVITY + np.sin(t), 0.15 * np.sin(2 * t), 0.15 * np.cos(1.3 * t), 0.4]
            self.inputs.append((t, u))
            self._x = np.array(predict(self._x, t, t + DT, self.inputs, self._truth))
            self.t = t + DT
            seen = self._x.copy()
            seen[VELOCITY] += self._noise * self._rng.normal(size=3)
            if learns:
                known = replace(VEHICLE, disturbance=self.estimate.acceleration)
                self.estimate.update(self.t, seen, self.inputs, known)
            learnt.append(self.estimate.acceleration.copy())
        return np.array(learnt)


def error(learnt, wind=WIND):
    return np.linalg.norm(learnt - wind) / np.linalg.norm(wind)


def test_a_constant_acceleration_is_recovered_in_three_seconds():
    flight = Flight()
    flight.run(3.0 + DT)
    assert error(flight.estimate.acceleration) < 0.05
    assert flight.estimate.miss < 0.05


def test_a_thrust_that_is_not_sent_teaches_nothing_vertical():
    flight = Flight(parameters=learnable(PARAMETERS, "velocity"))
    flight.run(3.0 + DT)
    assert flight.estimate.acceleration[2] == 0.0
    assert error(flight.estimate.acceleration[:2], WIND[:2]) < 0.05
    assert flight.estimate.miss < 0.05
    twin = Flight(parameters=learnable(PARAMETERS, "thrust"))
    twin.run(3.0 + DT)
    assert twin.estimate.acceleration[2] == pytest.approx(WIND[2], rel=0.05)


def test_guard_and_controller_know_what_is_sent():
    params, flown = load_guard_parameters(), load_parameters()
    by_velocity = replace(params, vertical_command="velocity")
    guards = [Guard(p, VEHICLE, flown.limits) for p in (params, by_velocity)]
    assert [g._disturbance.parameters.vertical > 0.0 for g in guards] == [True, False]
    controllers = [Controller(flown), Controller(flown, "velocity")]
    assert [c._disturbance.parameters.vertical > 0.0 for c in controllers] == [True, False]


def test_and_through_the_noise_of_velocities():
    flight = Flight(noise=0.05)
    flight.run(3.0)
    assert error(flight.run(2.0).mean(axis=0)) < 0.05
    calm = Flight(wind=np.zeros(3), noise=0.05)
    calm.run(3.0)
    assert np.linalg.norm(calm.run(10.0), axis=1).max() < 0.3, "noise alone is no wind"


def test_it_does_not_depend_on_how_often_states_come():
    seldom, often = (DisturbanceEstimate(PARAMETERS) for _ in range(2))
    truth = replace(VEHICLE, disturbance=WIND)
    x = hover_state(np.zeros(3))
    for i in range(151):
        t = 0.02 * i
        x_t = np.array(predict(x, 0.0, t, [], truth))
        for estimate, every in ((often, 1), (seldom, 5)):
            if i % every == 0:
                known = replace(VEHICLE, disturbance=estimate.acceleration)
                estimate.update(t, x_t, [], known)
    assert often.acceleration == pytest.approx(WIND, rel=0.06)
    assert seldom.acceleration == pytest.approx(often.acceleration, rel=0.03)


def test_it_is_bounded_on_every_axis():
    flight = Flight(wind=np.array([30.0, -30.0, -30.0]))
    learnt = flight.run(3.0)
    most = [PARAMETERS.horizontal, PARAMETERS.horizontal, PARAMETERS.vertical]
    assert np.abs(learnt).max(axis=0) == pytest.approx(most)
    none = Flight(parameters=replace(PARAMETERS, horizontal=0.0, vertical=0.0))
    assert not none.run(2.0).any()


def test_pause_keeps_and_reset_forgets():
    flight = Flight()
    flight.run(5.0)
    before = flight.estimate.acceleration.copy()
    flight.estimate.pause()
    flight.run(0.2, learns=False)
    flight.inputs = [(t, [25.0, 0.4, 0.4, 1.0]) for t, _ in flight.inputs]  # not what was sent
    flight.run(DT)
    assert np.array_equal(flight.estimate.acceleration, before), "the first one only begins again"
    flight.estimate.reset()
    assert not flight.estimate.acceleration.any()
    assert flight.estimate.miss == 0.0


def test_nothing_is_learnt_over_a_gap():
    flight = Flight()
    flight.run(5.0)
    before = flight.estimate.acceleration.copy()
    gone = hover_state(np.zeros(3))
    gone[VELOCITY] = 9.0, 9.0, 9.0
    flight.estimate.update(flight.t + 1.0, gone, flight.inputs, VEHICLE)
    assert np.array_equal(flight.estimate.acceleration, before)
    flight.estimate.update(flight.t + 0.5, gone + 5.0, flight.inputs, VEHICLE)
    assert np.array_equal(flight.estimate.acceleration, before), "nor when time goes back"


@pytest.mark.parametrize("yaw", [0.0, 0.8, -2.5])
@pytest.mark.parametrize("name", ["dji_hil", "eth", "paper"])
def test_the_steady_input_holds_the_model_still(name, yaw):
    vehicle = replace(load_vehicle(name), disturbance=WIND)
    u = steady_input(vehicle, yaw)
    x = hover_state(np.array([1.0, 2.0, 3.0]), yaw)
    x[3], x[4] = vehicle.roll.gain * u[1], vehicle.pitch.gain * u[2]
    assert derivative(x, u, vehicle) == pytest.approx(np.zeros(10), abs=1e-9)
    x[3:5] = 0.0
    level = steady_input(load_vehicle(name), yaw)
    assert derivative(x, level, vehicle)[6:9] == pytest.approx(WIND), "the twin is blown away"
