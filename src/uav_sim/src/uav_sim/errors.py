# SPDX-License-Identifier: MIT
"""Errors that the simulator raises on bad input."""


class SimulatorError(Exception):
    """Root of all errors raised by this package; its text is one line fit for a user."""


class ConfigError(SimulatorError):
    """A configuration is wrong: file, key, value and what was expected."""

    def __init__(self, source: str, key: str, value: object, expected: str) -> None:
        super().__init__(f"{source}: {key}: got {value!r}, expected {expected}")


class SetpointError(SimulatorError):
    """A setpoint that cannot be decoded; the text says why."""
