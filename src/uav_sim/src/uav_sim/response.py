# SPDX-License-Identifier: MIT
"""Linear responses, exact for a held reference, and dead times, on a fixed time step."""

import math
from collections import deque
from typing import Union

from uav_sim.preset import FirstOrder, Response, SecondOrder


class LagState:
    """A first-order response in motion."""

    def __init__(self, response: FirstOrder, step: float) -> None:
        self.value = 0.0
        self.rate = 0.0  # time derivative of the value
        self._gain = response.gain
        self._inverse_time = 1.0 / response.time_constant
        self._decay = math.exp(-step / response.time_constant)

    def advance(self, reference: float) -> float:
        """Advance one step with the reference held; return the new value."""
        target = self._gain * reference
        self.value = target + self._decay * (self.value - target)
        self.rate = (target - self.value) * self._inverse_time
        return self.value


class NoLag:
    """A response that is there at once."""

    def __init__(self, value: float) -> None:
        self.value = value

    def advance(self, reference: float) -> float:
        """Take the reference; return it."""
        self.value = reference
        return reference


class OscillatorState:
    """A second-order response in motion."""

    def __init__(self, response: SecondOrder, step: float) -> None:
        self.value = 0.0
        self.rate = 0.0  # time derivative of the value
        self._gain = response.gain
        sigma = response.zeta * response.omega
        damped = response.omega * math.sqrt(abs(1.0 - response.zeta**2))
        if damped * step < 1e-9:
            c, s = 1.0, step
        elif response.zeta < 1.0:
            c, s = math.cos(damped * step), math.sin(damped * step) / damped
        else:
            c, s = math.cosh(damped * step), math.sinh(damped * step) / damped
        decay = math.exp(-sigma * step)
        self._a11, self._a12 = decay * (c + sigma * s), decay * s
        self._a21, self._a22 = -decay * response.omega**2 * s, decay * (c - sigma * s)

    def advance(self, reference: float) -> float:
        """Advance one step with the reference held; return the new value."""
        target = self._gain * reference
        error, rate = self.value - target, self.rate
        self.rate = self._a21 * error + self._a22 * rate
        self.value = value = target + self._a11 * error + self._a12 * rate
        return value


def make_response(response: Response, step: float) -> Union[LagState, OscillatorState]:
    """Return the state, at rest, of a response for a time step [s]."""
    if isinstance(response, FirstOrder):
        return LagState(response, step)
    return OscillatorState(response, step)


def make_lag(time_constant: float, step: float, value: float) -> Union[LagState, NoLag]:
    """Return a lag of unit gain for a time step [s], at rest at a value; without a lag at 0 s."""
    if not time_constant:
        return NoLag(value)
    lag = LagState(FirstOrder(1.0, time_constant), step)
    lag.value = value
    return lag


class DeadTime:
    """Ring buffer that returns held inputs a dead time later.

    Where the dead time is no multiple of the step, inputs that change within one are averaged.
    """

    def __init__(self, delay: float, step: float, value: float = 0.0) -> None:
        steps = delay / step
        whole = math.floor(steps + 1e-9)
        self._fraction = max(0.0, steps - whole) if steps - whole > 1e-9 else 0.0
        length = whole + (2 if self._fraction else 1)
        self._ring = deque([value] * length, maxlen=length)

    def fill(self, value: float) -> None:
        """Replace everything under way by one value."""
        self._ring.extend([value] * len(self._ring))

    def push(self, value: float) -> float:
        """Put in the input of this step and return the delayed one."""
        ring = self._ring
        ring.append(value)
        if self._fraction:
            return ring[1] + self._fraction * (ring[0] - ring[1])
        return ring[0]
