# SPDX-License-Identifier: MIT
"""Fly through ROS for minutes with one core kept busy; write figures, say which bars are kept.

The simulator runs at real time on this machine. A bare 50 Hz process beside it tells what the
machine does to any such process: jitter, gaps and the time of a tick count above that. The time of
a tick, from newest state to command, is taken in a second flight of two minutes without load.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Dict, List, Optional

import numpy as np

from nmpc_control.scenario import load_scenario, scenario_path
from uav_sim.closed_loop.bench.machine import machine
from uav_sim.closed_loop.command import failing_in_one_line
from uav_sim.closed_loop.options import between
from uav_sim.closed_loop.soak.figures import figures, rows, table
from uav_sim.errors import SimulatorError
from uav_sim.preset import load_preset

_PROGRAM = "soak"
BURN = "while True: pass"
EXTRA = 180.0  # [s] wall time beside the flight, for start and landing
QUIET_MINUTES = 2.0  # of flight without them, for the time of a tick
GRACE = 20.0  # [s] roslaunch itself gives its nodes 17 s


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``soak``; exit status 1 where a bar is not kept, 2 on bad input."""
    options = _parser().parse_args(argv)
    with failing_in_one_line(_PROGRAM):
        scenario = load_scenario(options.scenario)
        load_preset(options.plant)
        options.json.parent.mkdir(parents=True, exist_ok=True)
        busy = _fly(options, scenario.name, options.minutes, options.burners)
        quiet = _fly(options, scenario.name, min(options.minutes, QUIET_MINUTES), 0)
        found = {**figures(busy, quiet), "machine": machine(), "busy_processes": options.burners}
        found["rows"] = [row._asdict() for row in rows(found)]
        options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    sys.stdout.write(f"{table(found)}\n{_PROGRAM}: {options.json}\n")
    sys.exit(0 if all(row.passed for row in rows(found)) else 1)


def _fly(
    options: argparse.Namespace, name: str, minutes: float, burners: int
) -> Dict[str, np.ndarray]:
    """Return what was noted beside so many busy processes.

    Raises SimulatorError where the flight did not come about.
    """
    with tempfile.TemporaryDirectory() as folder:
        file, log = Path(folder) / "noted.npz", Path(folder) / "log.txt"
        path = scenario_path(options.scenario).resolve()
        port = _free_port()
        environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://localhost:{port}",
            "ROS_HOSTNAME": "localhost",
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": folder,
        }
        command = [
            *("roslaunch", "-p", str(port), "uav_sim", "soak.launch"),
            f"minutes:={minutes}",
            f"scenario:={name}",
            f"scenario_file:={path}",
            f"plant:={options.plant}",
            f"file:={file}",
        ]
        started: List[subprocess.Popen] = []
        try:
            for _ in range(burners):
                burner = [sys.executable, "-c", BURN]
                started.append(subprocess.Popen(burner, stderr=subprocess.DEVNULL))
            with open(log, "w", encoding="utf-8") as output:
                started.append(
                    subprocess.Popen(
                        command,
                        env=environment,
                        stdout=output,
                        stderr=output,
                        start_new_session=True,
                    )
                )
            started[-1].wait(60.0 * minutes + EXTRA)
        except subprocess.TimeoutExpired:
            pass
        finally:
            for process in reversed(started):
                _end(process)
        if not file.is_file():
            last = log.read_text(encoding="utf-8", errors="replace").splitlines()[-20:]
            raise SimulatorError("the flight did not come about:\n" + "\n".join(last))
        with np.load(file) as noted:
            return dict(noted)


def _end(process: subprocess.Popen) -> None:
    """End a process, and all that roslaunch has started."""
    if process.poll() is not None:
        return
    is_leader = os.getpgid(process.pid) == process.pid
    for number in (signal.SIGINT, signal.SIGKILL):
        if is_leader:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        try:
            process.wait(GRACE)
            return
        except subprocess.TimeoutExpired:
            continue


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "--minutes",
        type=between(0.1, 600.0, "minutes"),
        default=10.0,
        help="of flight (default: %(default)s)",
    )
    parser.add_argument("--scenario", default="multi_obstacle", help="flown again and again")
    parser.add_argument("--plant", default="dji_hil", help="preset of the simulator")
    parser.add_argument("--burners", type=int, default=1, help="processes that compute for nothing")
    parser.add_argument("--json", type=Path, default=Path("build/soak.json"), help="figures")
    return parser
