# SPDX-License-Identifier: MIT
"""Offline analysis of recorded and simulated flights; needs no ROS."""
