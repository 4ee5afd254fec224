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
from pathlib import Path
from typing import Dict, Tuple

import numpy as np

from nmpc_control.nmpc import Nmpc
from nmpc_control.params import load_parameters
from nmpc_control.state import hover_input, hover_state


def measure() -> Dict[str, float]:
    """Return first and later start [s], and resident memory [MB] of the later process."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "NMPC_CACHE": cache}
        first, _ = _start(environment)
        later, memory = _start(environment)
    return {"first_start_s": first, "later_start_s": later, "memory_mb": memory}


def _start(environment: Dict[str, str]) -> Tuple[float, float]:
    start = time.perf_counter()
    command = [sys.executable, "-m", "uav_sim.closed_loop.bench.startup"]
    result = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return time.perf_counter() - start, json.loads(result.stdout)["memory_mb"]


def main() -> None:
    """Solve once and report the memory."""
    nmpc = Nmpc(load_parameters())
    x0 = hover_state(np.zeros(3))
    nmpc.solve(0.0, x0, np.tile(x0, (nmpc.structure.horizon + 1, 1)), hover_input())
    # not ru_maxrss: that of a child begins with what its parent held
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    kilobytes = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    sys.stdout.write(json.dumps({"memory_mb": int(kilobytes) / 1024.0}) + "\n")


if __name__ == "__main__":
    main()
