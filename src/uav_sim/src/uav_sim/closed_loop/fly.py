# SPDX-License-Identifier: MIT
"""Fly one scenario in the simulator through ROS, record it, and say how it went.

Starts a ROS master of its own, simulator, controller, guard, markers and recorder; an operator
then starts, flies and lands. Leaves <scenario>_<time>.bag with .json, figures and report.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Dict, List, Optional
from xmlrpc.client import ServerProxy

from nmpc_control.errors import NmpcError
from nmpc_control.scenario import Scenario, load_scenario, scenario_path
from uav_sim.closed_loop.command import fail, failing_in_one_line
from uav_sim.preset import load_preset

_PROGRAM = "fly"
_DEFAULT_PORT = 11311
_MASTER_TIMEOUT = 30.0  # [s] wall time for roslaunch to set the parameters
_STOP_TIMEOUT = 20.0  # [s] wall time for roslaunch to end its nodes


def main(argv: Optional[List[str]] = None) -> None:
    """Entry point of ``rosrun uav_sim fly``.

    Exit status 0 only if the flight arrived and hit nothing.
    """
    options = _parser().parse_args(argv)
    with failing_in_one_line(_PROGRAM):
        scenario = load_scenario(options.scenario)
        load_preset(options.plant)
        if not 0.0 < options.speed <= 20.0:
            raise NmpcError(f"--speed: got {options.speed:g}, expected a number in (0, 20]")
        options.bags.mkdir(parents=True, exist_ok=True)
    bag = options.bags / f"{scenario.name}_{time.strftime('%Y%m%d-%H%M%S')}.bag"
    for closing in (signal.SIGTERM, signal.SIGHUP):  # as Ctrl-C: end everything that was started
        signal.signal(closing, signal.default_int_handler)
    status = _fly(options, scenario, bag)
    if status is None:
        _say(f"interrupted; what was recorded is in {bag}")
        sys.exit(1)
    sys.exit(_judge(bag, status))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=_PROGRAM, description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        default="multi_obstacle",
        help="name of a scenario, or path of a YAML file",
    )
    parser.add_argument(
        "--plant", default="dji_hil", help="plant preset of the simulator (default: %(default)s)"
    )
    parser.add_argument("--vehicle", help="the controller's model of it (default: as the plant)")
    parser.add_argument(
        "--backend", default="compiled", choices=["compiled", "ipopt"], help="solver"
    )
    parser.add_argument(
        "--avoidance", default="on", choices=["on", "off"], help="off: fly into obstacles"
    )
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        help="simulated seconds per second (default: %(default)s)",
    )
    parser.add_argument(
        "--bags", type=Path, default=Path("bags"), help="folder for bag, JSON and report"
    )
    parser.add_argument(
        "--port", type=int, default=0, help="of the ROS master (default: 11311 if free, else any)"
    )
    parser.add_argument("--rviz", action="store_true", help="open RViz")
    return parser


def _fly(options: argparse.Namespace, scenario: Scenario, bag: Path) -> Optional[int]:
    """Run the flight; returns the operator's exit status, None if it was interrupted."""
    environment = _environment(options.port or _free_port())
    path = scenario_path(options.scenario).resolve()
    launch = [
        "roslaunch",
        "-p",
        environment["ROS_MASTER_URI"].rsplit(":", 1)[1],
        "uav_sim",
        "fly.launch",
        f"scenario:={path}",
        f"scenario_file:={path}",
        f"plant:={options.plant}",
        f"vehicle:={options.vehicle or options.plant}",
        f"backend:={options.backend}",
        f"avoidance:={str(options.avoidance == 'on').lower()}",
        f"speed:={options.speed}",
        f"bag:={bag.resolve()}",
        f"rviz:={str(options.rviz).lower()}",
    ]
    if options.rviz and not os.environ.get("DISPLAY"):
        _say("there is no display (DISPLAY is not set): RViz will not open")
    log, master = bag.with_suffix(".log"), environment["ROS_MASTER_URI"]
    _say(f"flying {scenario.name} on {options.plant}, ROS_MASTER_URI={master}, log {log}")
    with open(log, "w", encoding="utf-8") as output:
        nodes = subprocess.Popen(
            launch, stdout=output, stderr=output, env=environment, start_new_session=True
        )
        operator = None
        try:
            _wait_for_simulated_time(nodes, master)
            operator = subprocess.Popen(
                ["rosrun", "nmpc_control", "fly_scenario", scenario.name],
                env=environment,
                start_new_session=True,
            )
            while operator.poll() is None:
                if nodes.poll() is not None:
                    _say(f"the nodes ended unexpectedly, see {log}")
                    _end(operator, signal.SIGKILL)
                    break
                time.sleep(0.2)
            return operator.returncode if operator.returncode is not None else 1
        except KeyboardInterrupt:
            return None
        finally:
            if operator is not None:
                _end(operator, signal.SIGINT)
            _end(nodes, signal.SIGINT)


def _wait_for_simulated_time(nodes: "subprocess.Popen[bytes]", master_uri: str) -> None:
    """Return when the master knows that time is simulated.

    A node that starts earlier would use wall time.
    """
    master = ServerProxy(master_uri)
    deadline = time.monotonic() + _MASTER_TIMEOUT
    while nodes.poll() is None and time.monotonic() < deadline:
        try:
            if master.getParam("/fly", "/use_sim_time")[2] is True:
                return
        except OSError:
            pass
        time.sleep(0.05)


def _judge(bag: Path, operator_status: int) -> int:
    """Evaluate the bag; returns the exit status of the whole command."""
    if not bag.exists():
        fail(_PROGRAM, f"{bag}: no bag was recorded, see {bag.with_suffix('.log')}")
    figures = bag.with_suffix(".json")
    command = [
        "rosrun",
        "nmpc_control",
        "flight_metrics",
        str(bag),
        "--json",
        str(figures),
        "--report",
        str(bag.parent),
    ]
    if subprocess.run(command, check=False).returncode != 0:
        fail(_PROGRAM, f"{bag}: no metrics")
    metrics = json.loads(figures.read_text(encoding="utf-8"))
    _say(f"bag {bag}\n     metrics {figures}\n     report {bag.with_suffix('.html')}")
    good = operator_status == 0 and metrics["arrived"] and metrics["collisions"] == 0
    _say(
        "arrived, hit nothing"
        if good
        else f"NOT as it should: arrived {metrics['arrived']}, "
        f"collisions {metrics['collisions']}, operator ended with {operator_status}"
    )
    return 0 if good else 1


def _environment(port: int) -> Dict[str, str]:
    """Return an environment with a master of our own, reachable from this machine only."""
    return {
        **os.environ,
        "ROS_MASTER_URI": f"http://localhost:{port}",
        "ROS_HOSTNAME": "localhost",
        "ROS_IP": "127.0.0.1",
        "PYTHONUNBUFFERED": "1",
    }


def _free_port() -> int:
    for port in (_DEFAULT_PORT, 0):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return probe.getsockname()[1]
    fail(_PROGRAM, "no free port for a ROS master")


def _end(process: "subprocess.Popen[bytes]", how: signal.Signals) -> None:
    """Signal a process group and make sure that it is gone."""
    for sign, patience in ((how, _STOP_TIMEOUT), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
        if process.poll() is not None:
            return
        os.killpg(process.pid, sign)
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            continue


def _say(text: str) -> None:
    sys.stdout.write(f"fly: {text}\n")
    sys.stdout.flush()
