# SPDX-License-Identifier: MIT
"""What the bench solves: obstacles as in the paper, so that figures stay comparable."""

from dataclasses import replace

from nmpc_control.params import Parameters, load_parameters

PLANT = "dji_hil"
_SLOTS = 8


def bench_parameters(weights: str = "outdoor") -> Parameters:
    """Return the parameters of the bench with a weight preset; raises ConfigError.

    Obstacles enter by the potential of Eq. 8, which every backend and the paper's code have, and
    one solve a tick is all: no other ways round are tried.
    """
    usual = load_parameters(PLANT, weights)
    return replace(
        usual,
        avoidance=replace(usual.avoidance, term="potential", guides=0),
        solver=replace(usual.solver, obstacle_slots=_SLOTS),
    )
