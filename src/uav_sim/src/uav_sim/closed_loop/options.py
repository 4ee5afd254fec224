# SPDX-License-Identifier: MIT
"""Values that several commands take on their command line."""

import argparse


def seed(text: str) -> int:
    """Return a seed; raises ArgumentTypeError on a negative number."""
    return _whole(text, 0)


def count(text: str) -> int:
    """Return a number of things; raises ArgumentTypeError on one below 1."""
    return _whole(text, 1)


def _whole(text: str, least: int) -> int:
    value = int(text)
    if value < least:
        raise argparse.ArgumentTypeError(f"got {text}, expected a whole number, {least} or more")
    return value
