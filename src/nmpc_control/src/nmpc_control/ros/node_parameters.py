# SPDX-License-Identifier: MIT
"""The controller's parameters as a launch file selects them."""

from dataclasses import replace

import rospy

from nmpc_control.errors import ConfigError
from nmpc_control.params import Parameters, load_parameters


def load_node_parameters() -> Parameters:
    """Return the parameters that the private ROS parameters select; raises ConfigError."""
    vehicle = rospy.get_param("~vehicle", "")
    if not vehicle:
        raise ConfigError("parameter", "~vehicle", vehicle, "the name of a file in config/vehicles")
    weights = rospy.get_param("~weights", "") or "outdoor"
    parameters = load_parameters(vehicle, weights, profile=rospy.get_param("~profile", ""))
    backend = rospy.get_param("~backend", parameters.solver.backend)
    if backend not in ("compiled", "ipopt"):
        raise ConfigError("parameter", "~backend", backend, "compiled or ipopt")
    avoidance = bool(rospy.get_param("~avoidance", parameters.avoidance.enabled))
    return replace(
        parameters,
        solver=replace(parameters.solver, backend=backend),
        avoidance=replace(parameters.avoidance, enabled=avoidance),
    )
