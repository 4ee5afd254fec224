# SPDX-License-Identifier: MIT
"""Where a figure was measured: machine, load and versions."""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict

import casadi as ca
import numpy as np
import scipy


def machine() -> Dict[str, Any]:
    """Return processor, number of processors, memory, system, and the load average now."""
    return {
        "processor": _field("/proc/cpuinfo", "model name") or platform.processor(),
        "processors": os.cpu_count(),
        "memory": _field("/proc/meminfo", "MemTotal"),
        "system": platform.platform(),
        "load_average": list(os.getloadavg()),
    }


def versions() -> Dict[str, str]:
    """Return the versions of what computes."""
    return {
        "python": sys.version.split()[0],
        "casadi": ca.__version__,
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "compiler": _compiler(),
    }


def _compiler() -> str:
    program = shutil.which("cc")
    if program is None:
        return "none: CasADi's interpreter"
    output = subprocess.run([program, "--version"], check=False, capture_output=True, text=True)
    return output.stdout.splitlines()[0] if output.stdout else program


def _field(path: str, name: str) -> str:
    """Return the value of the first ``name: value`` line of a file, empty where there is none."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith(name)), "")
