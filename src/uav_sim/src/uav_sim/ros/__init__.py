# SPDX-License-Identifier: MIT
"""The simulator's ROS shell."""
