# SPDX-License-Identifier: MIT
"""Read by catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "nmpc_control",
            "nmpc_control.analysis",
            "nmpc_control.analysis.identification",
            "nmpc_control.laser_tracking",
            "nmpc_control.ros",
        ],
        package_dir={"": "src"},
    )
)
