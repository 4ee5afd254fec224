# SPDX-License-Identifier: MIT
"""Errors that the package raises on bad input; at run time failure is data, not an exception."""


class NmpcError(Exception):
    """Root of all errors raised by this package; its text is one line fit for a user."""


class ConfigError(NmpcError):
    """A configuration or scenario is wrong: file, key, value and what was expected."""

    def __init__(self, source: str, key: str, value: object, expected: str) -> None:
        super().__init__(f"{source}: {key}: got {value!r}, expected {expected}")


class ProblemError(NmpcError):
    """An optimal control problem was posed with unusable numbers (shape, NaN, min > max)."""


class BagError(NmpcError):
    """A bag cannot be read, or holds nothing that can be evaluated."""
