# SPDX-License-Identifier: MIT
"""Linear responses, exact for a held reference, and dead times, on a fixed time step."""

import math
from collections import deque
from typing import Tuple, Union

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


class DeadTime:
    """Ring buffer that returns held inputs a dead time later.

    Where the dead time is no multiple of the step, inputs that change within one are averaged.
    """

    def __init__(self, delay: float, step: float, value: float = 0.0) -> None:
        steps = delay / step
        whole = math.floor(steps + 1e-9)
        self.fraction = max(0.0, steps - whole) if steps - whole > 1e-9 else 0.0
        self.length = whole + (2 if self.fraction else 1)
        self._ring = deque([value] * self.length, maxlen=self.length)

    def fill(self, value: float) -> None:
        """Replace everything under way by one value."""
        self._ring.extend([value] * len(self._ring))

    def push(self, value: float) -> float:
        """Put in the input of this step and return the delayed one."""
        ring = self._ring
        ring.append(value)
        if self.fraction:
            return ring[1] + self.fraction * (ring[0] - ring[1])
        return ring[0]


class PairDeadTime:
    """DeadTime of two inputs at once."""

    def __init__(self, delay: float, step: float) -> None:
        line = DeadTime(delay, step)
        self._fraction = line.fraction
        self._ring = deque([(0.0, 0.0)] * line.length, maxlen=line.length)

    def fill(self, first: float, second: float) -> None:
        """Replace everything under way by one pair of values."""
        self._ring.extend([(first, second)] * len(self._ring))

    def push(self, first: float, second: float) -> Tuple[float, float]:
        """Put in the inputs of this step and return the delayed ones."""
        ring = self._ring
        ring.append((first, second))
        if self._fraction:
            (a, b), (c, d), part = ring[0], ring[1], self._fraction
            return c + part * (a - c), d + part * (b - d)
        return ring[0]
