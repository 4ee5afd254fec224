# SPDX-License-Identifier: MIT
"""Errors of what the flight controller reports: position, velocity, attitude, height, IMU.

Interface: ``Sensors(parameters, seed)``; ``inertial`` once per packet (100 Hz), ``navigation`` once
per packet with the 50 Hz topics. ``drift`` is the slow error of the position reported now,
``shared_shift`` that of ``local_position``, which obstacles sensed from the aircraft share, and
``belief`` that by which the flight controller itself is off: it steers by the barometer's height.

Each error is white noise plus a first-order Gauss-Markov process, begun as after a long time:
sigma and correlation e^(-t / time_constant).
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Deque, Tuple

from uav_sim.motion import STILL, Vector
from uav_sim.noise import normals

_FAST, _MEDIUM = 0.01, 0.02  # [s] between samples of attitude and IMU, of the others
_REMEMBERED = 100  # positions whose error is still known when one becomes the reference


@dataclass(frozen=True)
class ErrorParameters:
    """Errors of one quantity, per axis, in its unit."""

    white: float = field(metadata={"min": 0.0})  # sigma, independent from sample to sample
    drift: float = field(metadata={"min": 0.0})  # sigma
    time_constant: float = field(metadata={"min": 1e-3})  # [s] of the drift

    @property
    def is_zero(self) -> bool:
        """Whether there is none."""
        return self.white == 0.0 and self.drift == 0.0


@dataclass(frozen=True)
class SensorParameters:
    """Errors of all quantities."""

    position: ErrorParameters = field()  # [m] of gps_position and local_position; z: see below
    velocity: ErrorParameters = field()  # [m/s]
    attitude: ErrorParameters = field()  # [rad] of roll, pitch, yaw
    gyroscope: ErrorParameters = field()  # [rad/s]
    accelerometer: ErrorParameters = field()  # [m/s^2]
    height: ErrorParameters = field()  # [m] of height_above_takeoff
    height_offset: float = field(metadata={"min": 0.0})  # [m] sigma of the barometer's constant
    # The altitude of gps_position shares the slow error of the height, as it is fused from it.
    altitude_is_barometric: bool = True

    @property
    def is_perfect(self) -> bool:
        """Whether no quantity has an error."""
        errors = (self.position, self.velocity, self.attitude, self.gyroscope, self.accelerometer)
        return self.height_offset == 0.0 and all(e.is_zero for e in (*errors, self.height))


class ErrorProcess:
    """Errors (3,) of one quantity in time."""

    def __init__(self, parameters: ErrorParameters, period: float, seed: str) -> None:
        self._white, sigma = parameters.white, parameters.drift
        self._keep = math.exp(-period / parameters.time_constant)
        self._add = sigma * math.sqrt(1.0 - self._keep * self._keep)
        self._draw = draw = normals(seed)
        self.drift: Vector = STILL
        if sigma > 0.0:
            self.drift = (sigma * draw(), sigma * draw(), sigma * draw())

    def added(self, value: Vector) -> Vector:
        """Go on by one period; return a true value (3,) with the error of the new sample."""
        draw, (a, b, c), (x, y, z) = self._draw, value, self.drift
        if self._add > 0.0:
            keep, add = self._keep, self._add
            x, y, z = keep * x + add * draw(), keep * y + add * draw(), keep * z + add * draw()
            self.drift = (x, y, z)
        white = self._white
        if white > 0.0:
            return (a + x + white * draw(), b + y + white * draw(), c + z + white * draw())
        return (a + x, b + y, c + z)


class Sensors:
    """All errors of one aircraft; each quantity draws from a random stream of its own."""

    def __init__(self, parameters: SensorParameters, seed: str) -> None:
        def process(name: str, period: float) -> ErrorProcess:
            return ErrorProcess(getattr(parameters, name), period, f"{seed}/{name}")

        self._position = process("position", _MEDIUM)
        self._velocity = process("velocity", _MEDIUM)
        self._height = process("height", _MEDIUM)
        self._attitude = process("attitude", _FAST)
        self._gyroscope = process("gyroscope", _FAST)
        self._accelerometer = process("accelerometer", _FAST)
        self.height_offset = parameters.height_offset * normals(f"{seed}/height_offset")()
        self._is_barometric = parameters.altitude_is_barometric
        self._reported: Deque[Tuple[Any, Vector]] = deque(maxlen=_REMEMBERED)
        self._error: Vector = STILL
        self._reference_error: Vector = STILL

    @property
    def drift(self) -> Vector:
        """Slow part (3,) [m] of the reported position's error now."""
        return self.belief if self._is_barometric else self._position.drift

    @property
    def belief(self) -> Vector:
        """Error (3,) [m] of what the flight controller takes for its position now."""
        x, y, _ = self._position.drift
        return (x, y, self._height.drift[2] + self.height_offset)

    @property
    def reference_error(self) -> Vector:
        """Error (3,) [m] of the place that became the reference of ``local_position``."""
        return self._reference_error

    @property
    def shared_shift(self) -> Vector:
        """Slow error (3,) [m] of ``local_position``: of its reference, too."""
        (x, y, z), (rx, ry, rz) = self.drift, self._reference_error
        return (x - rx, y - ry, z - rz)

    def inertial(
        self, rpy: Vector, rates: Vector, acceleration: Vector
    ) -> Tuple[Vector, Vector, Vector]:
        """Return roll, pitch, yaw [rad], body rates [rad/s], specific force [m/s^2] with errors."""
        return (
            self._attitude.added(rpy),
            self._gyroscope.added(rates),
            self._accelerometer.added(acceleration),
        )

    def navigation(
        self, position: Vector, velocity: Vector, height: float
    ) -> Tuple[Vector, Vector, float]:
        """Return position [m], velocity [m/s], height above take-off [m] with errors."""
        ex, ey, ez = self._position.added(STILL)
        height += self.height_offset + self._height.added(STILL)[2]
        if self._is_barometric:
            ez += self.drift[2] - self._position.drift[2]
        (x, y, z), self._error = position, (ex, ey, ez)
        return (x + ex, y + ey, z + ez), self._velocity.added(velocity), height

    def reported(self, place: Any) -> None:
        """Remember the place on earth that the last measured position was reported as."""
        self._reported.append((place, self._error))

    def refer(self, place: Any) -> None:
        """Take a place as the reference of ``local_position``; unless reported, it is exact."""
        errors = [error for reported, error in self._reported if reported == place]
        self._reference_error = errors[-1] if errors else STILL
