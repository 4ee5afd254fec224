# SPDX-License-Identifier: MIT
"""Directions of the architecture, held by parsing every source file and by blocked imports."""

import ast
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
PATHS = {name: SRC / name / "src" / name for name in ("nmpc_control", "uav_sim")}

ROS = {
    "actionlib",
    "catkin",
    "catkin_pkg",
    "diagnostic_updater",
    "dji_sdk",
    "dynamic_reconfigure",
    "genpy",
    "message_filters",
    "rosbag",
    "rosgraph",
    "roslaunch",
    "roslib",
    "rosnode",
    "rosparam",
    "rospkg",
    "rospy",
    "rosservice",
    "rostopic",
    "tf",
    "tf2_py",
    "tf2_ros",
}
GUARD = [
    f"nmpc_control.{name}"
    for name in (
        "clearance_check",
        "config",
        "dji",
        "errors",
        "estimator",
        "guard",
        "modes",
        "override",
        "obstacle_memory",
        "params",
        "plan_check",
        "plan_consistency",
        "prediction",
        "rotations",
        "sent_inputs",
        "state",
        "stopping",
        "verdict",
    )
]
SAFETY = {
    f"nmpc_control.{n}"
    for n in (
        "clearance_check",
        "dji",
        "estimator",
        "guard",
        "modes",
        "override",
        "plan_check",
        "plan_consistency",
        "stopping",
    )
}
MATHEMATICS = {
    f"nmpc_control.{n}"
    for n in ("augmented", "constraints", "model", "newton_step", "nmpc", "obstacle_terms", "ocp")
    + ("guides", "other_ways", "packing", "parametric", "riccati", "rollout", "slots")
    + ("small_matrices", "sweeps")
}
SOLVER = MATHEMATICS | {f"nmpc_control.{n}" for n in ("ipopt", "sqp")}
CLOCKS = {"time.perf_counter", "time.monotonic"}
SURROUNDINGS = {"datetime.datetime.now", "datetime.now", "os.environ", "os.getenv", "time.time"}
TIMES_A_SOLVE = {f"nmpc_control.{n}" for n in ("ipopt", "nmpc", "sqp")}
READS_THE_MACHINE = {"nmpc_control.compiled_function"}  # where the compiler is, where its cache is


def load(package):
    """Return the syntax tree of every module of a package by its dotted name."""
    trees = {}
    for path in sorted(PATHS[package].rglob("*.py")):
        parts = path.relative_to(PATHS[package].parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        trees[name] = ast.parse(path.read_text(encoding="utf-8"), str(path))
    return trees


TREES = {**load("nmpc_control"), **load("uav_sim")}


def imported(tree):
    """Return every absolute name that is imported anywhere, also inside functions."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def packages(tree):
    return {name.split(".")[0] for name in imported(tree)}


def dotted(node):
    """Return ``a.b.c`` for such an expression, else an empty text."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        inner = dotted(node.value)
        return f"{inner}.{node.attr}" if inner else ""
    return ""


def mentioned(tree):
    return {dotted(node) for node in ast.walk(tree)} | imported(tree)


def reachable(start):
    """Return the modules of this workspace that importing ``start`` imports, itself included."""
    found, todo = set(), [start]
    while todo:
        name = todo.pop()
        if name in TREES and name not in found:
            found.add(name)
            for other in imported(TREES[name]):
                parts = other.split(".")
                todo += [".".join(parts[:i]) for i in range(1, len(parts) + 1)]
    return found


def part_of(name, *subpackages):
    return any(name == s or name.startswith(f"{s}.") for s in subpackages)


def is_ros(package):
    return package in ROS or package.endswith(("_msgs", "_srvs"))


CONTROL = [n for n in TREES if part_of(n, "nmpc_control")]
SIMULATOR = [n for n in TREES if part_of(n, "uav_sim") and not part_of(n, "uav_sim.closed_loop")]
CORE = [n for n in (*CONTROL, *SIMULATOR) if not part_of(n, "nmpc_control.ros", "uav_sim.ros")]
FLIGHT = [n for n in CORE if not part_of(n, "nmpc_control.analysis")]
EXECUTABLES = [p for part in ("nodes", "scripts") for p in sorted(SRC.glob(f"*/{part}/*"))]
EXECUTABLES = [p for p in EXECUTABLES if p.is_file()]


def test_sources_are_found():
    assert {*GUARD, "nmpc_control.ros.guard_node", "uav_sim.closed_loop"} <= set(TREES)
    assert len(EXECUTABLES) >= 8


@pytest.mark.parametrize("name", CORE)
def test_core_imports_no_ros(name):
    assert not {p for p in packages(TREES[name]) if is_ros(p)}
    assert not {n for n in imported(TREES[name]) if ".ros." in f"{n}."}


@pytest.mark.parametrize("name", CONTROL)
def test_controller_never_imports_the_simulator(name):
    assert "uav_sim" not in packages(TREES[name])


@pytest.mark.parametrize("name", SIMULATOR)
def test_simulator_is_an_implementation_of_its_own(name):
    assert not packages(TREES[name]) & {"nmpc_control", "casadi"}


@pytest.mark.parametrize("name", [*GUARD, "nmpc_control.ros.guard_node"])
def test_guard_reaches_no_solver(name):
    modules = reachable(name)
    assert not {m for m in modules if "casadi" in packages(TREES[m])}
    assert not modules & SOLVER


@pytest.mark.parametrize("name", sorted(SOLVER & set(TREES)))
def test_solver_does_not_reach_what_judges_it(name):
    assert not reachable(name) & SAFETY


@pytest.mark.parametrize("name", sorted(MATHEMATICS & set(TREES)))
def test_mathematics_opens_no_files(name):
    assert not packages(TREES[name]) & {"yaml", "pathlib"}


@pytest.mark.parametrize("name", FLIGHT)
def test_core_does_not_ask_time_or_surroundings(name):
    used = mentioned(TREES[name])
    assert name in READS_THE_MACHINE or not used & SURROUNDINGS
    assert name in TIMES_A_SOLVE or not used & CLOCKS
    assert "matplotlib" not in packages(TREES[name])


@pytest.mark.parametrize("name", sorted(TREES))
def test_imports_are_plain(name):
    tree = TREES[name]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import"
            assert node.names[0].name != "*", f"line {node.lineno}: star import"
        if isinstance(node, ast.Try):
            hidden = [n for n in node.body if isinstance(n, (ast.Import, ast.ImportFrom))]
            assert not hidden, f"line {node.lineno}: import inside try"
    assert "sys.path" not in mentioned(tree)


@pytest.mark.parametrize("path", EXECUTABLES, ids=lambda p: f"{p.parents[1].name}/{p.name}")
def test_executables_hold_no_logic(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    tree = ast.parse("\n".join(lines))
    assert lines[0] == "#!/usr/bin/env python3"
    assert len(lines) <= 6
    assert packages(tree) == {path.parents[1].name}
    assert path.stat().st_mode & 0o111 == 0o111


def test_manifest_and_launch_files_of_the_controller_do_not_use_the_simulator():
    folder = SRC / "nmpc_control"
    for path in [folder / "package.xml", *folder.rglob("*.launch")]:
        for node in ElementTree.parse(str(path)).iter():
            assert node.text is None or "uav_sim" not in node.text, path
            assert node.get("pkg") != "uav_sim", path
            assert not any("find uav_sim" in value for value in node.attrib.values()), path


def import_with_blocked(modules, blocked):
    """Import modules in a fresh interpreter in which the blocked packages cannot be found."""
    program = f"""
import importlib, sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        root = name.split(".")[0]
        if root in {sorted(blocked)!r} or root.endswith(("_msgs", "_srvs")):
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Blocker())
sys.path[:0] = {[str(p.parent) for p in PATHS.values()]!r}
for name in {modules!r}:
    importlib.import_module(name)
"""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


def test_blocking_works():
    result = import_with_blocked(["numpy"], {"numpy"})
    assert result.returncode == 1
    assert "blocked: numpy" in result.stderr


def test_core_imports_where_ros_is_absent():
    result = import_with_blocked([*CORE, "uav_sim.closed_loop.simulate"], ROS)
    assert result.returncode == 0, result.stderr


def test_guard_imports_where_casadi_and_ros_are_absent():
    result = import_with_blocked(GUARD, ROS | {"casadi"})
    assert result.returncode == 0, result.stderr


def test_simulator_imports_where_the_controller_is_absent():
    modules = [n for n in SIMULATOR if n in CORE]
    result = import_with_blocked(modules, ROS | {"casadi", "nmpc_control"})
    assert result.returncode == 0, result.stderr
