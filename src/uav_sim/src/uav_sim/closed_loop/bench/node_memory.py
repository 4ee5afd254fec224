# SPDX-License-Identifier: MIT
"""Memory of the real nodes: controller and guard, flying nothing, beside the simulator.

They run on a ROS master of their own. Everything is started here and ended here; where the ROS
programs are absent nothing is measured.
"""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Optional
from xmlrpc.client import Fault, ServerProxy

from uav_sim.errors import SimulatorError

NODES = {"node_memory_mb": "/nmpc_controller", "guard_memory_mb": "/flight_guard"}
_PLANS = 100  # 5 s of solving
_START_TIMEOUT = 60.0  # [s] until a node is known
_PLANS_TIMEOUT = 60.0  # [s] until so many plans have come
_GRACE = 20.0  # [s] roslaunch gives its nodes 17 s
_CALLER = "/bench"


def measure(plant: str) -> Dict[str, float]:
    """Return resident memory [MB] of both nodes after some seconds of solving; {} without ROS.

    Args:
        plant: preset of the simulator and vehicle of the controller.

    Raises:
        SimulatorError: a node did not come up, or made no plan.
    """
    if any(shutil.which(program) is None for program in ("roscore", "roslaunch", "rostopic")):
        return {}
    with tempfile.TemporaryDirectory() as folder, _session(Path(folder), plant) as environment:
        master = ServerProxy(environment["ROS_MASTER_URI"])
        processes = {key: _process_of(master, name) for key, name in NODES.items()}
        _wait_for_plans(environment)
        return {key: resident_memory(process) for key, process in processes.items()}


def resident_memory(process: int) -> float:
    """Return VmRSS of a process [MB]; not the greatest, which begins with what its parent held."""
    status = Path(f"/proc/{process}/status").read_text(encoding="utf-8")
    kilobytes = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    return int(kilobytes) / 1024.0


@contextmanager
def _session(folder: Path, plant: str) -> Iterator[Dict[str, str]]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://localhost:{port}",
        "ROS_HOSTNAME": "localhost",
        "ROS_HOME": str(folder),
        "ROS_LOG_DIR": str(folder / "log"),
    }
    environment.pop("ROS_IP", None)
    vehicle = f"vehicle:={plant}"
    commands = (
        ["roscore", "-p", str(port)],
        ["roslaunch", "--wait", "uav_sim", "simulator.launch", f"preset:={plant}"],
        [
            "roslaunch",
            "--wait",
            "nmpc_control",
            "control.launch",
            vehicle,
            "scenario:=multi_obstacle",
            "simulated:=true",
        ],
    )
    started: List[subprocess.Popen] = []
    try:
        for command in commands:
            started.append(_start(command, environment))
        yield environment
    finally:
        for process in reversed(started):
            _end(process)


def _start(command: List[str], environment: Dict[str, str]) -> subprocess.Popen:
    silent = subprocess.DEVNULL
    return subprocess.Popen(
        command, env=environment, stdout=silent, stderr=silent, start_new_session=True
    )


def _end(process: subprocess.Popen) -> None:
    for number in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
            process.wait(_GRACE)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue


def _process_of(master: ServerProxy, name: str) -> int:
    """Return the process number of a node when the master knows it."""

    def ask() -> Optional[int]:
        code, _, uri = master.lookupNode(_CALLER, name)
        return ServerProxy(uri).getPid(_CALLER)[2] if code == 1 else None

    return _wait_for(ask, _START_TIMEOUT, f"node {name}")


def _wait_for(ask: Callable[[], Optional[int]], timeout: float, what: str) -> int:
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        try:
            answer = ask()
        except (OSError, Fault):
            answer = None
        if answer is not None:
            return answer
        time.sleep(0.1)
    raise SimulatorError(f"memory of the nodes: no {what} after {timeout:g} s")


def _wait_for_plans(environment: Dict[str, str]) -> None:
    command = ["rostopic", "echo", "-n", str(_PLANS), "/nmpc/plan/found"]
    try:
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PLANS_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise SimulatorError(f"memory of the nodes: not {_PLANS} plans in time") from None
    if done.returncode != 0 or "True" not in done.stdout:
        raise SimulatorError("memory of the nodes: the controller made no plan")
