# SPDX-License-Identifier: MIT
"""The fault matrix: what may go wrong, in which situation, and what must come of it."""
