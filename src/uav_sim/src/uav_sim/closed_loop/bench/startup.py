# SPDX-License-Identifier: MIT
"""How long a process takes from its start to its first plan, and how much memory it holds then.

Run as a program it does just that; ``measure`` starts it twice, first without compiled code.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Dict, Tuple

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.params import load_parameters
from nmpc_control.state import hover_input, hover_state
from uav_sim.closed_loop.bench.node_memory import resident_memory


def measure() -> Dict[str, float]:
    """Return first and later start [s], and resident memory [MB] of the later process.

    Wall time, and beside it the processor time that does not grow with the load of the machine.
    """
    figures: Dict[str, float] = {}
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NMPC_CACHE": cache}
        for name in ("first", "later"):
            wall, processor, figures["memory_mb"] = _start(environment)
            figures[f"{name}_start_s"], figures[f"{name}_start_cpu_s"] = wall, processor
    return figures


def _start(environment: Dict[str, str]) -> Tuple[float, float, float]:
    start, spent = time.perf_counter(), _children()
    command = [sys.executable, "-m", "uav_sim.closed_loop.bench.startup"]
    result = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    wall = time.perf_counter() - start
    return wall, _children() - spent, json.loads(result.stdout)["memory_mb"]


def _children() -> float:
    """Return the processor time [s] of all processes started here that have ended."""
    times = os.times()
    return times.children_user + times.children_system


def main() -> None:
    """Solve once and report the memory."""
    nmpc = Nmpc(load_parameters())
    x0 = hover_state(np.zeros(3))
    nmpc.solve(0.0, x0, np.tile(x0, (nmpc.structure.horizon + 1, 1)), hover_input())
    sys.stdout.write(json.dumps({"memory_mb": resident_memory(os.getpid())}) + "\n")


if __name__ == "__main__":
    main()
