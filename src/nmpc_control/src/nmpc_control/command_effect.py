# SPDX-License-Identifier: MIT
"""Whether the aircraft follows what it is commanded: an authority lost silently shows here alone.

dji_sdk acknowledges no setpoint and publishes no owner of the control (uav_sim/doc/dji_sdk.md 5).
Attitude commands are compared with the attitude through lags around the model's: what part of the
changes commanded is found again in the changes measured, over the last second. DJI's velocity hold
is compared with the speed that should fall. In hover nothing is commanded that could be missed, and
a steady tilt against wind is what any other control would hold too: that counts as nothing.
"""

import math
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.params import Vehicle
from nmpc_control.state import PITCH, ROLL, ROLL_REF, VELOCITY

MEMORY = 1.0  # [s] over which both are compared
STEADY = 2.0  # [s] what changes more slowly says nothing
LAGS = (0.4, 1.0, 2.5)  # [1] of the model's time constant
LATER = (-0.5, 0.0, 1.0)  # [1] of the model's delay
MISSING = 0.3  # [1] part of the commands found again below which they have no effect
FOUND = 0.5  # [1] above which they have
FOREIGN = 4.0  # [1] times more tilting than commanded: somebody else flies
HOLD_DECELERATION = 1.0  # [m/s^2] that DJI's own brake reaches at least
HOLD_DELAY = 0.5  # [s] until it does
HOLD_SLACK = 0.8  # [m/s] by which a gust may move the aircraft meanwhile
HOLD_SPEED = 1.5  # [m/s] from which on a brake proves something

Sent = Sequence[Tuple[float, np.ndarray]]


class CommandEffect:
    """Time of commands without effect: since the mode began, and since the last proof."""

    def __init__(self, vehicle: Vehicle, tilt: float) -> None:
        """Begin without commands.

        Args:
            vehicle: lags of the attitude, delay.
            tilt: [rad] rms of the changes commanded, below which they say nothing.
        """
        self.power = tilt * tilt * MEMORY
        self._gain = np.array([vehicle.roll.gain, vehicle.pitch.gain])
        constants = np.array([vehicle.roll.time_constant, vehicle.pitch.time_constant])
        self._delays = [vehicle.delay * (1.0 + k) for k in LATER]
        self._constants = np.tile(np.outer(LAGS, constants), (len(LATER), 1))  # (9, 2)
        self.forget()

    def forget(self) -> None:
        """Begin anew, as when nothing is commanded any more."""
        self.time = 0.0  # [s] without effect, in this mode
        self.total = 0.0  # [s] without effect since the last that had one
        self._interrupt()

    def enter_mode(self) -> None:
        """Count the time in the mode anew."""
        self.time = 0.0

    def follow_attitude(self, t: float, dt: float, sent: Sent, state: np.ndarray) -> None:
        """Compare the attitude with what was commanded.

        Args:
            t: [s] now.
            dt: [s] since the last time.
            sent: (time [s], input (4,)) oldest first, the attitude commands among them.
            state: (10,) measured at ``t``.
        """
        self._hold_since = None
        measured = state[ROLL : PITCH + 1]
        if self._expected is None:
            self._expected = np.tile(measured, (len(self._constants), 1))
            self._steady, self._steady_measured = self._expected.copy(), measured.copy()
        share = 1.0 - np.exp(-dt / self._constants)
        self._expected += share * (self._commanded(t, sent, measured) - self._expected)
        slow, kept = 1.0 - math.exp(-dt / STEADY), math.exp(-dt / MEMORY)
        self._steady += slow * (self._expected - self._steady)
        self._steady_measured += slow * (measured - self._steady_measured)
        e, m = self._expected - self._steady, measured - self._steady_measured
        self._asked = kept * self._asked + dt * np.sum(e * e, axis=1)
        self._both = kept * self._both + dt * (e @ m)
        self._done = kept * self._done + dt * float(m @ m)
        self._judge(dt, *self._found())

    def follow_hold(self, t: float, dt: float, state: np.ndarray, wanted: np.ndarray) -> None:
        """Compare the velocity with that which DJI's own control was told to fly, as zero.

        Arguments as above, ``wanted`` (3,) [m/s]; another one is given its time.
        """
        speed = float(np.linalg.norm(state[VELOCITY] - wanted))
        if self._hold_since is None or not np.array_equal(wanted, self._hold_velocity):
            self._interrupt()
            self._hold_since, self._hold_speed, self._hold_velocity = t, speed, wanted
        braked = max(0.0, t - self._hold_since - HOLD_DELAY) * HOLD_DECELERATION
        allowed = max(0.0, self._hold_speed - braked) + HOLD_SLACK
        has_braked = self._hold_speed > HOLD_SPEED and speed < self._hold_speed / 2.0
        self._judge(dt, speed > allowed, has_braked)

    def _interrupt(self) -> None:
        self._expected: Optional[np.ndarray] = None  # (9, 2) [rad] by lag
        self._asked, self._both, self._done = np.zeros(9), np.zeros(9), 0.0  # [rad^2 s]
        self._hold_since: Optional[float] = None
        self._hold_speed, self._hold_velocity = 0.0, np.zeros(3)

    def _commanded(self, t: float, sent: Sent, measured: np.ndarray) -> np.ndarray:
        """Return the attitude (9, 2) [rad] that takes effect at ``t``, by delay."""
        commands = np.tile(measured, (len(self._delays), 1))
        for row, delay in enumerate(self._delays):
            for when, u in reversed(sent):
                if when <= t - delay:
                    commands[row] = self._gain * u[ROLL_REF : ROLL_REF + 2]
                    break
        return np.repeat(commands, len(LAGS), axis=0)

    def _found(self) -> Tuple[bool, bool]:
        """Return whether commands have no effect, and whether they have one; or neither."""
        if self._asked.min() >= self.power:
            part = float(np.max(self._both / self._asked))
            return part < MISSING, part > FOUND
        is_foreign = self._done > FOREIGN * max(self.power, float(self._asked.max()))
        return is_foreign, False

    def _judge(self, dt: float, has_none: bool, has_one: bool) -> None:
        if has_none:
            self.time += dt
            self.total += dt
        elif has_one:
            self.time = self.total = 0.0
