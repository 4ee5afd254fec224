# SPDX-License-Identifier: MIT
"""Parameters of vehicle, problem, solver and controller.

Values live in ``config/*.yaml``, here is what they mean.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Optional

import numpy as np

from nmpc_control.battery_thrust import BatteryCurve
from nmpc_control.config import config_directory, from_dict, load_profile, load_yaml, overlay

LINEAR_SOLVERS = ("mumps", "ma27", "ma57", "ma77", "ma86", "ma97")  # all but the first are HSL


def _array(length: int, minimum: float = -1e9) -> np.ndarray:
    return field(metadata={"length": length, "min": minimum})


def _positive() -> float:
    return field(metadata={"min": 1e-6})


def _non_negative() -> float:
    return field(metadata={"min": 0.0})


@dataclass(frozen=True)
class Lag:
    """First-order response of one inner loop.

    ``x' = (gain * reference - x) / time_constant`` (paper, Eq. 3).
    """

    time_constant: float = _positive()  # [s]; the paper's tau / k
    gain: float = _positive()  # [1] static gain; 1 in the paper


@dataclass(frozen=True)
class ThrustMap:
    """Affine map of the DJI thrust percentage.

    ``thrust = slope * percent + offset``, at hover attitude.
    """

    slope: float = _positive()  # [m/s^2 per percent]
    offset: float = field()  # [m/s^2]
    minimum: float = field(metadata={"min": 0.0, "max": 100.0})  # [percent] least that is sent
    maximum: float = field(metadata={"min": 0.0, "max": 100.0})  # [percent] most that is sent
    measured_on: str = field()  # airframe and date of the measurement; empty: not measured

    def percent(self, thrust: float) -> float:
        """Return the percentage for a thrust [m/s^2], clamped to the map's range."""
        return min(max((thrust - self.offset) / self.slope, self.minimum), self.maximum)

    def thrust(self, percent: float) -> float:
        """Return the mass-normalised thrust [m/s^2] of a percentage."""
        return self.slope * percent + self.offset


@dataclass(frozen=True)
class Vehicle:
    """What the controller knows of the aircraft that it flies."""

    name: str
    mass: float = _positive()  # [kg] only to convert published thrust figures
    radius: float = _non_negative()  # [m] hull: centre to the outermost propeller tip
    roll: Lag = field()
    pitch: Lag = field()
    yaw_rate: Lag = field()
    drag: np.ndarray = _array(3, 0.0)  # (3,) [1/s] world x, y, z
    delay: float = _non_negative()  # [s] dead time from command to effect in the telemetry
    tilt_limit: float = (
        _positive()
    )  # [rad] the flight controller's own limit of the tilt vector's norm
    thrust_map: ThrustMap = field()
    disturbance: np.ndarray = field(  # (3,) [m/s^2] constant acceleration in the world frame
        default_factory=lambda: np.zeros(3), metadata={"length": 3}
    )
    battery: Optional[BatteryCurve] = None  # what the charge leaves of the thrust; None: all


@dataclass(frozen=True)
class Weights:
    """Weights of Eq. 5, all diagonal.

    They multiply squared errors in SI units, without a factor 1/2.
    """

    Q: np.ndarray = _array(10, 0.0)
    Q_f: np.ndarray = _array(10, 0.0)
    R: np.ndarray = _array(4, 0.0)
    R_delta: np.ndarray = _array(4, 0.0)


@dataclass(frozen=True)
class Limits:
    """Bounds of the inputs, which always hold (paper, Eq. 6), and bounds softened exactly."""

    input_min: np.ndarray = _array(4)  # (4,) [m/s^2, rad, rad, rad/s]
    input_max: np.ndarray = _array(4)  # (4,)
    input_rate: np.ndarray = _array(4, 0.0)  # (4,) [m/s^3, rad/s, rad/s, rad/s^2]
    speed: float = _positive()  # [m/s]
    fence_min: np.ndarray = _array(3)  # (3,) [m] least x, y and height
    fence_max: np.ndarray = _array(3)  # (3,) [m]
    soft_weight: float = _positive()  # [1/m] of the L1 penalty on what is softened

    def encloses(self, points: np.ndarray) -> bool:
        """Return whether points (..., 3) [m] are all inside the fence; one that is NaN is not."""
        return bool(np.all((points >= self.fence_min) & (points <= self.fence_max)))

    def within(self, vehicle: Vehicle) -> "Limits":
        """Return the limits that the vehicle can really follow.

        Its thrust range, its tilt limit on each axis.
        """
        thrust_map, tilt = vehicle.thrust_map, vehicle.tilt_limit
        low = np.array([thrust_map.thrust(thrust_map.minimum), -tilt, -tilt, -np.inf])
        high = np.array([thrust_map.thrust(thrust_map.maximum), tilt, tilt, np.inf])
        low, high = np.maximum(self.input_min, low), np.minimum(self.input_max, high)
        return replace(self, input_min=low, input_max=high)


@dataclass(frozen=True)
class Avoidance:
    """How obstacles enter the problem; distances are counted from the hull."""

    enabled: bool = field()
    term: str = field(
        metadata={"choices": ("potential", "hard", "barrier")}
    )  # Eq. 8 in the cost; Eq. 7 softened exactly; that, and a potential that begins before it
    eta: float = _non_negative()  # gain of the potential where it is the term
    safety_distance: float = _non_negative()  # [m] hull to surface
    inflation: float = _non_negative()  # [m] before the margin where the potential begins
    cushion: float = _non_negative()  # [m] the same of the barrier
    cushion_gain: float = _non_negative()  # of the barrier's potential
    weight: float = _positive()  # [1/m] of the L1 penalty on Eq. 7
    pace: float = field(metadata={"min": 0.0})  # [1] times the reference's speed at most; 0: any
    guides: int = field(metadata={"min": 0, "max": 8})  # other ways round tried in one tick
    allowance: float = _non_negative()  # [m] added to the margin of Eq. 7: least tracking error


@dataclass(frozen=True)
class Budget:
    """How often a backend solves, and when a solve ends."""

    rate: float = _positive()  # [Hz] solves per second
    max_iterations: int = field(metadata={"min": 1, "max": 1000})
    warm_iterations: int = field(metadata={"min": 1, "max": 1000})  # the same from the last plan
    time_budget: float = _positive()  # [s] wall time for one solve
    tolerance: float = _positive()  # [1] see the solver's


@dataclass(frozen=True)
class Solver:
    """Which backend solves the problem, its structure and its budget."""

    backend: str = field(metadata={"choices": ("compiled", "ipopt")})
    integrator: str = field(metadata={"choices": ("exact_lag", "rk4", "euler")})
    horizon: int = field(metadata={"min": 2, "max": 1000})  # N, number of stages
    dt: float = _positive()  # [s]
    obstacle_slots: int = field(metadata={"min": 0, "max": 256})
    linear_solver: str = field(metadata={"choices": LINEAR_SOLVERS})  # of ipopt
    compiled: Budget
    ipopt: Budget

    @property
    def budget(self) -> Budget:
        """Budget of the backend that is used."""
        return self.compiled if self.backend == "compiled" else self.ipopt

    def with_budget(self, **changes: float) -> "Solver":
        """Return the same solver with parts of the used backend's budget changed."""
        return replace(self, **{self.backend: replace(self.budget, **changes)})


@dataclass(frozen=True)
class Flight:
    """How the controller moves between trajectories."""

    approach_speed: float = _positive()  # [m/s] on the way to the start of a trajectory
    approach_acceleration: float = _positive()  # [m/s^2]
    arrival_distance: float = _positive()  # [m]
    arrival_speed: float = _positive()  # [m/s]
    settle_time: float = (
        _non_negative()
    )  # [s] at rest at the start before the trajectory's clock runs
    arrival_timeout: float = _positive()  # [s] after the end of the trajectory's time
    wait_lag: float = _positive()  # [s] behind the reference from which on it slows down to wait
    catch_up: float = _non_negative()  # [1] faster than its own pace after it has waited
    patience: float = _positive()  # [s] held up by obstacles after which a goal is given up
    state_timeout: float = _positive()  # [s] a state older than this is not flown on
    memory: float = field(default=600.0, metadata={"min": 0.0})  # [s] a goal waits for the pilot


@dataclass(frozen=True)
class Disturbance:
    """How fast a constant disturbance is learnt and how large it may be."""

    time_constant: float = field(metadata={"min": 0.05})  # [s]
    horizontal: float = _non_negative()  # [m/s^2] largest on an axis; 0: none
    vertical: float = _non_negative()  # [m/s^2] the same upward and downward


@dataclass(frozen=True)
class Parameters:
    """Everything the controller needs."""

    vehicle: Vehicle
    weights: Weights
    limits: Limits
    avoidance: Avoidance
    solver: Solver
    flight: Flight
    disturbance: Disturbance


def load_vehicle(name: str, directory: Optional[Path] = None) -> Vehicle:
    """Return the vehicle of ``config/vehicles/<name>.yaml``; raises ConfigError."""
    path = (directory or config_directory()) / "vehicles" / f"{name}.yaml"
    return from_dict(Vehicle, load_yaml(path), path.name)


def load_weights(name: str, directory: Optional[Path] = None) -> Weights:
    """Return the weight preset of ``config/weights/<name>.yaml``; raises ConfigError."""
    path = (directory or config_directory()) / "weights" / f"{name}.yaml"
    return from_dict(Weights, load_yaml(path), path.name)


def load_parameters(
    vehicle: str = "dji_hil",
    weights: str = "outdoor",
    directory: Optional[Path] = None,
    profile: str = "",
) -> Parameters:
    """Return the controller's parameters with a vehicle and a weight preset; raises ConfigError.

    ``profile`` names a file of ``config/profiles`` whose values win over controller.yaml's.
    """
    directory = directory or config_directory()
    path = directory / "controller.yaml"
    changes = load_profile(profile, "controller", directory)
    data = overlay(load_yaml(path), changes, f"{profile}.yaml", "controller")
    return from_dict(_File, data, path.name).with_presets(
        load_vehicle(vehicle, directory), load_weights(weights, directory)
    )


@dataclass(frozen=True)
class _File:
    limits: Limits
    avoidance: Avoidance
    solver: Solver
    flight: Flight
    disturbance: Disturbance

    def with_presets(self, vehicle: Vehicle, weights: Weights) -> Parameters:
        limits = self.limits.within(vehicle)
        return Parameters(
            vehicle, weights, limits, self.avoidance, self.solver, self.flight, self.disturbance
        )
