# SPDX-License-Identifier: MIT
"""Changes in flight: all of them or none, by the files' own checks, held against the guard."""

from dataclasses import replace

import numpy as np
import pytest

from nmpc_control.controller import Controller
from nmpc_control.errors import ProblemError
from nmpc_control.params import load_parameters, load_weights
from nmpc_control.state import hover_state
from nmpc_control.tuning import Tuning, TuningError, values_of, with_values

PARAMETERS = load_parameters()
LEAST = 0.2  # [m]


class Taker:
    """Remembers what was put into force; refuses where told to."""

    def __init__(self):
        self.taken, self.error = [], None

    def __call__(self, parameters):
        if self.error:
            raise self.error
        self.taken.append(parameters)


@pytest.fixture
def tuning():
    return Tuning(PARAMETERS, LEAST)


@pytest.fixture
def take():
    return Taker()


def test_what_is_changed_is_changed_and_nothing_else():
    values = values_of(PARAMETERS)
    assert with_values(PARAMETERS, {}).avoidance == PARAMETERS.avoidance
    for name, value in values.items():
        changed = with_values(PARAMETERS, {name: value + 0.125})
        other = values_of(changed)
        assert {n for n in values if other[n] != values[n]} == {name}
        assert changed.vehicle is PARAMETERS.vehicle and changed.solver is PARAMETERS.solver


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"Q_x": -1.0}, "tuning: Q[0]: got -1.0"),
        ({"R_thrust": np.nan}, "tuning: R[0]: got nan"),
        ({"speed": 0.0}, "tuning: speed: got 0.0"),
        ({"speed": np.inf}, "tuning: speed: got inf"),
        ({"speed": 8.5}, "speed: got 8.5, expected 8 at most: the launch's"),
        ({"eta": -1.0}, "tuning: eta: got -1.0"),
        ({"safety_distance": 0.1}, "safety_distance: got 0.1, expected 0.2 at least"),
        ({"input_max_roll": 0.5}, "input_max_roll: got 0.5, expected 0.436 at most"),
        ({"input_min_thrust": 4.0}, "input_min_thrust: got 4, expected 5 at least"),
        ({"fence_max_z": 500.0}, "fence_max_z: got 500, expected 120 at most"),
        ({"input_max_thrust": 9.0}, "input_max_thrust: got 9, expected 12.8 at least"),
        ({"input_min_thrust": 9.9}, "input_min_thrust: got 9.9, expected 8.34 at most"),
        ({"input_max_roll": 0.001}, "input_max_roll: got 0.001, expected 0.1 at least"),
        ({"input_min_pitch": -0.05}, "input_min_pitch: got -0.05, expected -0.1 at most"),
        ({"input_rate_thrust": 0.001}, "input_rate_thrust: got 0.001, expected 10 at least"),
        ({"fence_max_z": 2.0}, "fence_max_z: got 2, expected 2 m above fence_min_z at least"),
        ({"Q_z": 0.0}, "Q_z: got 0, expected more than 0"),
        ({"speed": 0.1}, "speed: got 0.1, expected 0.2 at least"),
        ({"horizon": 20.0}, "horizon: not among what may be changed in flight"),
        ({"Q_x": 2.0, "speed": -1.0}, "speed: got -1.0"),
    ],
)
def test_a_refused_change_leaves_all_as_it_was(tuning, take, values, words):
    assert tuning.change({"Q_y": 7.0}, take)[0]
    made, sentence = tuning.change(values, take)
    assert not made
    assert words in sentence and words in tuning.refusal
    assert len(take.taken) == 1
    assert tuning.changes == {"Q_y": 7.0}
    assert values_of(tuning.parameters) == {**values_of(PARAMETERS), "Q_y": 7.0}


def test_what_cannot_be_put_into_force_is_refused_too(tuning, take):
    take.error = ProblemError("boom")
    assert tuning.change({"Q_y": 7.0}, take) == (False, "refused: boom")
    assert tuning.changes == {} and tuning.refusal == "boom"


def test_a_good_change_clears_the_refusal_and_adds_up(tuning, take):
    tuning.change({"speed": -1.0}, take)
    assert tuning.change({"speed": 3.0}, take) == (True, "in force: speed 3")
    assert tuning.refusal == ""
    assert tuning.change({"eta": 10.0}, take) == (True, "in force: eta 10, speed 3")
    assert take.taken[-1].limits.speed == 3.0 and take.taken[-1].avoidance.eta == 10.0
    assert tuning.change({"speed": 8.0}, take)[0], "opened again up to the launch's"
    assert tuning.changes == {"eta": 10.0}
    assert tuning.change({}, take, anew=True) == (True, "in force: as in the files")
    assert values_of(take.taken[-1]) == values_of(PARAMETERS)


def test_a_preset_comes_below_what_was_changed_by_hand(tuning, take):
    tuning.change({"Q_x": 9.0, "speed": 3.0}, take)
    indoor = load_weights("indoor")
    tuning.use_weights(indoor, take)
    weights = take.taken[-1].weights
    assert weights.Q[0] == 9.0 and weights.Q[1] == indoor.Q[1]
    assert take.taken[-1].limits.speed == 3.0


def test_the_controller_keeps_the_old_ones_and_the_same_solver():
    controller = Controller(PARAMETERS)
    for name in ("attitude", "imu", "velocity", "position"):
        getattr(controller.estimator, f"add_{name}")(
            1.0,
            (0.0, 0.0, 0.0, 1.0) if name == "attitude" else (0.0, 0.0, 5.0 * (name == "position")),
        )
    solver, tuning = controller.nmpc.solver, Tuning(PARAMETERS, LEAST)
    before = controller.nmpc._theta.copy()
    assert not tuning.change({"Q_x": -1.0}, controller.use)[0]
    crossed = replace(PARAMETERS.limits, fence_min=PARAMETERS.limits.fence_max + 1.0)
    with pytest.raises(ProblemError):
        controller.use(replace(PARAMETERS, limits=crossed))
    assert controller.parameters is PARAMETERS
    assert np.array_equal(controller.nmpc._theta, before)
    assert tuning.change({"Q_x": 6.0, "speed": 2.0}, controller.use)[0]
    assert controller.nmpc.solver is solver, "nothing is built anew"
    assert controller.parameters.limits.speed == 2.0
    assert not np.array_equal(controller.nmpc._theta, before)
    assert controller.step(1.0).plan.found
    assert hover_state(np.zeros(3)).shape == (10,)


def test_bounds_that_cross_are_refused(tuning):
    controller = Controller(PARAMETERS)
    made, sentence = tuning.change({"fence_min_z": 50.0, "fence_max_z": 40.0}, controller.use)
    assert not made and "fence_min" in sentence
    assert controller.parameters is PARAMETERS


def test_a_name_is_refused_as_such():
    with pytest.raises(TuningError, match="mass"):
        with_values(PARAMETERS, {"mass": 3.0})
