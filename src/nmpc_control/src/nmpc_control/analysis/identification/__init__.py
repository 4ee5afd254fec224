# SPDX-License-Identifier: MIT
"""From recorded flights to the vehicle that the controller believes in (doc/identification.md)."""
