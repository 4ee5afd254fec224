# SPDX-License-Identifier: MIT
"""Values that several commands take on their command line."""

import argparse


def seed(text: str) -> int:
    """Return a seed; raises ArgumentTypeError on a negative number."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"got {text}, expected a whole number, 0 or more")
    return value
