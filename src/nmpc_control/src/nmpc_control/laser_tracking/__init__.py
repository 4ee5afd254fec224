# SPDX-License-Identifier: MIT
"""Scans of a 2D laser on the aircraft to tracked vertical cylinders with velocity.

Interface: ``LaserTracker(load_laser_parameters())``; for each scan ``update(scan, poses)`` with a
``Scan`` and a ``PoseHistory``, then ``obstacles()``. ``doc/laser_tracking.md`` has the method.
"""
