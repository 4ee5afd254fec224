# SPDX-License-Identifier: MIT
"""Read by catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "uav_sim",
            "uav_sim.closed_loop",
            "uav_sim.closed_loop.bench",
            "uav_sim.closed_loop.campaign",
            "uav_sim.closed_loop.faults",
            "uav_sim.closed_loop.replay",
            "uav_sim.closed_loop.soak",
            "uav_sim.faults",
            "uav_sim.ros",
        ],
        package_dir={"": "src"},
    )
)
