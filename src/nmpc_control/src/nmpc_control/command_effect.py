# SPDX-License-Identifier: MIT
"""Whether the aircraft follows what it is commanded: an authority lost silently shows here alone.

dji_sdk acknowledges no setpoint and publishes no owner of the control (uav_sim/doc/dji_sdk.md 5).
Attitude commands are compared with the attitude through the model's lag, DJI's velocity hold with
the speed that should fall. Near hover both look alike whoever flies: that counts as nothing.
"""

import math
from typing import Optional, Sequence, Tuple

import numpy as np

from nmpc_control.params import Vehicle
from nmpc_control.state import PITCH, PITCH_REF, ROLL, ROLL_REF, VELOCITY

DIFFERS = 0.7  # [1] of the larger of both tilts: the command has no effect
AGREES = 0.4  # [1] of it: it has
PROOF = 0.1  # [s] of agreement
HOLD_DECELERATION = 1.0  # [m/s^2] that DJI's own brake reaches at least
HOLD_DELAY = 0.5  # [s] until it does
HOLD_SLACK = 0.8  # [m/s] by which a gust may move the aircraft meanwhile
HOLD_SPEED = 1.5  # [m/s] from which on a brake proves something


class CommandEffect:
    """Time of commands without effect: since the mode began, and since the last proof."""

    def __init__(self, vehicle: Vehicle, tilt: float) -> None:
        """Begin without commands.

        Args:
            vehicle: lags of the attitude, delay.
            tilt: [rad] below which command and attitude say nothing.
        """
        self.vehicle = vehicle
        self.tilt = tilt
        self.forget()

    def forget(self) -> None:
        """Begin anew, as when nothing is commanded any more."""
        self.time = 0.0  # [s] without effect, in this mode
        self.total = 0.0  # [s] without effect since the last that had one
        self._proof = 0.0
        self._interrupt()

    def enter_mode(self) -> None:
        """Count the time in the mode anew."""
        self.time = 0.0

    def follow_attitude(
        self, t: float, dt: float, sent: Sequence[Tuple[float, np.ndarray]], state: np.ndarray
    ) -> None:
        """Compare the attitude with what was commanded.

        Args:
            t: [s] now.
            dt: [s] since the last time.
            sent: (time [s], input (4,)) oldest first, the attitude commands among them.
            state: (10,) measured at ``t``.
        """
        self._hold_since = None
        measured = state[[ROLL, PITCH]]
        command = _in_force(sent, t - self.vehicle.delay)
        if command is None or self._expected is None:
            self._expected = measured.copy()
            return
        lag, vehicle = self._expected, self.vehicle
        for k, (axis, response) in enumerate(
            ((ROLL_REF, vehicle.roll), (PITCH_REF, vehicle.pitch))
        ):
            step = 1.0 - math.exp(-dt / response.time_constant)
            lag[k] += step * (response.gain * command[axis] - lag[k])
        scale = max(float(np.linalg.norm(lag)), float(np.linalg.norm(measured)))
        error = float(np.linalg.norm(measured - lag))
        if scale >= self.tilt:
            self._judge(dt, error > DIFFERS * scale, error < AGREES * scale)

    def follow_hold(self, t: float, dt: float, state: np.ndarray) -> None:
        """Compare the speed with that of DJI's own brake; arguments as above."""
        self._expected = None
        speed = float(np.linalg.norm(state[VELOCITY]))
        if self._hold_since is None:
            self._hold_since, self._hold_speed = t, speed
        braked = max(0.0, t - self._hold_since - HOLD_DELAY) * HOLD_DECELERATION
        allowed = max(0.0, self._hold_speed - braked) + HOLD_SLACK
        has_braked = self._hold_speed > HOLD_SPEED and speed < self._hold_speed / 2.0
        self._judge(dt, speed > allowed, has_braked)

    def _interrupt(self) -> None:
        self._expected: Optional[np.ndarray] = None
        self._hold_since: Optional[float] = None
        self._hold_speed = 0.0

    def _judge(self, dt: float, differs: bool, agrees: bool) -> None:
        self._proof = self._proof + dt if agrees else 0.0
        if differs:
            self.time += dt
            self.total += dt
        elif self._proof >= PROOF:
            self.time = self.total = 0.0


def _in_force(sent: Sequence[Tuple[float, np.ndarray]], t: float) -> Optional[np.ndarray]:
    """Return the input (4,) sent last before ``t`` [s]; None: nothing was."""
    for when, u in reversed(sent):
        if when <= t:
            return u
    return None
