# SPDX-License-Identifier: MIT
"""A long flight through ROS on a busy machine: jitter, gaps, memory, markers, time of a tick."""
