# SPDX-License-Identifier: MIT
"""A ROS master of its own for each test, with everything that was started beside it.

A process can call ``rospy.init_node`` only once, so no test does: the client part of a test is a
program of its own, run with ``RosSession.run`` and judged by the JSON in its last line.

    def test_something(ros):                      # fixture in conftest.py
        ros.launch("uav_sim", "simulator.launch", preset="eth")
        ros.wait_for_node("/uav_sim")             # before a client: it sets /use_sim_time
        result = ros.run_json("client.py", "argument", timeout=60)
        assert result["answer"] == 42
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Dict, List
from xmlrpc.client import ServerProxy

WORKSPACE = Path(__file__).parents[2]
_GRACE = 20.0  # [s] roslaunch itself gives its nodes 17 s


def workspace_environment() -> Dict[str, str]:
    """Return the environment of the built workspace; RuntimeError says why there is none."""
    setup = WORKSPACE / "devel" / "setup.bash"
    if not setup.is_file():
        raise RuntimeError(f"the workspace is not built: no {setup.relative_to(WORKSPACE)}")
    command = ["bash", "-c", f"source '{setup}' && env -0"]
    listing = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return dict(line.split("=", 1) for line in listing.split("\0") if "=" in line)


def free_port() -> int:
    """Return a TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class RosSession:
    """A master on a free port; ``stop`` ends the process groups started here, and only those."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory  # logs and output of everything that was started
        self.port = free_port()
        self.environment = {
            **workspace_environment(),
            "ROS_MASTER_URI": f"http://localhost:{self.port}",
            "ROS_HOSTNAME": "localhost",
            "ROS_HOME": str(directory),
            "ROS_LOG_DIR": str(directory / "log"),
            "PYTHONUNBUFFERED": "1",
        }
        self.environment.pop("ROS_IP", None)
        self._processes: List[subprocess.Popen] = []
        self.start("roscore", "-p", str(self.port))
        self._wait_for_master(30.0)

    def start(self, *command: str) -> subprocess.Popen:
        """Start a program in its own process group, with its output in ``output_<n>.txt``."""
        path = self.directory / f"output_{len(self._processes)}.txt"
        with open(path, "w", encoding="utf-8") as output:
            process = subprocess.Popen(
                command,
                env=self.environment,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._processes.append(process)
        return process

    def launch(self, package: str, file: str, **arguments: Any) -> subprocess.Popen:
        """Start a launch file; arguments become ``name:=value``."""
        values = [f"{name}:={_word(value)}" for name, value in arguments.items()]
        return self.start("roslaunch", "--wait", package, file, *values)

    def run(self, program: str, *arguments: str, timeout: float = 60.0) -> str:
        """Run a Python program beside this file to its end; return what it printed."""
        command = [sys.executable, str(Path(__file__).parent / program), *arguments]
        done = subprocess.run(
            command,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
        assert done.returncode == 0, f"{program} failed:\n{done.stderr}\n{self.output()}"
        return done.stdout

    def run_json(self, program: str, *arguments: str, timeout: float = 60.0) -> Any:
        """Run a program beside this file; return the JSON in the last line that it printed."""
        return json.loads(self.run(program, *arguments, timeout=timeout).splitlines()[-1])

    def wait_for_node(self, name: str, timeout: float = 30.0) -> None:
        """Return when the master knows a node; AssertionError after a wall time [s]."""
        master = ServerProxy(self.environment["ROS_MASTER_URI"])
        deadline = time.monotonic() + timeout
        while master.lookupNode("/ros_session", name)[0] != 1:
            assert time.monotonic() < deadline, f"no node {name}\n{self.output()}"
            time.sleep(0.1)

    def output_of(self, process: subprocess.Popen) -> str:
        """Return all that a program started here has printed."""
        number = self._processes.index(process)
        return (self.directory / f"output_{number}.txt").read_text(encoding="utf-8")

    def output_of_all(self) -> str:
        """Return all that everything started here has printed."""
        return "\n".join(map(self.output_of, self._processes))

    def output(self) -> str:
        """Return the last lines of everything that was started, for a failure's text."""
        parts = []
        for path in sorted(self.directory.glob("output_*.txt")):
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines()[-40:]
            parts.append("\n".join([f"--- {path.name}", *lines]))
        return "\n".join(parts)

    def stop(self) -> None:
        """End everything that was started, the newest first."""
        for process in reversed(self._processes):
            _signal_group(process, signal.SIGINT)
            try:
                process.wait(_GRACE)
            except subprocess.TimeoutExpired:
                pass
            _signal_group(process, signal.SIGKILL)
            process.wait()

    def _wait_for_master(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.1)
        raise RuntimeError(f"no ROS master after {timeout:g} s\n{self.output()}")


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _signal_group(process: subprocess.Popen, number: int) -> None:
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        pass
