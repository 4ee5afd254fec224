# SPDX-License-Identifier: MIT
"""One control step, in the order in which data flows.

Estimate, delay, reference, obstacles, solve.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import Deque, Optional, Sequence, Tuple

import numpy as np

from nmpc_control.disturbance_estimate import DisturbanceEstimate, learnable, steady_input
from nmpc_control.errors import ProblemError
from nmpc_control.estimator import Estimator, StateEstimate
from nmpc_control.itinerary import Itinerary
from nmpc_control.nmpc import Nmpc
from nmpc_control.obstacle import Obstacle
from nmpc_control.obstacle_field import FieldOf
from nmpc_control.params import Parameters, Vehicle
from nmpc_control.prediction import predict
from nmpc_control.solution import no_solution
from nmpc_control.state import POSITION, VELOCITY, YAW, Goal, Plan, hover_input

_INPUT_MEMORY = 2.0  # [s] inputs older than this cannot matter for the delay
_FORGOTTEN = 0.5  # [s] after its effect an input no longer shows in the attitude
_REACTION = 0.3  # [s] for which a velocity is missed before the plan makes up for it
_MOST_MISSED = 0.3  # [m]


@dataclass(frozen=True)
class Step:
    """What one control step produced."""

    estimate: StateEstimate
    reference: np.ndarray  # (10,) at the time of the estimate
    stage_references: np.ndarray  # (N + 1, 10)
    plan: Plan
    goal: Goal
    reference_time: float  # [s] clock of the trajectory at stage 0; NaN while none is flown
    clearance: float  # [m] hull to the nearest obstacle's surface, now; inf without obstacles
    predicted_clearance: float  # [m] the same, least over the plan
    engaged: bool  # whether the guard flew the controller's plans when the step began

    @property
    def deviation(self) -> float:
        """Distance [m] of the estimate from the reference at the same time."""
        return float(np.linalg.norm(self.estimate.vector[POSITION] - self.reference[POSITION]))

    @property
    def is_promise(self) -> bool:
        """Whether others may count on the plan: a pilot's aircraft goes where the pilot wants."""
        return self.engaged and self.plan.found


class Controller:
    """Estimator, itinerary and optimiser behind one ``step(t)``.

    Telemetry and obstacles come in between.
    """

    def __init__(self, parameters: Parameters, vertical_command: str = "thrust") -> None:
        """Begin without a state; ``vertical_command`` is what the guard sends for thrust."""
        self.parameters = parameters
        self.estimator = Estimator()
        self.itinerary = Itinerary(parameters.flight)
        self.nmpc = Nmpc(parameters)
        self.obstacles: Sequence[Obstacle] = ()
        self.engaged = False  # the guard flies these plans
        self.braking = False  # it does not, but brakes and will again
        self.held_back = False  # it brakes for now without leaving the mode that flies them
        self.manual = False  # the pilot flies, or has just given back
        self._inputs: Deque[Tuple[float, np.ndarray]] = deque()
        self._unknown = -np.inf  # [s] when an input was sent last that the model does not have
        self._field_of = FieldOf()
        self._disturbance = DisturbanceEstimate(learnable(parameters.disturbance, vertical_command))

    def use(self, parameters: Parameters) -> None:
        """Take over other weights, limits or margins from the next step on.

        Raises ProblemError on unusable numbers; the old parameters remain in force.
        """
        self.nmpc.use(parameters)
        self.parameters = parameters

    @property
    def disturbance(self) -> np.ndarray:
        """The acceleration (3,) [m/s^2] in the world frame that the model was found to lack."""
        return self._disturbance.acceleration

    def record_input(self, t: float, u: Optional[np.ndarray]) -> None:
        """Remember the input (4,) that was really sent at time ``t`` [s].

        None: something that the model does not have, as DJI's own velocity control or the pilot's;
        level hover is the nearest that is.
        """
        if u is None or not np.all(np.isfinite(u)):
            u, self._unknown = hover_input(), t
        self._inputs.append((t, np.array(u, dtype=float)))
        while self._inputs[0][0] < t - _INPUT_MEMORY:
            self._inputs.popleft()

    def step(self, t: float) -> Optional[Step]:
        """Return the plan for ``t`` [s] and after, or None while the state is missing or stale."""
        estimate = self.estimator.estimate(t)
        if estimate is None or estimate.age > self.parameters.flight.state_timeout:
            self.nmpc.reset()
            return None
        x, engaged = estimate.vector, self.engaged
        if not engaged:
            self._stand_by(t, x)
        else:
            self.itinerary.forget_in_time(t)
            self.itinerary.resume(t)
        held_up = bool(self.nmpc.held_up_by) or self.held_back
        self.itinerary.update(t, x[POSITION], x[VELOCITY], held_up)

        vehicle = self._learn(t, x)
        x0 = predict(x, t, t + vehicle.delay, self._inputs, vehicle)
        times = self.nmpc.stage_times(t)
        sampled = self.itinerary.reference(np.append(times, t))
        references, now = sampled[:-1], sampled[-1]
        plan = self._solve(t, x0, references, steady_input(vehicle, references[0, YAW]))
        clearance, predicted = self._clearances(x[POSITION], t, plan)
        return Step(
            estimate=estimate,
            reference=now,
            stage_references=references,
            plan=plan,
            goal=self.itinerary.goal,
            reference_time=self.itinerary.reference_time(times[0]),
            clearance=clearance,
            predicted_clearance=predicted,
            engaged=engaged,
        )

    def prepare(self) -> None:
        """Do what helps the next step and no plan need wait for, once the last is on its way."""
        self.nmpc.prepare()

    def why_not(self, t: float) -> str:
        """Return why ``step`` has no plan for ``t`` [s]."""
        estimate = self.estimator.estimate(t)
        if estimate is None:
            return "the state is not complete"
        return f"the state is {estimate.age:.2f} s old by the controller's clock"

    def take_up(self, t: float) -> Tuple[bool, str]:
        """Go on with the goal that the pilot interrupted; return whether, and a sentence."""
        estimate = self.estimator.estimate(t)
        if not self.itinerary.waits:
            return False, "nothing waits to be resumed"
        if not self.engaged or estimate is None:
            return False, "automatic flight is off: call `start` first"
        self.itinerary.take_up(t, estimate.vector[POSITION], float(estimate.vector[YAW]))
        return True, "flying to where it was left"

    def _stand_by(self, t: float, x: np.ndarray) -> None:
        """Plan for where the aircraft is; a goal outlasts braking and the pilot, nothing else."""
        if self.braking:
            self.itinerary.suspend(x[POSITION], x[YAW])
            self.itinerary.forget_in_time(t)
        elif self.manual:
            self.itinerary.leave_to_pilot(t, x[POSITION], float(x[YAW]))
        else:
            self.itinerary.hold(x[POSITION], x[YAW], "automatic flight ended")

    def _learn(self, t: float, x: np.ndarray) -> Vehicle:
        """Return the model with what it was found to lack, also told to the optimiser."""
        estimate, vehicle = self._disturbance, self.parameters.vehicle
        if not (self.engaged or self.braking):
            estimate.reset()
        elif t - self._unknown < vehicle.delay + _FORGOTTEN:
            estimate.pause()
        else:
            known = replace(vehicle, disturbance=vehicle.disturbance + estimate.acceleration)
            estimate.update(t, x, self._inputs, known)
        disturbance = vehicle.disturbance + estimate.acceleration
        self.nmpc.expect(disturbance, min(_REACTION * estimate.miss, _MOST_MISSED))
        return replace(vehicle, disturbance=disturbance)

    def _solve(self, t: float, x0: np.ndarray, references: np.ndarray, u_ref: np.ndarray) -> Plan:
        """Return the plan; one that is not found where the problem cannot be posed at all.

        A control tick raises nothing: an obstacle that is nowhere is a reason, not an exception.
        """
        try:
            return self.nmpc.solve(t, x0, references, self._input_before(t), self.obstacles, u_ref)
        except ProblemError as error:
            self.nmpc.reset()
            nothing = no_solution(x0, self.nmpc.structure.horizon, str(error))
            return self.nmpc.as_plan(t, nothing)

    def _input_before(self, t: float) -> np.ndarray:
        """Return the input (4,) in force before ``t``.

        The last one sent, hover where none is recent.
        """
        if self._inputs and t - self._inputs[-1][0] < _INPUT_MEMORY:
            return self._inputs[-1][1]
        return hover_input()

    def _clearances(self, position: np.ndarray, t: float, plan: Plan) -> Tuple[float, float]:
        """Return the distance [m] from hull to surface at a position now, and the plan's least."""
        positions = np.vstack([plan.states[:, POSITION], position])
        field = self._field_of(self.obstacles)
        least = field.distances(positions, np.append(plan.times, t)).min(axis=0, initial=np.inf)
        radius = self.parameters.vehicle.radius
        return float(least[-1]) - radius, float(least[:-1].min()) - radius
