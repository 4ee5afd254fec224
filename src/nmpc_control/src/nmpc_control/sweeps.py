# SPDX-License-Identifier: MIT
"""The functions of the compiled backend, compiled once in a process for each structure."""

from functools import lru_cache
from typing import Dict, List

import casadi as ca

from nmpc_control.compiled_function import compile_functions
from nmpc_control.ocp import Structure
from nmpc_control.riccati import backward
from nmpc_control.rollout import forward, settle


def sweeps(structure: Structure) -> List[ca.Function]:
    """Return the functions that are compiled for a structure."""
    both = [backward(structure, exact) for exact in (False, True)]
    return [*both, forward(structure), settle(structure)]


@lru_cache(maxsize=8)
def compiled(structure: Structure) -> Dict[str, ca.Function]:
    """Return them by name, compiled."""
    return compile_functions(sweeps(structure))
