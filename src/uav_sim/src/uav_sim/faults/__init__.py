# SPDX-License-Identifier: MIT
"""What can go wrong with a simulated M100, on command or by schedule (doc/faults.md)."""
