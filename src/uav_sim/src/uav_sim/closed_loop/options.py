# SPDX-License-Identifier: MIT
"""Values that several commands take on their command line."""

import argparse
from typing import Callable


def seed(text: str) -> int:
    """Return a seed; raises ArgumentTypeError on a negative number."""
    return _whole(text, 0)


def count(text: str) -> int:
    """Return a number of things; raises ArgumentTypeError on one below 1."""
    return _whole(text, 1)


def between(least: float, most: float, unit: str) -> Callable[[str], float]:
    """Return what reads a number within bounds; it raises ArgumentTypeError on another."""

    def number(text: str) -> float:
        value = float(text)
        if not least <= value <= most:
            expected = f"expected {unit} in [{least:g}, {most:g}]"
            raise argparse.ArgumentTypeError(f"got {text}, {expected}")
        return value

    return number


def _whole(text: str, least: int) -> int:
    value = int(text)
    if value < least:
        raise argparse.ArgumentTypeError(f"got {text}, expected a whole number, {least} or more")
    return value
