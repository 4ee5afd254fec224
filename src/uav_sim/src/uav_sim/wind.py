# SPDX-License-Identifier: MIT
"""Wind: a constant mean and Dryden gusts of low altitude.

Interface: ``Wind(parameters, seed, step)``; ``advance(height, velocity)`` once per ``steps`` plant
steps returns the air's velocity (3,) [m/s] in the world frame; ``mean`` is its constant part.

Spectra, scale lengths and intensities of MIL-F-8785C, section 3.7 (below 1000 ft); those of
MIL-HDBK-1797 are the same functions, with L_v and L_w defined as half as long. The gust is a frozen
field that passes at the airspeed. Below 10 ft and above 1000 ft the values of that height hold.
"""

import math
from dataclasses import dataclass, field
from random import Random
from typing import Tuple, Union

from uav_sim.noise import normals

Vector = Tuple[float, float, float]

FOOT = 0.3048  # [m]
KNOT = 1852.0 / 3600.0  # [m/s]
# [m/s] wind at 20 ft for each level of turbulence (MIL-F-8785C: 15, 30 and 45 knots)
TURBULENCE = {"light": 15.0 * KNOT, "moderate": 30.0 * KNOT, "severe": 45.0 * KNOT}
_LOWEST, _HIGHEST = 10.0, 1000.0  # [ft]
_ROOT3 = math.sqrt(3.0)


@dataclass(frozen=True)
class GustLevel:
    """Gusts by the name of a level; they grow with height as specified."""

    turbulence: str = field(metadata={"choices": tuple(TURBULENCE)})


@dataclass(frozen=True)
class GustSigma:
    """Gusts by their horizontal intensity per axis; the vertical one follows from the height."""

    sigma: float = field(metadata={"min": 0.0})  # [m/s]


@dataclass(frozen=True)
class WindParameters:
    """Mean wind and gusts."""

    speed: float = field(metadata={"min": 0.0})  # [m/s] of the mean
    direction: float = field(metadata={})  # [rad] towards which it blows, left of east
    direction_spread: float = field(metadata={"min": 0.0, "max": math.pi})  # [rad] drawn within +-
    gusts: Union[GustLevel, GustSigma] = field()
    length_factor: float = field(metadata={"min": 1e-3})  # [1] on the scale lengths
    min_airspeed: float = field(metadata={"min": 1e-2})  # [m/s] gusts pass no slower than this
    period: float = field(metadata={"min": 1e-3, "max": 1.0})  # [s] gusts are held this long

    @property
    def is_calm(self) -> bool:
        """Whether there is no wind at all."""
        return self.speed == 0.0 and self.gusts == GustSigma(0.0)


def scale_lengths(height: float) -> Tuple[float, float]:
    """Return L_u = L_v and L_w [m] at a height [m] above ground."""
    h = _feet(height)
    return FOOT * h / (0.177 + 0.000823 * h) ** 1.2, FOOT * h


def intensities(gusts: Union[GustLevel, GustSigma], height: float) -> Tuple[float, float]:
    """Return sigma_u = sigma_v and sigma_w [m/s] at a height [m] above ground."""
    ratio = (0.177 + 0.000823 * _feet(height)) ** 0.4
    if isinstance(gusts, GustSigma):
        return gusts.sigma, gusts.sigma * ratio
    vertical = 0.1 * TURBULENCE[gusts.turbulence]
    return vertical / ratio, vertical


class Wind:
    """The air's velocity at the aircraft; u lies along the mean wind, v to its left, w up."""

    def __init__(self, parameters: WindParameters, seed: str, step: float) -> None:
        self.parameters = p = parameters
        spread = p.direction_spread
        direction = p.direction + Random(seed).uniform(-spread, spread)
        self._cos, self._sin = math.cos(direction), math.sin(direction)
        self.mean: Vector = (p.speed * self._cos, p.speed * self._sin, 0.0)  # [m/s]
        self._draw = normals(seed)
        self.steps = max(1, round(p.period / step))  # of the plant for which a value is held
        self._period = self.steps * step
        self._gusty = p.gusts != GustSigma(0.0)
        # Normalised filter states, begun as after a long time: u of unit variance, and for v and w
        # a pair (p, q) with p' = -p / T + noise and q' = (p - q) / T, so that the variance of q and
        # the covariance are 1/2.
        self._u = self._draw()
        self._v, self._w = self._pair(), self._pair()

    def advance(self, height: float, velocity: Vector) -> Vector:
        """Return the air's velocity (3,) [m/s] for the next ``steps`` steps.

        Args:
            height: of the aircraft above ground [m].
            velocity: of the aircraft (3,) [m/s], world frame.
        """
        return self._gust(height, velocity) if self._gusty else self.mean

    def _gust(self, height: float, velocity: Vector) -> Vector:
        """Advance the filters by one period, exactly for constant coefficients."""
        p, mean = self.parameters, self.mean
        dx, dy, dz = velocity[0] - mean[0], velocity[1] - mean[1], velocity[2]
        airspeed = max(math.sqrt(dx * dx + dy * dy + dz * dz), p.min_airspeed)
        along, up = scale_lengths(height)
        rate = airspeed * self._period / p.length_factor
        horizontal, vertical = intensities(p.gusts, height)
        decay = math.exp(-rate / along)
        self._u = decay * self._u + math.sqrt(1.0 - decay * decay) * self._draw()
        self._v = self._filtered(self._v, rate / along)
        self._w = self._filtered(self._w, rate / up)
        u = horizontal * self._u
        v, w = horizontal * _output(self._v), vertical * _output(self._w)
        return (
            mean[0] + self._cos * u - self._sin * v,
            mean[1] + self._sin * u + self._cos * v,
            w,
        )

    def _pair(self) -> Tuple[float, float]:
        p = self._draw()
        return p, 0.5 * p + 0.5 * self._draw()

    def _filtered(self, pair: Tuple[float, float], r: float) -> Tuple[float, float]:
        """Return (p, q) after ``r`` time constants."""
        p, q = pair
        a, b, pp, pq, qq = lag_pair(r)
        root = math.sqrt(pp)
        rest = math.sqrt(max(qq - pq * pq / pp, 0.0))
        n1, n2 = self._draw(), self._draw()
        return a * p + root * n1, a * q + b * p + pq / root * n1 + rest * n2


def lag_pair(r: float) -> Tuple[float, float, float, float, float]:
    """Return how two equal lags in a row, driven by noise, go on over ``r`` time constants.

    p' = a p + noise, q' = a q + b p + noise; a, b, then variance, covariance and variance of the
    two noises, which keep the stationary covariance ((1, 1/2), (1/2, 1/2)) of p and q.
    """
    a = math.exp(-r)
    a2 = a * a
    return a, r * a, 1.0 - a2, 0.5 - a2 * (r + 0.5), 0.5 - a2 * (r * r + r + 0.5)


def _output(pair: Tuple[float, float]) -> float:
    """Return (1 + sqrt(3) T s) / (1 + T s)^2, of unit variance, from the states."""
    return (_ROOT3 * pair[0] + (1.0 - _ROOT3) * pair[1]) / math.sqrt(2.0)


def _feet(height: float) -> float:
    return min(max(height / FOOT, _LOWEST), _HIGHEST)
