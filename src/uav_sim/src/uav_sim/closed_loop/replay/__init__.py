# SPDX-License-Identifier: MIT
"""Recorded commands flown by a plant preset, and how well it does what the recording shows."""
